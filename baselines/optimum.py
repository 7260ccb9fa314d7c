"""The search for the optimum: the best reward that a global search finds.

Without motor noise, the ticks of a trial are its path length in control steps, rounded up for each
movement, plus one tick for each movement. So ``optimum/search`` searches for the path in joint
space that touches the discs of all goals in their order and is shortest in the Euclidean norm (with
the weight of the base). It searches over all hand sequences if there are at most 64; otherwise a
beam search selects 64 sequences in each graph. The search has three steps:

1. Dynamic programming finds the shortest paths through graphs of sampled postures
   (:mod:`coartic.baselines.posture_graph`).
2. IPOPT shortens each of these paths to a local minimum
   (:mod:`coartic.baselines.trajectory_problem`).
3. The shortest path of each hand sequence is rounded to whole control ticks
   (:mod:`coartic.baselines.whole_ticks`), unless the sequence cannot give fewer ticks than the best
   rounding so far. In some roundings there is no movement to a goal, because the hand is already
   inside the goal when the goal becomes current.

The method is not a competitor: its solutions are among those from which the best known reward of a
task, the reference of all gaps, is chosen. The study ``studies/optima`` proves bounds on the
optima. ``trajectory-optimisation/path-length`` searches for the same paths from other graphs and
starts.

``optimum/in-model`` searches under any motion model. With motor noise the shortest path is not the
best solution. In the maximum norm, the path that is shortest in the Euclidean norm is usually not
the shortest. So CMA-ES varies the targets of the movements to minimise the mean ticks, from two
starts:

- the path that ``optimum/search`` finds (which minimises Euclidean lengths under every norm);
- the postures that the corrective process reaches with its best hands.

With motor noise, all solutions of a generation are executed with the same 100 noise draws (*common
random numbers*), and each generation has new draws. The start and the results of each search are
then compared on 1,000 draws with another noise seed, which no generation has used. The solution
with the fewest mean ticks on these draws is returned; nothing proves that it is the optimum. (100
is the default of parameter ``executions``, and the comparison uses ten times as many draws.)
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
_SEARCH = 0x73656172  # key by which the noise seeds of the search are derived
_JUDGED = 10  # executions in the final comparison, as a multiple of parameter executions
MAX_KEPT = 64  # largest number of hand sequences whose path lengths are stored with the solution


class OptimumParameters(Parameters):
    """Parameters of the search for the optimum: restrictions of movements, and effort."""

    other_arm: Literal["free", "still"] = "free"
    """``"still"`` if the arm whose hand is not chosen for a goal must not move on the way to the
    goal; otherwise ``"free"``."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates to lock in addition to the task's own locks: ``"y"``, ``"xy"``, or
    ``"task"`` for none."""
    nodes: Nodes = 200
    """Number of postures that are sampled in a graph for each pair of goal and hand."""
    graphs: Count = 3
    """Smallest number of independent posture graphs. More graphs are made until there are
    ``chains`` chains."""
    chains: Count = 100
    """Smallest number of chains (paths through a graph) from which IPOPT starts, over all graphs
    and hand sequences. With three chains the search missed the best known path on 9 of 40 random
    tasks for one arm."""


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
        """Search for the movements with the fewest ticks, and return them.

        In each posture graph, at most 64 hand sequences are searched, which a beam search selects.
        The details contain

        - ``path_length``: length of the shortest path before rounding, in a mix of length units and
          rad;
        - ``path_lengths``: dict that maps hand sequences to the lengths of their shortest paths, at
          most 64, the shortest first;
        - ``solves``, ``failed_solves``: number of starts of IPOPT, and how many did not converge;
        - ``sequences_planned``: number of hand sequences for which a path was found.

        Raises MethodError if no movements that hit every goal are found, or if the task is not
        valid with the locks of parameter ``base``.
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
    """Return a task in which further base coordinates are locked.

    Parameters
    ----------
    task : Task
    base : {"task", "y", "xy"}
        Coordinates to lock in addition to the task's own; ``"task"`` for none.

    Returns
    -------
    Task
        The task itself for ``"task"``, otherwise a copy.

    Raises
    ------
    MethodError
        The task with these locks is not valid, for example because a goal is out of reach.
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
    """Parameters that set the effort of the search for the optimum in any motion model."""

    evaluations: Annotated[int, Field(ge=0)] = 4000
    """Number of solutions that CMA-ES tries from each start. The last generation is completed, so
    that the number can be slightly larger."""
    executions: Annotated[int, Field(ge=1, le=10_000)] = 100
    """With motor noise, the number of executions of each solution that CMA-ES tries; the start and
    the results of each search are compared over ten times as many executions. Without motor noise
    each solution is executed once."""
    nodes: Nodes = 200
    graphs: Count = 3
    chains: Count = 100
    """``nodes``, ``graphs`` and ``chains``: effort of the search for the shortest path
    (:class:`OptimumParameters`)."""


class _Start(NamedTuple):
    """A solution from which CMA-ES starts."""

    hands: str
    targets: Configs
    """Targets, shape ``(G, dof)``, in length units and rad. Entries of joints that are not explored
    are NaN, and so are all entries of a goal to which there is no movement."""
    ticks: int
    """Ticks of the solution without noise."""


class InModel(Method):
    """Search for the solution with the fewest mean ticks in any motion model."""

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

        The details map the name of each start that exists to a dict with three entries: the hand
        sequence (``hands``), the mean ticks of the start itself (``start``), and the mean ticks of
        the best solution that was found from this start (``end``). Both means are over the noise
        draws of the final comparison; without motor noise they are the ticks of one execution.

        Raises MethodError if neither start exists: ``optimum/search`` finds no path, and
        :func:`.best_hands` finds no hand sequence with which the corrective process completes the
        task.
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
        """Return the solution of ``optimum/search`` as a start, or None if it finds none.

        The search measures lengths in the Euclidean norm, whatever the norm of the session's model.
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
    """Return the postures of the corrective process with its best hands as a start.

    The hands are those of :func:`.best_hands`. The result is None if :func:`.best_hands` returns
    None.
    """
    best = best_hands(task, session.model)
    if best is None:
        return None
    hands, ticks = best
    execution = corrective_trial(task, hands, model=session.model.without_noise())
    session.spend(forward_kinematics=execution.evaluations)
    reached = np.where(explored_joints(session), execution.configurations, np.nan)
    return _Start(hands, reached, ticks)


def with_entries(targets: Configs, points: Array) -> Configs:
    """Return N copies of targets in which all entries that are not NaN are replaced.

    Parameters
    ----------
    targets : ndarray, shape (G, dof)
        Targets; n of their entries are not NaN.
    points : ndarray, shape (N, n)
        For each copy, the new values of these n entries, goal by goal.

    Returns
    -------
    ndarray, shape (N, G, dof)
        The copies.

    Examples
    --------
    >>> with_entries(np.array([[1.0, np.nan], [2.0, 3.0]]), np.array([[7.0, 8.0, 9.0]]))
    array([[[ 7., nan],
            [ 8.,  9.]]])
    """
    copies = np.repeat(targets[None], len(points), axis=0)
    copies[:, ~np.isnan(targets)] = points
    return copies


MeanTicks = Callable[[Array, int, int], Array]
"""Function that returns the mean ticks of points, shape ``(N,)``.

Its arguments are the points, shape ``(N, n)``, the number of the first noise draw, and the number
of executions of each point."""


def mean_ticks_in(session: Session, task: Task, start: _Start, worst: int, seed: int) -> MeanTicks:
    """Return a function that computes the mean ticks of points.

    A point is a vector of the entries of the targets that are not NaN in the start
    (:func:`with_entries`). In one call of the function, all points are executed with the same noise
    draws. The seed of these draws differs from the noise seeds of sessions and of scoring.

    Parameters
    ----------
    session : Session
        Session that counts the evaluations.
    task : Task
    start : _Start
        Hand sequence of all points, and the targets whose entries the points replace.
    worst : int
        Number of ticks that is used for a failed execution.
    seed : int
        Number from which the noise seed is derived.

    Returns
    -------
    callable
        The function (:data:`MeanTicks`).
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
        session.spend(forward_kinematics=int(trials.evaluations.sum()))
        ticks = np.where(trials.completed, trials.ticks, worst)
        means: Array = ticks.reshape(len(points), executions).mean(axis=1)
        return means

    return mean_ticks


def minima(
    mean_ticks: MeanTicks, start: Array, evaluations: int, executions: int
) -> Iterator[Array]:
    """Minimise mean ticks by CMA-ES with restarts, and yield two points of each start.

    For the first start and each restart, the function yields the final centre of the search
    distribution, and then the best point: the point with the fewest mean ticks in all generations
    since this start. The next restart begins at the best point, with twice the population size.

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
        The last mean of a restart, then its best point.
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
