"""From a shortest path to movements in whole control ticks.

A movement lasts a whole number of steps of length m, so a plan whose segments are not multiples of
m pays for the rest of each. Here the segments are rounded and the plan is solved again around them,
and each movement aims *through* the goal's rim: its target lies beyond, on the same joint-space
line, so that the movement ends by hitting the goal and not by arriving short of it.
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
from coartic.motion.movement import move
from coartic.robot import Array

MOST_ROUNDINGS = 64  # of a plan that are tried: all with up to seven goals
_SLACK = 1e-6  # of a step: lengths are known to the solver's tolerance
_BEYOND = tuple(1 << k for k in range(11))  # steps that a target lies beyond the configuration


@dataclass(frozen=True)
class TickPlan:
    """A plan in whole steps."""

    steps: tuple[int, ...]
    """Movement steps to each goal; 0 where the hand is in the goal when the goal becomes
    current."""
    configurations: Array
    """Configuration at each goal, shape ``(G, dof)``."""

    @property
    def ticks(self) -> int:
        """Number of ticks of all movements: k + 1 for a movement of k steps, 0 for no movement."""
        return sum(steps + 1 for steps in self.steps if steps)


class Rounding:
    """Round plans of one problem and instance; the session counts the solver's effort.

    ``merged`` names goals (0-based) that are hit as their turn comes, without a movement.
    """

    def __init__(self, session: Session, problem: TrajectoryProblem, instance: Instance) -> None:
        self._session, self._problem, self._instance = session, problem, instance
        self._step = session.model.step

    def nearest(self, plan: PathPlan) -> TickPlan | None:
        """Return the plan solved again with each segment except the last in the nearest whole
        number of steps, and the last, as short as it then can be, rounded up; None if a solve
        fails. To first order all roundings of a shortest path (:meth:`every`) have equal ticks."""
        exact = plan.lengths()[:-1] / self._step
        return self.divide(plan, [round(length) for length in exact], ())

    def every(self, plan: PathPlan, merged: tuple[int, ...] = ()) -> Iterator[TickPlan]:
        """Yield roundings of a plan to whole steps, the nearest first: each segment is rounded up
        or down, the last one up. Goals ``merged`` (from 0) are hit without a movement. Of
        the nearest 64 roundings, which are all for up to seven goals, roundings that cannot be
        solved are left out.
        """
        exact = plan.lengths()[:-1] / self._step
        choices = [sorted({math.floor(length), math.ceil(length)}) for length in exact]
        ranked = sorted(
            itertools.product(*choices),
            key=lambda steps: float(np.abs(np.array(steps) - exact).sum()),
        )
        for steps in ranked[:MOST_ROUNDINGS]:
            rounded = self.divide(plan, list(steps), merged)
            if rounded is not None:
                yield rounded

    def least(self, plan: PathPlan, merged: tuple[int, ...] = ()) -> int:
        """Return the ticks of a plan if only its whole length is rounded up, with a movement to
        each goal that is not in ``merged`` (from 0): roundings of a shortest plan hardly take
        fewer."""
        length = float(plan.lengths().sum())
        moved = len(self._instance.hands) - len(merged)
        return math.ceil(length / self._step - _SLACK) + moved

    def plans(
        self, plan: PathPlan, task: Task, worth: Callable[[int], bool]
    ) -> Iterator[tuple[tuple[int, ...], PathPlan]]:
        """Yield pairs: a tuple of goals (from 0) that are hit without a movement, and the shortest
        plan found in which these goals are hit so; first the empty tuple with ``plan`` itself.
        ``worth`` is asked whether a number of ticks is of interest; plans that cannot have such a
        number, by :meth:`least`, are not sought."""
        hands, goals = self._instance.hands, len(self._instance.hands)
        # The hand can be there before: at the start, since another hand hits the goal before, or
        # since the discs of both goals overlap.
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
            if not worth(self.least(shortest, merged) - len(further)):
                continue
            for g in further:
                more = (*merged, g)
                merger = self.solve_around(plan.configurations, np.full(goals, np.nan), more)
                if merger.converged:
                    waiting.append((more, merger))

    def divide(self, plan: PathPlan, steps: list[int], merged: tuple[int, ...]) -> TickPlan | None:
        """Return a plan rounded to ``steps``, a number of steps to each goal except the last, and
        the fewest steps found to the last goal; None if a solve fails. Goals ``merged`` (from 0)
        are hit without a movement."""
        lengths = np.array([*steps, np.nan]) * self._step
        shortest = self.solve_around(plan.configurations, lengths, merged)
        if not shortest.converged:
            return None
        last = shortest.lengths()[-1] / self._step
        lengths[-1] = math.ceil(last - _SLACK) * self._step
        # Hands as deep inside the discs as these lengths allow: safe against rounding, and
        # above all those that are to be there before another hand hits.
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
        """Return the locally shortest plan from the configurations ``start``, shape ``(G, dof)``;
        it may not have converged.

        ``lengths``, shape ``(G,)``, bound the lengths of the movements in joint space; NaN where a
        length is free. Goals in ``merged`` (from 0) are hit without a movement. With ``deep``
        (goals, from 0) the hands are as deep inside the discs of these goals as the lengths allow,
        and the path is not made short. The session counts the solver's effort.
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
    """Return a movement for each goal of an instance, to ``configurations``, shape ``(G, dof)``.

    Joints that are held on the way to a goal stay where they are, even if an earlier movement ended
    by a hit short of its target. With ``steps``, a number per goal, the target of a movement lies
    beyond the configuration, on the same line, so that the movement hits after at most that many
    steps; if no such target does, the target is the configuration. For 0 steps the movement is
    corrective, and not to be made where the hand is in the goal already. The session counts the
    effort.
    """
    planned: list[Movement] = []
    q, model = np.array(task.q0), session.model
    for goal, hand in enumerate(instance.hands):
        wanted = np.where(instance.held[goal], q, configurations[goal])
        if steps is not None and not steps[goal]:
            planned.append(Movement(goal + 1, hand, "corrective", wanted))
            continue
        targets = [wanted]
        if steps is not None:
            beyond = model.step / max(float(np.linalg.norm(wanted - q)), model.step)
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
