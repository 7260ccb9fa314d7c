"""The register of signatures: functions that say how a movement depends on the other goals.

To add one, write its function here, decorated with its kind, name, unit and words: tables and
documentation then have it. By its kind it is of

- ``runs`` of one method on one task, and returns a value for each run, ``(n,)``, or for each run
  and goal, ``(n, G)``; NaN where a run has none, booleans for shares of runs;
- ``contexts``: one goal before two different successors, and returns a :class:`~.between.Value`.

Rows of the tables have the order of this file. In formulas, run i hits goal g at configuration
q(i, g) after t(i, g) ticks since the goal before; q(i, 0) is the start; c(i, g) are the ticks of
the corrective process alone with the hands of run i; means are over runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from coartic.analysis.signatures import subtasks
from coartic.analysis.signatures.between import TwoContexts, Value
from coartic.analysis.signatures.manifold import subspaces
from coartic.analysis.trajectories import Trajectories
from coartic.robot import Array

Scope = Literal["runs", "contexts"]
Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Signature:
    """How a signature is measured, and in which words."""

    name: str
    kind: Scope
    measure: Callable[[Any], Any]
    unit: str
    extent: str = ""
    """Unit and range, for people."""
    meaning: str = ""
    """Meaning of a value, as Markdown. A sign without one is not in tables of signatures."""
    sources: tuple[str, ...] = ()
    """Keys of references.bib."""
    two_hands: bool = False
    """Whether it applies to tasks with two hands alone."""
    sign: str = ""
    """Name in claims, if it is also a sign: one number for each run."""
    words: str = ""
    """The sign in words."""
    in_short: str = ""
    """The same for tables."""
    of_run: Callable[[Array], Array] = np.asarray
    """The signs (n,) from the values of the runs, (n,) or (n, G)."""

    def each(self, runs: Trajectories) -> Array:
        """The sign of each run, shape ``(n,)``; NaN where a run has none."""
        values = np.empty(0)
        if runs.runs and (len(runs.task.hands) > 1 or not self.two_hands):
            values = np.asarray(self.measure(runs), dtype=np.float64)
        signs = self.of_run(values) if values.size else values
        return signs if signs.size else np.full(len(runs.runs), np.nan)

    def of(self, runs: Trajectories) -> Array:
        """The sign of each run that has one, shape ``(k,)``."""
        signs = self.each(runs)
        return signs[np.isfinite(signs)]


REGISTER: dict[str, Signature] = {}
"""All signatures by name."""


def of_kind(kind: Scope) -> list[Signature]:
    """The signatures of a kind that tables have, in their order."""
    return [each for each in REGISTER.values() if each.kind == kind and each.meaning]


def signature(name: str, kind: Scope = "runs", **about: Any) -> Callable[[Function], Function]:
    """A decorator: the function measures the signature, ``about`` are fields of it."""

    def enter(measure: Function) -> Function:
        REGISTER[name] = Signature(name, kind, measure, **about)
        return measure

    return enter


def mean_over_goals(values: Array) -> Array:
    """Mean of the values (n, G - 1) that each run has, ``(n,)``; NaN where it has none."""
    means, some = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    # The last goal counts as a missing value: the order of summation decides the last bit.
    padded = np.pad(values[some], ((0, 0), (0, 1)), constant_values=np.nan)
    means[some] = np.nanmean(padded, axis=1)
    return means


# One method's runs on one task


@signature(
    "first subtask against the same hands",
    unit="ticks",
    extent="ticks",
    meaning="Ticks for the first goal, minus those of the corrective process alone with the hands "
    "of the run, so that the choice of hands does not count. If it is positive while the total is "
    "negative, the first subtask is sacrificed for the whole (Shah, Barto & Fagg 2013).",
    sign="first",
    words="ticks by which the first movement is longer than the corrective process's with the same "
    "hands",
    in_short="ticks by which the first movement is slower",
    of_run=lambda values: values[:, 0],
)
def first_subtask(runs: Trajectories) -> Array:
    """t(i, 1) - c(i, 1), shape ``(n, 1)``; NaN where the corrective process fails with the hands
    of the run."""
    return np.asarray(runs.against_same_hands[:, :1])


@signature(
    "total against the same hands",
    unit="ticks",
    extent="ticks",
    meaning="The same difference for the whole task.",
    sign="whole",
    words="ticks by which the whole is shorter than the corrective process's",
    in_short="ticks by which the whole task is faster",
    of_run=np.negative,
)
def total(runs: Trajectories) -> Array:
    """Σ_g t(i, g) - c(i, g); NaN where the corrective process fails with the hands of the run.

    As a sign, Σ_g c(i, g) - t(i, g).
    """
    return np.asarray(runs.against_same_hands.sum(axis=1))


def share_of_false(values: Array) -> Array:
    """Share of the goals before the last at which no value is true, ``(n,)``."""
    return 1.0 - values[:, :-1].mean(axis=1) if values.shape[1] > 1 else np.empty(0)


@signature(
    "hand as in isolation",
    unit="1",
    extent="share of runs, by goal",
    two_hands=True,
    meaning="Runs that hit the goal with the hand that the corrective process would bring there in "
    "fewest ticks from the same posture. 0: the hand is chosen for the sake of other goals.",
    sign="hand",
    words="share of the goals that others follow which are hit with the slower hand for them alone",
    in_short="share of goals hit with the slower hand for them",
    of_run=share_of_false,
)
def hand_as_in_isolation(runs: Trajectories) -> Array:
    """a(i, g) = [r(h) = min over hands of r], for the ticks r of a reach to g from q(i, g - 1).

    As a sign, the mean of 1 - a(i, g) over g < G.
    """
    return np.asarray(subtasks.ticks_slower(runs.task, runs.runs) == 0)


@signature(
    "preshaping of the other arm",
    unit="1",
    extent="−∞ to ∞, by goal",
    two_hands=True,
    meaning="How much nearer the waiting hand is to its own next goal because the arm has moved "
    "since its own last hit, over its distance in the initial solution. It is 0 if the arm keeps "
    "still while it waits, whatever the base does; negative: it is farther away.",
    sign="other arm",
    words="share of the initial distance to its next goal by which the waiting arm brings its hand "
    "nearer (mean over goals)",
    in_short="share of its way that the waiting hand makes",
    of_run=mean_over_goals,
)
def preshaping_of_the_other_arm(runs: Trajectories) -> Array:
    """(d_held(i, g) - d(i, g)) / d_initial(g), g < G, as :func:`~.subtasks.preshaping` says.

    As a sign, the mean over the goals that have it. Empty without an initial solution.
    """
    if runs.initial is None:
        return np.empty(0)
    return np.array([subtasks.preshaping(run, runs.initial)[:-1] for run in runs.runs])


@signature(
    "gain at the next goal",
    unit="ticks",
    sign="arm",
    words="ticks by which the posture of base and chosen arm leaves the next goal nearer, with the "
    "waiting arm where it was (mean over goals)",
    in_short="ticks by which the next goal is nearer",
    of_run=lambda values: np.asarray(values.mean(axis=1)),
)
def gain_at_the_next_goal(runs: Trajectories) -> Array:
    """r(i, g + 1) - r'(i, g + 1), g < G, as :func:`~.subtasks.gain_at_next` says; as a sign, the
    mean over g."""
    return subtasks.gain_at_next(runs.task, runs.runs)


# One goal before two different successors


@signature(
    "context distance",
    "contexts",
    unit="length unit, rad",
    extent="length unit and rad mixed, ≥ 0",
    meaning="Distance between the mean postures at the same goal before two different successors.",
)
def context_distance(contexts: TwoContexts) -> Value:
    """‖mean q₁ - mean q₂‖, of the runs of either context at the goal."""
    return contexts.value(contexts.apart)


@signature(
    "context dependence",
    "contexts",
    unit="pooled SD",
    extent="pooled within-context SD, ≥ 0",
    meaning="The same distance in standard deviations of the runs within a context, with a "
    "permutation test over runs. Without any effect its expected square is about 1/n₁ + 1/n₂, "
    "not 0.",
)
def dependence_on_context(contexts: TwoContexts) -> Value:
    """‖mean q₁ - mean q₂‖ / s with s² = (Σ‖q₁ - mean q₁‖² + Σ‖q₂ - mean q₂‖²) / (n₁ + n₂ - 2)."""
    return contexts.value(contexts.spreads, contexts.p)


def part_of_the_difference(contexts: TwoContexts, name: str, number: int) -> Value:
    """One of both parts of the difference of mean postures, with a test within its subspace."""
    joints, jacobian = contexts.jacobian
    basis = subspaces(jacobian)[number]
    of_all_joints = np.zeros((contexts.first.task.robot.dof, basis.shape[1]))
    of_all_joints[joints] = basis
    return contexts.value(contexts.parts[number], contexts.p_within(name, of_all_joints))


@signature(
    "motor-equivalent part",
    "contexts",
    unit="length unit, rad, per root of dimension",
    extent="as the distance, per root of dimension",
    meaning="The part of the difference between mean postures that leaves the hand in place "
    "(Mattos, Latash and colleagues). If it exceeds the other part, the contexts differ mainly in "
    "what the hand does not show.",
)
def motor_equivalent_part(contexts: TwoContexts) -> Value:
    """‖Nᵀ(mean q₁ - mean q₂)‖ / √d, N (k, d) an orthonormal basis of the Jacobian's nullspace."""
    return part_of_the_difference(contexts, "motor-equivalent part", 0)


@signature(
    "non-motor-equivalent part",
    "contexts",
    unit="length unit, rad, per root of dimension",
    extent="as the distance, per root of dimension",
    meaning="The part of that difference that moves the hand.",
)
def other_part(contexts: TwoContexts) -> Value:
    """‖Mᵀ(mean q₁ - mean q₂)‖ / √d, M (k, d) an orthonormal basis of the Jacobian's row space."""
    return part_of_the_difference(contexts, "non-motor-equivalent part", 1)
