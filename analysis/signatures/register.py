"""All signatures of a results folder, one row each."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from analysis.results.folder import Results
from analysis.signatures.cell import Cell, cells_of, last_ticks, postures
from analysis.signatures.context import (
    context_dependence,
    context_pairs,
    distance,
    lead_time,
    permutation_p,
)
from analysis.signatures.intervals import mean, share
from analysis.signatures.locus import (
    LEAST,
    Family,
    families,
    locus_slopes,
    slope_norm,
    variants,
)
from analysis.signatures.manifold import motor_equivalence, movable, subspaces, synergy
from analysis.signatures.other_arm import (
    preshaping,
    preshaping_from_base,
    preshaping_since_hit,
    travel,
)
from analysis.signatures.paths import reversals_of, smoothness, turning_angles
from analysis.signatures.recruitment import best_sequences, entropy, isolated_agreement
from analysis.signatures.subtasks import change_from, excess, sacrifice_p, sacrifices
from analysis.statistics import spread
from coartic import Execution, Task
from coartic.robot import HANDS, Array, Hand

MIXED = "length unit, rad"
TICKS = "ticks"

NO_RUN = "no run has a solution"
ONE_HAND = "the task has one hand"
NO_INITIAL = "the corrective process alone does not complete the task"


@dataclass(frozen=True)
class Signature:
    """One signature of one cell."""

    signature: str
    where: str = ""
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    p: float = math.nan
    n: int = 0
    unit: str = ""
    why_not: str = ""


def signatures_frame(
    results: Results, cells: Sequence[Cell] | None = None, *, seed: int = 0
) -> pd.DataFrame:
    """Every signature of every cell; ``cells`` are those of the results where they are read.

    Columns: ``task``, ``method``, ``variant``, ``signature``, ``where`` (goal, other context,
    joint), ``value``, ``low`` and ``high`` (95 % interval), ``p`` (uncorrected), ``n`` (runs
    that went into it), ``unit``, ``why_not`` (why there is no value, or no test; empty where
    all is there). Signatures over runs are means with Student's interval, shares of runs have
    Wilson's. What each one means stands with its function. Differences between contexts
    stand with the first task of the pair and name the other; tasks that locus families join
    are no pairs, their slopes say how each depends on the others. ``seed`` is of the permutation
    and bootstrap tests, which draw apart for each row and do not depend on the other rows.
    """
    cells = cells_of(results) if cells is None else cells
    groups = families(results.tasks)
    joined = variants(groups)
    by_key = {(cell.method, cell.variant, cell.task.name): cell for cell in cells}
    pairs = [
        (first, second, shared)
        for first, second, shared in context_pairs(results.tasks)
        if not any({first, second} <= names for names in joined)
    ]
    rows: list[dict[str, Any]] = []

    def add(cell: Cell, found: Iterator[Signature]) -> None:
        key = {"task": cell.task.name, "method": cell.method, "variant": cell.variant}
        rows.extend({**key, **asdict(signature)} for signature in found)

    for cell in cells:
        add(cell, _of_cell(cell, best_sequences(results.sequences, cell.task.name), seed))
        alone = True
        for first, second, shared in pairs:
            both = [by_key.get((cell.method, cell.variant, name)) for name in (first, second)]
            if cell.task.name in (first, second) and both[0] is not None and both[1] is not None:
                alone = False
                if cell is both[0]:
                    add(cell, _of_pair(cell, both[1], shared, seed))
        if alone:
            slopes = any(cell.task.name in names for names in joined)
            add(cell, _no_context(IN_FAMILY if slopes else NO_CONTEXT))
        for family in groups:
            members = [by_key.get((cell.method, cell.variant, name)) for name in family.tasks]
            if next((member for member in members if member is not None), None) is cell:
                add(cell, _of_family(family, members, seed))
        if not any(cell.task.name in family.tasks for family in groups):
            why = f"fewer than {LEAST} tasks of the folder are the same but for one goal"
            add(cell, (Signature(name, why_not=why) for name in LOCUS))
    return pd.DataFrame(rows)


def _of_cell(cell: Cell, best: list[str], seed: int) -> Iterator[Signature]:
    yield from _sacrifice(cell, seed)
    yield from _recruitment(cell, best)
    yield from _other_arm(cell)
    yield from _form(cell)
    yield from _synergies(cell)


def _sacrifice(cell: Cell, seed: int) -> Iterator[Signature]:
    goals = _goals(cell.task)
    yield from _against_initial(cell)
    yield from _against_same_hands(cell, seed)
    yield from _by_goal(
        "subtask against isolated reach",
        goals,
        [excess(run) for run in cell.runs],
        TICKS,
        "the corrective process reaches the goal from the posture before with no hand",
    )


def _against_initial(cell: Cell) -> Iterator[Signature]:
    names = ("first subtask against initial", "total against initial")
    if cell.initial is None or not cell.runs:
        why = NO_INITIAL if cell.runs else NO_RUN
        yield from (Signature(name, why_not=why) for name in names)
        return
    change = np.array([change_from(run.execution, cell.initial) for run in cell.runs])
    yield _mean(names[0], "goal 1", change[:, 0], TICKS)
    yield _mean(names[1], "", change.sum(axis=1), TICKS)


def _against_same_hands(cell: Cell, seed: int) -> Iterator[Signature]:
    """Against the corrective process alone with each run's own hands: the sacrifice."""
    names = (
        "first subtask against the same hands",
        "total against the same hands",
        "first subtask sacrificed",
    )
    alone = {hands: cell.corrective(hands) for hands in set(cell.sequences)}
    pairs: list[tuple[Execution, Execution]] = [
        (run.execution, reference)
        for run in cell.runs
        if (reference := alone[run.execution.hands]) is not None
    ]
    if not pairs:
        why = NO_INITIAL if cell.runs else NO_RUN
        yield from (Signature(name, why_not=why) for name in names)
        return
    changes = np.array([change_from(execution, reference) for execution, reference in pairs])
    yield _mean(names[0], "goal 1", changes[:, 0], TICKS)
    yield _mean(names[1], "", changes.sum(axis=1), TICKS)
    p = sacrifice_p(changes, seed=seed)
    why = _one_run(len(changes))
    if not why and math.isnan(p):
        why = "no test: the first subtask or the whole takes the same ticks in every run"
    shown = _share(names[2], "", [sacrifices(change) for change in changes])
    yield replace(shown, p=p, why_not=why)


def _recruitment(cell: Cell, best: list[str]) -> Iterator[Signature]:
    names = ("hand entropy", "hand as in isolation", "hands as the best corrective ones")
    if len(cell.task.hands) < 2 or not cell.runs:
        why = ONE_HAND if cell.runs else NO_RUN
        yield from (Signature(name, why_not=why) for name in names)
        return
    counts = pd.Series(cell.sequences).value_counts()
    yield Signature(
        names[0],
        ", ".join(f"{hands} {count}" for hands, count in counts.items()),
        entropy(cell.sequences),
        n=len(cell.runs),
        unit="bit",
        why_not="" if len(cell.runs) > 1 else "one run: no distribution",
    )
    agreement = np.array([isolated_agreement(run) for run in cell.runs])
    for goal, agrees in zip(_goals(cell.task), agreement.T, strict=True):
        yield _share(names[1], goal, agrees.tolist())
    if best:
        yield _share(names[2], ", ".join(best), [hands in best for hands in cell.sequences])
    else:
        yield Signature(names[2], why_not="the folder's table of sequences has no reward")


def _other_arm(cell: Cell) -> Iterator[Signature]:
    names = (
        "preshaping of the other arm",
        "preshaping seen from the base",
        "preshaping since its last hit",
        "travel of the other arm",
    )
    if len(cell.task.hands) < 2 or not cell.runs:
        why = ONE_HAND if cell.runs else NO_RUN
        yield from (Signature(name, why_not=why) for name in names)
        return
    if cell.initial is None:
        yield from (Signature(name, why_not=NO_INITIAL) for name in names[:3])
    else:
        initial = cell.initial
        measures = (preshaping, preshaping_from_base, preshaping_since_hit)
        for name, measure in zip(names[:3], measures, strict=True):
            yield from _by_goal(
                name,
                _goals(cell.task)[:-1],
                [measure(run, initial)[:-1] for run in cell.runs],
                "1",
                "the other hand hits no later goal",
            )
    yield from _by_goal(names[3], _goals(cell.task), [travel(run) for run in cell.runs], "rad", "")


def _form(cell: Cell) -> Iterator[Signature]:
    reversals = [reversals_of(run) for run in cell.runs]
    for k, name in enumerate("xy"):
        where = f"base {name}"
        if name in cell.task.locked_base:
            yield Signature("base reversals", where, why_not="the coordinate is locked")
        else:
            yield _mean("base reversals", where, [run[k] for run in reversals], "1")
    turns = [
        turning_angles(np.vstack([run.task.q0, run.execution.configurations])) for run in cell.runs
    ]
    if len(cell.task.goals) > 1:
        yield from _by_goal(
            "turning angle", _goals(cell.task)[:-1], turns, "rad", "a subtask without displacement"
        )
    else:
        yield Signature("turning angle", why_not="the task has one goal")
    smooth = [smoothness(run) for run in cell.runs]
    short = "every subtask is too short, or its path is without jerk"
    for k, name in enumerate(("hand path SPARC", "hand path log dimensionless jerk")):
        yield _mean(name, "chosen hand", [run[k] for run in smooth], "1", short)


def _synergies(cell: Cell) -> Iterator[Signature]:
    runs, task = cell.typical, cell.task
    names = ("V_ucm", "V_ort", "ΔV", "ΔV z")
    if len(runs) < 2:
        why = "one run: no variance across runs" if runs else NO_RUN
        yield from (Signature(name, n=len(runs), why_not=why) for name in names)
        return
    for number, goal in enumerate(_goals(task), 1):
        hand = runs[0].hands[number - 1]
        joints = movable(task, hand)
        q = postures(runs, number)
        found = synergy(q[:, joints], task.robot.jacobian(spread.mean(q), hand)[:, joints])
        where = f"{goal}, {hand} hand, {runs[0].execution.hands}"
        why = "runs do not differ" if math.isnan(found.z) else ""
        untested = why
        if not why and math.isnan(found.p):
            untested = "fewer than three runs" if len(runs) < 3 else "runs differ along one line"
        squared = f"squared ({MIXED})"
        n = len(runs)
        yield Signature(names[0], where, found.within, n=n, unit=squared, why_not=why)
        yield Signature(names[1], where, found.orthogonal, n=n, unit=squared, why_not=why)
        yield Signature(names[2], where, found.delta, n=n, unit="1", why_not=why)
        yield Signature(
            names[3],
            f"{where}, neutral at {found.neutral:.3f}" if not why else where,
            found.z,
            found.low,
            found.high,
            found.p,
            n,
            "1",
            untested,
        )


CONTEXT = (
    "context distance",
    "context dependence",
    "motor-equivalent part",
    "non-motor-equivalent part",
    "lead time",
)


NO_CONTEXT = "the method did no other task that shares the start and the first goals"
IN_FAMILY = "the tasks that share its first goals are variants of it: see the locus slopes"


def _no_context(why: str) -> Iterator[Signature]:
    yield from (Signature(name, why_not=why) for name in CONTEXT)


def _of_pair(first: Cell, second: Cell, shared: int, seed: int) -> Iterator[Signature]:
    """Contexts by shared goal and hand, where both contexts have runs with that hand."""
    for number in range(1, shared + 1):
        found = False
        for hand in HANDS:
            runs = first.with_hand(hand, number), second.with_hand(hand, number)
            if all(runs):
                found = True
                where = f"goal {number}, {hand} hand, against {second.task.name}"
                yield from _of_contexts(first.task, hand, number, runs, where, seed)
        if not found:
            why = "no hand hit the goal in both contexts"
            where = f"goal {number}, against {second.task.name}"
            yield from (Signature(name, where, why_not=why) for name in CONTEXT)


def _of_contexts(
    task: Task, hand: Hand, goal: int, runs: Sequence[tuple[Any, ...]], where: str, seed: int
) -> Iterator[Signature]:
    n = sum(map(len, runs))
    q = [postures(group, goal) for group in runs]
    pooled = np.concatenate(q)
    few = min(map(len, q)) < 2
    why = "one run a context: no spread within contexts, no test" if few else ""
    dependence = context_dependence(q[0], q[1])
    if not few and math.isnan(dependence):
        why = "runs do not differ within contexts"

    def p(name: str, basis: Array | None = None) -> float:
        return math.nan if few else permutation_p(q[0], q[1], _rng(seed, name, where), basis=basis)

    yield Signature(CONTEXT[0], where, distance(q[0], q[1]), n=n, unit=MIXED)
    yield Signature(
        CONTEXT[1], where, dependence, p=p(CONTEXT[1]), n=n, unit="pooled SD", why_not=why
    )
    joints = movable(task, hand)
    jacobian = task.robot.jacobian(spread.mean(pooled), hand)[:, joints]
    difference = spread.mean(q[0]) - spread.mean(q[1])
    parts = motor_equivalence(difference[joints], jacobian)
    for name, value, basis in zip(CONTEXT[2:4], parts, subspaces(jacobian), strict=True):
        whole = np.zeros((task.robot.dof, basis.shape[1]))
        whole[joints] = basis
        yield Signature(
            name, where, value, p=p(name, whole), n=n, unit=f"{MIXED}, per root of dimension",
            why_not="one run a context: no test" if few else "",
        )  # fmt: skip
    if few:
        yield Signature(CONTEXT[4], where, n=n, unit=TICKS, why_not=why)
        return
    count = min(int(run.hits[goal - 1]) for group in runs for run in group) + 1
    if count == 1:
        yield Signature(CONTEXT[4], where, n=n, unit=TICKS, why_not="a run hits it at the start")
        return
    paths = [last_ticks(group, goal, count) for group in runs]
    lead = lead_time(paths[0], paths[1], _rng(seed, CONTEXT[4], where))
    yield Signature(
        CONTEXT[4],
        f"{where}, of at most {count - 1}",
        math.nan if lead is None else lead,
        n=n,
        unit=TICKS,
        why_not="not distinguishable at the hit" if lead is None else "",
    )


LOCUS = ("locus slope", "locus slope norm")


def _of_family(family: Family, members: Sequence[Cell | None], seed: int) -> Iterator[Signature]:
    """Slopes at the goals before (anticipatory) and after (carry-over) the moving one."""
    known = [
        (cell, place)
        for cell, place in zip(members, family.positions.tolist(), strict=True)
        if cell is not None
    ]
    goals = len(known[0][0].task.goals)
    for goal, kind in (
        (family.moving - 1, "anticipatory"),
        (family.moving + 1, "carry-over"),
    ):
        if not 1 <= goal <= goals:
            continue
        text = f"goal {goal}, {kind} of goal {family.moving}"
        for hand in HANDS:
            runs = [(r, place) for cell, place in known for r in cell.with_hand(hand, goal)]
            places = [place for _, place in runs]
            if not runs:
                continue
            where = f"{text}, {hand} hand"
            if len(set(places)) < LEAST:
                why = f"runs with that hand in fewer than {LEAST} tasks of the family"
                yield from (Signature(name, where, n=len(runs), why_not=why) for name in LOCUS)
                continue
            q = postures(tuple(run for run, _ in runs), goal)
            joints = known[0][0].task.robot.joint_names
            for joint, slope in zip(joints, locus_slopes(q, places), strict=True):
                unit = "1" if joint.startswith("base") else "rad per length unit"
                yield Signature(LOCUS[0], f"{where}, {joint}", *slope, n=len(runs), unit=unit)
            norm = slope_norm(q, places, _rng(seed, LOCUS[1], where))
            unit = f"{MIXED}, per length unit"
            yield Signature(LOCUS[1], where, norm.value, p=norm.p, n=len(runs), unit=unit)


def _goals(task: Task) -> list[str]:
    return [f"goal {number}" for number in range(1, len(task.goals) + 1)]


def _by_goal(
    name: str, goals: list[str], values: Sequence[Array], unit: str, missing: str
) -> Iterator[Signature]:
    for k, goal in enumerate(goals):
        yield _mean(name, goal, [run[k] for run in values], unit, missing)


def _mean(
    name: str, where: str, values: Sequence[float] | Array, unit: str, missing: str = ""
) -> Signature:
    """Mean over the runs that have a value, with Student's interval."""
    given = np.asarray(values, dtype=np.float64)
    known = given[np.isfinite(given)]
    n = len(known)
    if not n:
        return Signature(name, where, unit=unit, why_not=missing if len(given) else NO_RUN)
    return Signature(name, where, *mean(known), n=n, unit=unit, why_not=_one_run(n))


def _share(name: str, where: str, agrees: Sequence[bool]) -> Signature:
    """Share of runs, with Wilson's interval."""
    n = len(agrees)
    return Signature(name, where, *share(agrees), n=n, unit="1", why_not=_one_run(n))


def _one_run(n: int) -> str:
    return "one run: no interval" if n == 1 else ""


def _rng(seed: int, name: str, where: str) -> np.random.Generator:
    """A generator of its own for each row."""
    return np.random.default_rng([seed, zlib.crc32(f"{name} {where}".encode())])
