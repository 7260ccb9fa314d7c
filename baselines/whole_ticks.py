"""Round shortest paths to movements of whole control ticks.

A movement takes a whole number of control steps of length m (:attr:`.MotionModel.step`). So a plan
loses up to a step at each segment whose length is not a multiple of m. This module rounds the
lengths of the segments to multiples of m, up or down, and solves for the shortest path again with
these lengths. The target of each movement lies on the straight line in joint space through the
configuration at the goal, beyond this configuration. So the movement ends when the hand enters the
goal.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from coartic import Movement, Task
from coartic.baselines.trajectory_problem import Instance, PathPlan, TrajectoryProblem
from coartic.method import Session
from coartic.motion.doors import move, scale_base
from coartic.robot import Array

MAX_ROUNDINGS = 64  # roundings of a plan that are tried; a plan for up to 7 goals has no more
_SLACK = 1e-6  # part of a step: lengths have the solver's tolerance
_BEYOND = tuple(1 << k for k in range(11))  # numbers of steps from the configuration to the target


@dataclass(frozen=True)
class TickPlan:
    """A plan whose segments have a whole number of steps."""

    steps: tuple[int, ...]
    """Number of control steps to each goal; 0 if there is no movement to the goal, because the hand
    is inside the goal when the goal becomes current."""
    configurations: Array
    """Configuration at each goal, shape ``(G, dof)``."""

    @property
    def ticks(self) -> int:
        """Number of ticks of all movements: k + 1 for a movement of k steps."""
        return sum(steps + 1 for steps in self.steps if steps)


class Rounding:
    """Round plans of one problem and instance to whole steps.

    Parameter ``merged`` of the methods below contains the numbers (from 0) of the goals to which
    there is no movement, because the hand is already inside the goal when the goal becomes current.
    The session counts the effort of the solver.
    """

    def __init__(self, session: Session, problem: TrajectoryProblem, instance: Instance) -> None:
        self._session, self._problem, self._instance = session, problem, instance
        self._step = session.model.step

    def nearest(self, plan: PathPlan) -> TickPlan | None:
        """Round each segment to the nearest number of steps, and the last segment up.

        Before the last segment is rounded, the solver makes it as short as the rounded lengths of
        the other segments allow. To first order, all roundings of a shortest path
        (:meth:`iter_roundings`) take the same number of ticks.

        Parameters
        ----------
        plan : PathPlan
            Shortest plan with a movement to each goal.

        Returns
        -------
        TickPlan or None
            The rounded plan, or None if a solve fails.
        """
        exact = plan.lengths()[:-1] / self._step
        return self.divide(plan, [round(length) for length in exact], ())

    def iter_roundings(self, plan: PathPlan, merged: tuple[int, ...] = ()) -> Iterator[TickPlan]:
        """Yield roundings of a plan to whole steps, at most the 64 nearest.

        The nearest rounding comes first. Each segment except the last is rounded up or down; the
        last segment is rounded up. The distance of a rounding from the plan is the sum, over all
        segments except the last, of the absolute difference between the numbers of steps before and
        after rounding. A plan for up to seven goals has at most 64 roundings, so that all of them
        are tried. Roundings for which the solver fails are left out.
        """
        exact = plan.lengths()[:-1] / self._step
        choices = [sorted({math.floor(length), math.ceil(length)}) for length in exact]
        ranked = sorted(
            itertools.product(*choices),
            key=lambda steps: float(np.abs(np.array(steps) - exact).sum()),
        )
        for steps in ranked[:MAX_ROUNDINGS]:
            rounded = self.divide(plan, list(steps), merged)
            if rounded is not None:
                yield rounded

    def estimated_ticks(self, plan: PathPlan, merged: tuple[int, ...] = ()) -> int:
        """Return an approximate lower bound on the ticks of a plan's roundings.

        The bound is the total length of the plan in control steps, rounded up, plus one tick for
        each movement. Roundings of a shortest plan rarely take fewer ticks.
        """
        length = float(plan.lengths().sum())
        movements = len(self._instance.hands) - len(merged)
        return math.ceil(length / self._step - _SLACK) + movements

    def iter_plans(
        self, plan: PathPlan, task: Task, worth: Callable[[int], bool]
    ) -> Iterator[tuple[tuple[int, ...], PathPlan]]:
        """Yield the shortest plan for each set of goals to which there is no movement.

        The sets come from a breadth-first search. A goal can be in a set if its hand may already be
        inside the goal when the goal becomes current. Sets for which no plan is found are left out.

        Parameters
        ----------
        plan : PathPlan
            Shortest plan with a movement to each goal.
        task : Task
        worth : callable
            Function that returns whether a plan with a given number of ticks is of interest. A set
            of goals is not extended if, by :meth:`estimated_ticks`, no plan for a larger set is of
            interest.

        Yields
        ------
        tuple of int
            Numbers (from 0) of the goals to which there is no movement. The first tuple is empty.
        PathPlan
            Shortest plan found for these goals.
        """
        hands, goals = self._instance.hands, len(self._instance.hands)
        # A hand can be in its goal before this goal becomes current: at the start, if the other
        # hand hits the goal before, or if the discs of these two goals overlap.
        start = task.robot.forward_kinematics(task.q0, hands[0])
        able = [0] if math.dist(start, task.goals[0]) <= task.radius else []
        able += [
            g
            for g in range(1, goals)
            if hands[g] != hands[g - 1]
            or math.dist(task.goals[g], task.goals[g - 1]) <= 2 * task.radius
        ]
        waiting: deque[tuple[tuple[int, ...], PathPlan]] = deque([((), plan)])
        while waiting:
            merged, shortest = waiting.popleft()
            yield merged, shortest
            further = [g for g in able if not merged or g > merged[-1]]
            if not worth(self.estimated_ticks(shortest, merged) - len(further)):
                continue
            for g in further:
                more = (*merged, g)
                merger = self.solve_around(plan.configurations, np.full(goals, np.nan), more)
                if merger.converged:
                    waiting.append((more, merger))

    def divide(self, plan: PathPlan, steps: list[int], merged: tuple[int, ...]) -> TickPlan | None:
        """Solve for the shortest plan whose segments have given numbers of steps.

        Parameters
        ----------
        plan : PathPlan
            Plan from whose configurations the solver starts.
        steps : list of int
            Number of steps to each goal except the last goal. The number of steps to the last goal
            is the smallest that the solver finds.
        merged : tuple of int
            Numbers (from 0) of the goals to which there is no movement.

        Returns
        -------
        TickPlan or None
            The rounded plan, or None if a solve fails.
        """
        lengths = np.array([*steps, np.nan]) * self._step
        shortest = self.solve_around(plan.configurations, lengths, merged)
        if not shortest.converged:
            return None
        last = shortest.lengths()[-1] / self._step
        lengths[-1] = math.ceil(last - _SLACK) * self._step
        # Move the hands as deep into the discs as these lengths allow, so that rounding errors do
        # not matter. If goals are merged, only their hands are moved deep.
        deep = merged or range(len(lengths))
        centred = self.solve_around(shortest.configurations, lengths, merged, deep=deep)
        if not centred.converged:
            return None
        lengths[list(merged)] = 0.0
        rounded = tuple(round(length / self._step) for length in lengths)
        return TickPlan(rounded, centred.configurations)

    def solve_around(
        self,
        start: Array,
        lengths: Array,
        merged: tuple[int, ...],
        *,
        deep: Sequence[int] = (),
    ) -> PathPlan:
        """Solve for a locally shortest plan, beginning from an initial guess.

        Parameters
        ----------
        start : ndarray, shape (G, dof)
            Initial guess of the solver: a configuration at each goal.
        lengths : ndarray, shape (G,)
            Largest joint-space length of each movement; NaN for a movement of any length.
        merged : tuple of int
            Numbers (from 0) of the goals to which there is no movement.
        deep : sequence of int
            Numbers of goals, from 0. If there are any, the solver does not minimise the path
            length; it moves the hands as deep into the discs of these goals as ``lengths`` allow.

        Returns
        -------
        PathPlan
            The plan, which may not have converged.
        """
        instance = self._instance
        if merged:
            lengths, held = lengths.copy(), instance.held.copy()
            lengths[list(merged)] = 0.0
            held[list(merged)] = True
            instance = replace(instance, held=held)
        plan = self._problem.solve(instance, start, lengths=lengths, deep=deep)
        self._session.spend(**plan.spent)
        return plan


def movements(
    session: Session,
    task: Task,
    instance: Instance,
    configurations: Array,
    steps: tuple[int, ...] | None = None,
) -> tuple[Movement, ...]:
    """Return the movements of a plan, one for each goal.

    A joint that ``instance`` holds on the way to a goal keeps its value from the end of the
    previous movement, even if that movement ended before it reached its target.

    Parameters
    ----------
    session : Session
        Session that counts the evaluations of the forward kinematics.
    task : Task
    instance : Instance
        Hands of the goals, and joints that are held.
    configurations : ndarray, shape (G, dof)
        Configuration at each goal, in length units and rad.
    steps : tuple of int, optional
        Largest number of steps of the movement to each goal. The target of a movement then lies on
        the straight line in joint space through the configuration, beyond it, so that the movement
        hits the goal within this number of steps. If no such target is found, the target is the
        configuration itself. For 0 steps the movement is corrective; it takes no ticks if the hand
        is already in the goal. By default all targets are the configurations.

    Returns
    -------
    tuple of Movement
        A movement for each goal.
    """
    planned: list[Movement] = []
    q, model = np.array(task.q0), session.model.without_noise()
    for goal, hand in enumerate(instance.hands):
        wanted = np.where(instance.held[goal], q, configurations[goal])
        if steps is not None and not steps[goal]:
            planned.append(Movement(goal + 1, hand, "corrective", wanted))
            continue
        targets = [wanted]
        if steps is not None:
            length = float(np.linalg.norm(scale_base(wanted - q, model)))
            beyond = model.step / max(length, model.step)
            through = (q + (wanted - q) * (1.0 + k * beyond) for k in _BEYOND)
            targets = [*through, wanted]
        for target in targets:
            result = move(task.robot, q, target, hand, task.goals[goal], task.radius, model=model)
            session.spend(forward_kinematics=result.evaluations)
            if steps is None or (result.hit and result.ticks <= steps[goal] + 1):
                break
        q = result.q
        planned.append(Movement(goal + 1, hand, "planned", target))
    return tuple(planned)
