"""The search for the optimum, the best reward that a global search finds.

A trial loses reward in proportion to the length of its path in joint space. So this method
searches, over hand sequences, for the shortest path that touches the discs of all goals in their
order. The starts of the search are the shortest paths through posture graphs, which dynamic
programming finds. The method then rounds the best plans to whole control ticks. In some roundings a
goal takes no movement, because the hand is already inside the goal when its turn comes.

The method is the reference for the gaps of all other methods, not a competitor. The study
``studies/optima`` proves bounds on the optima.

``trajectory-optimisation/path-length`` searches for the same paths from other graphs and starts.

With motor noise the shortest path is not the best solution, and in the maximum norm it is not even
the shortest. ``optimum/in-model`` searches in any motion model: CMA-ES varies the targets to
minimise the mean ticks. CMA-ES runs from two starts:

- the path that ``optimum/search`` finds (in the maximum norm with Euclidean lengths);
- the postures of the corrective process with its best hands.

With motor noise, all solutions of a generation are executed with the same 100 noise draws, and
each generation has new draws. The start and the results of each search are then compared on 1,000
draws that no generation has used. The solution with the fewest mean ticks on these draws is the
best known solution in this model; nothing proves that it is the optimum.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from coartic import Task, TaskError, execute, parse_task
from coartic.baselines.cma_strategy import EvolutionStrategy
from coartic.baselines.posture_graph import QUICK, Count, Nodes, cheapest_chains
from coartic.baselines.shortest_paths import REWARD_INFORMATION, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import IPOPT, trajectory_problem
from coartic.method import (
    Facts,
    Information,
    Meter,
    Method,
    MethodError,
    Parameters,
    Result,
    Session,
)
from coartic.method.optimisers import explored_joints
from coartic.model import PAPER, WORLD
from coartic.motion.execution import corrective_trial
from coartic.motion.initial_hands import best_hands
from coartic.motion.solution import movements_of
from coartic.motion.trials import (
    compiled_task,
    hand_codes,
    make_trials,
    noise_draws,
    noise_seed,
    trials_of,
)
from coartic.robot import Array, Configs
from coartic.tasks.task import letters_of

_STEP_SIZE = 0.02  # first step size of CMA-ES, in length units (base) and rad (joints)
_SEARCH = 0x73656172  # key of the worlds in which the search executes solutions
_JUDGED = 10  # times as many executions judge a solution as find it
MAX_KEPT = 64  # hand sequences whose shortest paths are stored with the solution


class OptimumParameters(Parameters):
    """Parameters: restrictions of the movements, and effort of the search."""

    other_arm: Literal["free", "still"] = "free"
    """``"still"`` if the arm whose hand is not chosen for a goal must not move on the way to the
    goal; otherwise ``"free"``."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates to lock in addition to the task's own locks: ``"y"``, ``"xy"``, or
    ``"task"`` for none."""
    nodes: Nodes = 200
    """Largest number of postures in a graph for each pair of goal and hand."""
    graphs: Count = 3
    """Least number of independent graphs. More graphs are made until there are enough chains."""
    chains: Count = 100
    """Least number of chains, over all graphs and hand sequences. With three chains the search
    missed the best known path on 9 of 40 random tasks for one arm."""


class OptimumSearch(Method):
    """Search over hand sequences for the shortest path, rounded to whole ticks."""

    name = "optimum/search"
    version = 2
    tuned_on = "random tasks"
    title = "optimum search"
    facts = Facts(works=("betts1998",), solvers=IPOPT, algorithm="optimum")
    information = REWARD_INFORMATION
    adapts_to = frozenset({"motor_noise", "base_weight"})
    stochastic = False
    Parameters = OptimumParameters
    quick = QUICK

    def solve(self, session: Session) -> Result:
        """Search for the movements with the fewest ticks.

        At most 64 hand sequences are searched in each graph.

        Raises MethodError if no movements that hit every goal are found, or the locks of the base
        make the task invalid.
        """
        parameters: OptimumParameters = self.parameters
        still = parameters.other_arm == "still"
        task = with_locks(session.reveal(*self.information), parameters.base)
        with session.building():
            problem = trajectory_problem(
                task.robot,
                task.hands,
                len(task.goals),
                "path-length",
                session.model.base_weight,
            )
        with session.solving():
            starts = cheapest_chains(
                session,
                task,
                np.random.default_rng(0),
                nodes=parameters.nodes,
                graphs=parameters.graphs,
                chains=parameters.chains,
                spread=not still,
            )
            plans = shortest_plans(session, task, problem, starts, still=still)
            best = fewest_ticks(session, task, problem, plans)
        details = {
            "path_length": plans.ranked[0].cost,
            "path_lengths": {
                letters_of(plan.instance.hands): plan.cost for plan in plans.ranked[:MAX_KEPT]
            },
            "solves": plans.solves,
            "failed_solves": plans.failed,
            "sequences_planned": len(plans.ranked),
        }
        return Result(best.movements, details)


def with_locks(task: Task, base: str) -> Task:
    """Return a task with further base coordinates locked.

    Parameters
    ----------
    task : Task
    base : {"task", "y", "xy"}
        Coordinates to lock; ``"task"`` for none.

    Raises
    ------
    MethodError
        The task with these locks is not valid.
    """
    if base == "task":
        return task
    locked = sorted({*task.locked_base, *base})
    content = {**task.model_dump(mode="json"), "locked_base": locked}
    try:
        return parse_task(content, f"task {task.name!r} with base {' and '.join(locked)} locked")
    except TaskError as error:
        raise MethodError("infeasible", str(error)) from None


class InModelParameters(Parameters):
    """Parameters: effort of the search in any motion model."""

    evaluations: Annotated[int, Field(ge=0)] = 4000
    """Number of solutions that CMA-ES tries from each start; the last generation is completed."""
    executions: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Number of executions of each solution in noise; ten times as many judge it in the end."""
    nodes: Nodes = 200
    graphs: Count = 3
    chains: Count = 100
    """Effort of the search for the shortest path, as for ``optimum/search``."""


class _Start(NamedTuple):
    """A solution from which CMA-ES starts."""

    hands: str
    targets: Configs
    """Targets, shape ``(G, dof)``, in length units and rad. NaN for joints that are not explored,
    and in whole rows for goals that take no movement."""
    ticks: int
    """Ticks of the solution without noise."""


class InModel(Method):
    """Search for the solution with the fewest mean ticks in any motion model, noisy or not."""

    name = "optimum/in-model"
    tuned_on = "ascending and two-armed-2: two step sizes"
    title = "optimum search in the model"
    facts = Facts(
        works=("hansen2016", "betts1998"),
        solvers=IPOPT,
        algorithm="optimum",
        short="optimum in the model",
        headline=False,
    )
    information = REWARD_INFORMATION | {Information.CORRECTIVE_PROCESS}
    adapts_to = frozenset(WORLD)
    stochastic = False
    Parameters = InModelParameters
    quick: ClassVar[Mapping[str, Any]] = QUICK | {"evaluations": 60, "executions": 5}

    def solve(self, session: Session) -> Result:
        """Search from both starts, and return the movements with the fewest mean ticks.

        The details have, for each start, its hands and two mean ticks over the judging draws:
        ``start``, of the start itself, and ``end``, of the best solution found from it.

        Raises MethodError if no path is found and the corrective process completes no sequence.
        """
        task, noise = session.reveal(*self.information), session.model.motor_noise
        executions = self.parameters.executions if noise else 1
        with session.solving():
            starts = {"shortest path": self._path(session, task)}
            starts["corrective process"] = _postures(session, task)
            found = {name: start for name, start in starts.items() if start is not None}
            if not found:
                raise MethodError("infeasible", "neither a path nor corrections hit all goals")
            worst = 2 * [*found.values()][-1].ticks  # of a failed execution
            best, details = (math.inf, "", np.empty(0)), dict[str, dict[str, Any]]()
            for name, start in found.items():
                practise, judge = (mean_ticks_in(session, task, start, worst, n) for n in (0, 1))
                evaluations = self.parameters.evaluations
                points = [start.targets[~np.isnan(start.targets)]]
                points += minima(practise, points[0], evaluations, executions)
                ticks = judge(np.array(points), 0, executions * (_JUDGED if noise else 1))
                least = int(ticks.argmin())
                details[name] = {
                    "hands": start.hands, "start": float(ticks[0]), "end": float(ticks[least]),
                }  # fmt: skip
                if ticks[least] < best[0]:
                    best = float(ticks[least]), name, points[least]
            start = found[best[1]]
            movements = movements_of(start.hands, with_entries(start.targets, best[2][None])[0])
            if not noise:
                movements = execute(task, movements, model=session.model).movements
        return Result(movements, details)

    def _path(self, session: Session, task: Task) -> _Start | None:
        """Return the shortest path of ``optimum/search``, or None if it finds none.

        In the maximum norm, lengths are Euclidean.
        """
        effort = self.parameters.model_dump(include={*OptimumParameters.model_fields})
        model = session.model._replace(norm=PAPER.norm)
        plans = Session(task, session.seed, self.information, model=model, trusted=True)
        try:
            solution = OptimumSearch(OptimumParameters(**effort)).solve(plans).solution
        except MethodError:
            return None
        finally:
            session.spend(**{name: getattr(plans.meter, name) for name in Meter.SOLVER})
        execution = execute(task, solution, model=session.model.without_noise())
        targets = np.full((len(solution), task.robot.dof), np.nan)
        for target, movement in zip(targets, solution, strict=True):
            if movement.kind != "corrective" and movement.target is not None:
                target[:] = np.where(explored_joints(session), movement.target, np.nan)
        return _Start(execution.hands, targets, execution.ticks)


def _postures(session: Session, task: Task) -> _Start | None:
    """Return the postures of the corrective process with its best hands (:func:`.best_hands`).

    The result is None if the process does not complete the task.
    """
    best = best_hands(task, session.model)
    if best is None:
        return None
    hands, ticks = best
    execution = corrective_trial(task, hands, model=session.model.without_noise())
    session.spend(
        forward_kinematics=execution.evaluations,
        corrective_iterations=execution.iterations,
        jacobians=execution.iterations,
    )
    reached = np.where(explored_joints(session), execution.configurations, np.nan)
    return _Start(hands, reached, ticks)


def with_entries(targets: Configs, points: Array) -> Configs:
    """Return N copies of targets, in which the entries that are not NaN are replaced.

    Parameters
    ----------
    targets : ndarray, shape (G, dof)
        Targets, of which n entries are not NaN.
    points : ndarray, shape (N, n)
        For each copy, the values of these n entries, goal by goal.

    Returns
    -------
    ndarray, shape (N, G, dof)
    """
    copies = np.repeat(targets[None], len(points), axis=0)
    copies[:, ~np.isnan(targets)] = points
    return copies


MeanTicks = Callable[[Array, int, int], Array]
"""Function that returns the mean ticks of points, shape ``(N,)``.

Its arguments are the points, shape ``(N, n)``, the number of the first noise draw, and the number
of executions of each point."""


def mean_ticks_in(session: Session, task: Task, start: _Start, worst: int, seed: int) -> MeanTicks:
    """Return a function that computes the mean ticks of points, with the hands of a start.

    A point is a vector of the target entries that are not NaN in the start. All points are executed
    with the same noise draws, whose seed no session uses. A failed execution counts as ``worst``
    ticks.
    """
    compiled = compiled_task(task, session.model)
    world = noise_seed(seed, _SEARCH)

    def mean_ticks(points: Array, first: int, executions: int) -> Array:
        count = len(points) * executions
        targets = np.repeat(with_entries(start.targets, points), executions, axis=0)
        draws = np.tile(first + np.arange(executions), len(points))
        codes = hand_codes(task, start.hands, count)
        records = make_trials(
            compiled, codes, targets[:, :, None], worlds=noise_draws(world, draws)
        )
        trials = trials_of(records, task.robot.dof)
        iterations = int(trials.iterations.sum())
        session.spend(
            forward_kinematics=int(trials.evaluations.sum()),
            corrective_iterations=iterations,
            jacobians=iterations,
        )
        ticks = np.where(trials.completed, trials.ticks, worst)
        means: Array = ticks.reshape(len(points), executions).mean(axis=1)
        return means

    return mean_ticks


def minima(
    mean_ticks: MeanTicks, start: Array, evaluations: int, executions: int
) -> Iterator[Array]:
    """Minimise mean ticks by CMA-ES, and yield two solutions of each restart.

    The two solutions are the last mean, and the best point: the point with the fewest mean ticks
    of all generations of the restart. The next restart begins at the best point, with twice the
    population size.

    Parameters
    ----------
    mean_ticks : callable
        Function to minimise (:data:`MeanTicks`).
    start : ndarray, shape (n,)
        Mean of the first generation.
    evaluations : int
        Number of points to evaluate; the last generation is completed.
    executions : int
        Number of executions of each point. Each generation has new noise draws.

    Yields
    ------
    ndarray, shape (n,)
    """
    rng, tried, draw = np.random.default_rng(0), 0, 0
    size = 4 + int(3 * math.log(max(len(start), 1)))
    while tried < evaluations and len(start):
        evolution, least = EvolutionStrategy(start, _STEP_SIZE, size, rng), math.inf
        while tried < evaluations and not evolution.has_ended():
            points = evolution.ask()
            ticks = mean_ticks(points, draw, executions)
            evolution.tell(points, ticks)
            tried, draw = tried + size, draw + executions
            if ticks.min() < least:
                least, start = float(ticks.min()), points[ticks.argmin()]
        yield evolution.mean
        yield start
        size *= 2


METHODS: tuple[type[Method], ...] = (OptimumSearch, InModel)
