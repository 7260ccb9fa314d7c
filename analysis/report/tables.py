"""The report's tables: frames of the analysis as tables that know their cells."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pandas as pd

from analysis.claims.register import Judged
from analysis.comparison import published_of
from analysis.equivalence import MARGIN, difference
from analysis.frontier import LABELS
from analysis.methods import methods_notes
from analysis.overall import NEAR
from analysis.published import TRIALS, Summary, published_exhaustive, published_initial
from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.signatures.page import CONTEXTS, OTHER, main_columns, other_arm_columns, place
from analysis.signatures.page import Column as SignatureColumn
from analysis.statistics import CONFIDENCE, mean
from analysis.study import SEED, Study

_INTERVAL = f"{CONFIDENCE:.0%} interval"
MOST_CONTEXTS = 120


def published_table(study: Study) -> DataTable | None:
    """Learned rewards of the paper's cells, published and ours."""
    rows = []
    for cell in study.results.cells:
        paper = published_of(cell)
        rewards = cell.good.reward.to_numpy(dtype=np.float64)
        if paper is None:
            continue
        found = None
        if paper.summary is not None and len(rewards):
            found = difference(rewards, paper.summary)
        comparable = (cell.good.trials == TRIALS).all() and not getattr(
            paper.summary, "derived", True
        )
        initial = cell.good.initial_reward.dropna()
        rows.append(
            Row(
                f"{cell.task} {cell.label}",
                (
                    _marked(study, cell.task),
                    cell.label,
                    _summary(paper.summary),
                    paper.summary.runs if paper.summary else None,
                    mean_of(rewards),
                    len(rewards),
                    None if found is None else _apart(found.estimate, found.low, found.high),
                    found.verdict if found is not None and comparable else None,
                    float(initial.iloc[0]) if len(initial) else None,
                    (published_initial(cell.task) or (None, None))[1],
                    _counts(cell.good.hands),
                    ", ".join(f"{s.hands} {s.runs or ''}".strip() for s in paper.sequences)
                    or None,
                ),
                ((cell.task, cell.label),),
            )
        )
    return _table(
        "published-and-ours",
        "Learned reward in the paper's cells, published and ours.",
        (
            Column("task", "task"),
            Column("method", "method"),
            Column("published", "published", "number", "ticks", 1),
            Column("published_runs", "runs", "number", printed=False),
            Column("ours", f"ours [{_INTERVAL}]", "number", "ticks", 1),
            Column("runs", "runs", "number", printed=False),
            Column("difference", f"difference [{_INTERVAL}]", "number", "ticks", 1),
            Column("verdict", f"verdict, margin {MARGIN:.0%}"),
            Column("initial", "initial", "number", "ticks", 0, printed=False),
            Column("published_initial", "published", "number", "ticks", 0, printed=False),
            Column("hands", "hands: runs", printed=False),
            Column("published_hands", "published", printed=False),
        ),
        rows,
        (
            "Published: mean ± SD. Ours: mean ± SD with its BCa interval. The difference has "
            "Welch's interval from the printed mean, SD and runs; where no SD is printed the "
            "printed mean is taken as exact. *Equivalent*: the interval lies within the margin "
            "of the published reward; *different*: outside; *undecided*: neither. A published "
            "mean over hand sequences, pooled from what is printed, gets no verdict.",
        ),
    )


def exhaustive_table(study: Study) -> DataTable | None:
    """The best hand sequences of the corrective process alone."""
    rows = []
    for task in study.results.tasks:
        trials = study.results.sequences[study.results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper, best = published_exhaustive(task), trials.dropna(subset=["reward"])
        rows.append(
            Row(
                task,
                (
                    _marked(study, task),
                    f"{paper[0]} {paper[1]}" if paper else None,
                    ", ".join(f"{row.hands} {row.reward}" for row in best.head(4).itertuples()),
                    len(trials),
                    int(trials.reward.isna().sum()),
                ),
            )
        )
    return _table(
        "exhaustive",
        "The corrective process alone with every hand sequence.",
        (
            Column("task", "task"),
            Column("published", "best, published"),
            Column("best", "best four, ours"),
            Column("sequences", "sequences", "number"),
            Column("failed", "failed", "number"),
        ),
        rows,
    )


def methods_table(study: Study, task: str) -> DataTable | None:
    """Every method on one task: the optimum's searches, then the best mean reward first."""
    rows = []
    for (name, label), row in study.methods.items():
        if name != task:
            continue
        rewards = study.cells[name, label].good.reward.to_numpy(dtype=np.float64)
        rows.append(
            Row(
                label,
                (
                    label,
                    mean_of(rewards),
                    row["solved"],
                    row["runs"],
                    row["gap"],
                    row["gap_share"],
                    row["gap_still"],
                    row["told"] or None,
                    row["hands"] or None,
                    row["other_arm"] or None,
                    *(_whole(row[n]) for n in ("trials", "movement_ticks", "forward_kinematics")),
                    *(_whole(row[n]) for n in ("jacobians", "solver_iterations")),
                    row["solve_s"],
                ),
                ((name, label),),
            )
        )
    best = study.optima.get((task, "free"))
    return _table(
        f"methods-{table_ids(study)[task]}",
        f"All methods on {_marked(study, task)}"
        + ("" if best is None else f"; optimum {best.reward}{' (proven)' if best.proven else ''}")
        + ".",
        (
            Column("method", "method"),
            Column("reward", f"reward [{_INTERVAL}]", "number", "ticks", 1),
            Column("solved", "solved", "number", printed=False),
            Column("runs", "runs", "number", printed=False),
            Column("gap", "gap", "number", "ticks", 1, printed=False),
            Column("gap_share", "gap", "share", digits=1),
            Column("gap_still", "gap, arm still", "number", "ticks", 1, printed=False),
            Column("told", "told"),
            Column("hands", "hands: runs", printed=False),
            Column("other_arm", "other arm", printed=False),
            Column("trials", "trials", "number"),
            Column("movement_ticks", "ticks", "number", printed=False),
            Column("forward_kinematics", "kinematics", "number"),
            Column("jacobians", "Jacobians", "number", printed=False),
            Column("solver_iterations", "iterations", "number", printed=False),
            Column("solve_s", "solve", "number", "s"),
        ),
        rows,
    )


def reading_of_methods(study: Study) -> tuple[str, ...]:
    """What the columns of :func:`methods_table` mean."""
    return tuple(methods_notes(study.results))


def mean_of(rewards: Any) -> Estimate | None:
    """Mean with SD and BCa interval, as far as there are any."""
    if not len(rewards):
        return None
    found = mean(rewards, seed=SEED)
    sd = float(np.std(rewards, ddof=1)) if len(rewards) > 1 else None
    if math.isnan(found.low):
        return Estimate(found.estimate, sd)
    return Estimate(found.estimate, sd, found.low, found.high)


def pairwise_table(study: Study, pairs: pd.DataFrame, task: str) -> DataTable | None:
    """The learner against the others on one task: differences, tests, effect sizes."""
    return _pairs(
        study, pairs, task, "compared", f"The learner against the others on {task}.",
        (
            (Column("difference", "difference", "number", "ticks", 1),
             ("difference", "low", "high")),
            (Column("expected", "first expected", printed=False), "expected"),
            (Column("p_bootstrap", "one-tailed p", "p", digits=4, printed=False), "p_bootstrap"),
            (Column("p_bootstrap_holm", "Holm", "p", digits=4, printed=False),
             "p_bootstrap_holm"),
            (Column("p_permutation", "two-tailed p", "p", digits=4, printed=False),
             "p_permutation"),
            (Column("p_permutation_holm", "Holm", "p", digits=4), "p_permutation_holm"),
            (Column("delta", "Cliff's δ", "number", digits=2, printed=False),
             ("delta", "delta_low", "delta_high")),
            (Column("improvement", "P(first higher)", "number", digits=2),
             ("improvement", "improvement_low", "improvement_high")),
        ),
        "Difference: mean reward of the first less the second's. One-tailed: the paper's "
        "bootstrap test in the direction expected before looking; two-tailed: permutation test. "
        "Holm's correction is over the rows of this table.",
    )  # fmt: skip


def cost_table(study: Study, pairs: pd.DataFrame, task: str) -> DataTable | None:
    """The same pairs: what the second spends and is told, and how many runs it would take."""
    number: Literal["number"] = "number"
    return _pairs(
        study, pairs, task, "costs",
        f"Reward per unit of experience, computation and information on {task}.",
        (
            (Column("difference", "difference", number, "ticks", 1), "difference"),
            (Column("trials", "trials", number, "×"), "trials"),
            (Column("movement_ticks", "ticks", number, "×", printed=False), "movement_ticks"),
            (Column("evaluations", "evaluations", number, "×"), "evaluations"),
            (Column("solve_s", "solve time", number, "×"), "solve_s"),
            (Column("told_more", "told more"), "told_more"),
            (Column("told_less", "told less"), "told_less"),
            (Column("runs_5", "runs for 5 %", number, digits=0, printed=False), "runs_5"),
            (Column("runs_2", "runs for 2 %", number, digits=0, printed=False), "runs_2"),
            (Column("runs_1", "runs for 1 %", number, digits=0), "runs_1"),
            (Column("smallest", "smallest found", number, "ticks", 1, printed=False), "smallest"),
        ),
        "×: what the second spends in a run over what the first spends (none where the second "
        "spends nothing). Evaluations: forward kinematics and Jacobians. Told more, less: letters "
        "as in the tables of all methods. Runs: of each, to find a difference of so much of the "
        "optimum with power 80 %; smallest: what these runs find so.",
    )  # fmt: skip


def _pairs(
    study: Study,
    pairs: pd.DataFrame,
    task: str,
    name: str,
    caption: str,
    columns: tuple[tuple[Column, str | tuple[str, str, str]], ...],
    note: str,
) -> DataTable | None:
    heads = ((Column("first", "first"), "first"), (Column("second", "second"), "second"))
    every = (*heads, *columns)
    rows = [
        Row(
            f"{row['first']} - {row['second']}",
            tuple(_value(row, source, column) for column, source in every),
            ((task, str(row["first"])), (task, str(row["second"]))),
        )
        for row in pairs[pairs.task == task].to_dict("records")
    ]
    return _table(
        f"{name}-{table_ids(study)[task]}", caption, tuple(c for c, _ in every), rows, (note,)
    )


def overall_table(overall: pd.DataFrame, scores: pd.DataFrame) -> DataTable | None:
    """Every method over all tasks."""
    columns: list[tuple[Column, str | tuple[str, str, str]]] = [
        (Column("method", "method"), "method"),
        (Column("runs", "runs", "number", printed=False), "runs"),
        (Column("score", "score", "number", digits=2), ("score", "score_low", "score_high")),
        (Column("gap", "gap", "share", digits=1), ("gap", "gap_low", "gap_high")),
    ]
    for share in NEAR:
        near = f"within_{share:.0%}".rstrip("%")
        head = Column(near, f"within {share:.0%}", "share", digits=0, printed=share == 0.05)
        columns.append((head, (near, f"{near}_low", f"{near}_high")))
    rows = []
    for row in overall.to_dict("records"):
        own = scores[scores.method == row["method"]]
        rows.append(
            Row(
                str(row["method"]),
                tuple(_value(row, source, column) for column, source in columns),
                tuple(dict.fromkeys(zip(own.task.map(str), own.label.map(str), strict=True))),
            )
        )
    return _table(
        "across-tasks",
        "All tasks together, each counting the same.",
        tuple(column for column, _ in columns),
        rows,
        (
            "Score: interquartile mean of normalised rewards, 0 the initial solution, 1 the "
            "optimum. Gap: mean share of the optimum. Within: share of runs whose gap is at most "
            "so much. 95 % intervals by stratified bootstrap, about other runs on these tasks.",
        ),
    )


def targets_table(study: Study, targets: pd.DataFrame, task: str) -> DataTable | None:
    """Trials to come near the optimum, the nearest target first to be reached on top."""
    frame = targets[
        (targets.task == task) & (targets.spend == "trials") & (targets.other_arm == "free")
    ]
    shares = sorted(frame.share.unique(), reverse=True)
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_share = {row["share"]: row for row in own.to_dict("records")}
        if not any(row["reached"] for row in by_share.values()):
            continue
        values: list[Value] = [str(method)]
        for share in shares:
            row = by_share[share]
            median = float(row["median"])
            values += [
                f"{row['reached']}/{row['runs']}",
                Estimate(median, None, float(row["low"]), float(row["high"]))
                if math.isfinite(median) and row["runs"] > 1
                else median
                if math.isfinite(median)
                else None,
            ]
        rows.append((sum(-by_share[s]["reached"] / by_share[s]["runs"] for s in shares),
                     Row(str(method), tuple(values), ((task, str(method)),))))  # fmt: skip
    heads = [Column("method", "method")]
    for share in shares:
        name = f"within_{share:.0%}".rstrip("%")
        heads.append(Column(f"{name}_reached", f"within {share:.0%}"))
        heads.append(Column(name, "median trials", "number", digits=0))
    return _table(
        f"targets-{table_ids(study)[task]}",
        f"Trials to come near the optimum of {task}, other arm free.",
        tuple(heads),
        [row for _, row in sorted(rows, key=lambda pair: pair[0])],
        (
            "Runs that came within a share of the optimum, and the median of trials to get there "
            "over all runs (Kaplan-Meier; runs stopped by their budget are censored). Planners "
            "need no trials. Methods that never come within 5 % are left out.",
        ),
    )


def areas_table(study: Study, areas: pd.DataFrame, task: str) -> DataTable | None:
    """Area under the anytime curve over every spend, the best first."""
    frame = areas[(areas.task == task) & (areas.other_arm == "free")]
    spends = list(dict.fromkeys(frame.spend))
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_spend = {row["spend"]: row for row in own.to_dict("records")}
        rows.append(
            Row(
                str(method),
                (
                    str(method),
                    *(
                        _apart(float(row["area"]), float(row["low"]), float(row["high"]))
                        if (row := by_spend.get(spend))
                        else None
                        for spend in spends
                    ),
                ),
                ((task, str(method)),),
            )
        )
    rows.sort(key=lambda row: _number(row.values[1]))  # noqa: PD011 (no frame)
    return _table(
        f"areas-{table_ids(study)[task]}",
        f"Area under the anytime curve on {task}, other arm free.",
        (
            Column("method", "method"),
            *(
                Column(str(spend), LABELS[str(spend)], "number", digits=3, printed=i < 2)
                for i, spend in enumerate(spends)
            ),
        ),
        rows,
        (
            "Mean gap to the optimum, as a share of it, over the logarithm of the budget: 0 is "
            "optimal from the first trial on, 1 nothing found. Within a task and a column only.",
        ),
    )


def pareto_table(study: Study, pareto: pd.DataFrame, task: str) -> DataTable | None:
    """Methods on some Pareto set of reward and spend."""
    frame = pareto[pareto.task == task]
    spends = list(dict.fromkeys(frame.spend))
    rows = []
    for method, own in frame.groupby("method", sort=False):
        by_spend = {row["spend"]: row for row in own.to_dict("records")}
        if not any(row["front_share"] > 0.05 for row in by_spend.values()):
            continue
        first = own.iloc[0]
        values: list[Value] = [str(method), str(first.told), float(first.reward)]
        for spend in spends:
            row = by_spend[spend]
            values += [_finite(row["amount"]), _finite(row["front_share"])]
        rows.append(Row(str(method), tuple(values), ((task, str(method)),)))
    heads = [
        Column("method", "method"), Column("told", "told"),
        Column("reward", "reward", "number", "ticks", 1),
    ]  # fmt: skip
    for i, spend in enumerate(spends):
        heads.append(Column(str(spend), LABELS[str(spend)], "number", printed=i < 3))
        heads.append(Column(f"{spend}_front", "on front", "share", digits=0, printed=i < 3))
    return _table(
        f"pareto-{table_ids(study)[task]}",
        f"Pareto sets of reward and spend on {task}.",
        tuple(heads),
        rows,
        (
            "Of every spend the median over runs, and in how many bootstrap resamples the method "
            "is on the front: no other with as much reward spends less. Methods on none (in at "
            "most 5 % of resamples) are left out, and so are the optimum's own searches. Solve "
            "times within 10 % are ties.",
        ),
    )


def signatures_tables(study: Study, task: str) -> list[DataTable]:
    """The main signatures of all methods on one task, and what the other arm does."""
    content = study.results.tasks[task]
    found = [
        _signatures(study, task, "main-signatures", "Main signatures", main_columns(content)),
        _signatures(
            study,
            task,
            "other-arm",
            "The arm that is not chosen",
            other_arm_columns(content),
            OTHER,
        )
        if len(content.hands) > 1
        else None,
    ]
    return [table for table in found if table is not None]


def _signatures(
    study: Study,
    task: str,
    name: str,
    title: str,
    columns: list[SignatureColumn],
    note: str = "",
) -> DataTable | None:
    frame = study.signatures
    frame = frame[(frame.task == task) & frame.value.notna()]
    values = {
        (row["label"], row["signature"], place(row)): row for row in frame.to_dict("records")
    }
    rows = []
    for own, label in study.methods:
        if own != task:
            continue
        entries = [values.get((label, column.signature, column.place)) for column in columns]
        if any(entries):
            cells = tuple(None if entry is None else _estimate(entry) for entry in entries)
            rows.append(Row(label, (label, *cells), ((task, label),)))
    heads = []
    for index, column in enumerate(columns):
        head, _, unit = column.head.rpartition(", ")
        unit = "" if unit == "1" else unit
        heads.append(
            Column(
                f"signature_{index}",
                head or unit,
                "number",
                unit if head else "",
                printed=index < 3,
            )
        )
    return _table(
        f"{name}-{table_ids(study)[task]}",
        f"{title} on {task}.",
        (Column("method", "method"), *heads),
        rows,
        (note,) if note else (),
    )


def contexts_table(study: Study) -> DataTable | None:
    """Postures at a shared goal before different successors."""
    names = (
        "context distance", "context dependence", "motor-equivalent part",
        "non-motor-equivalent part", "lead time",
    )  # fmt: skip
    frame = study.signatures
    frame = frame[frame.signature.isin(names) & frame.value.notna()]
    frame = frame.assign(at=frame["where"].str.replace(r", of at most \d+$", "", regex=True))
    rows = []
    for (task, at, label), own in frame.groupby(["task", "at", "label"], sort=False):
        by_name = {row["signature"]: row for row in own.to_dict("records")}
        other = str(at).partition("against ")[2]
        cells = [(str(task), str(label))]
        if (other, str(label)) in study.cells:
            cells.append((other, str(label)))
        dependence = by_name.get("context dependence")
        rows.append(
            Row(
                f"{task}, {at}, {label}",
                (
                    str(label),
                    f"{task}, {at}",
                    *(_estimate(by_name[n]) if n in by_name else None for n in names),
                    _finite(dependence["p"]) if dependence else None,
                ),
                tuple(cells),
            )
        )
    if len(rows) > MOST_CONTEXTS:  # families of variants have too many to be read here
        return None
    heads = ("distance", "dependence", "motor-equivalent", "non-motor-equivalent", "lead")
    units = ("", "pooled SD", "", "", "ticks")
    return _table(
        "contexts",
        "The same goal before different successors.",
        (
            Column("method", "method"),
            Column("where", "where", printed=False),
            *(
                Column(f"context_{i}", head, "number", unit)
                for i, (head, unit) in enumerate(zip(heads, units, strict=True))
            ),
            Column("p", "p of dependence", "p", digits=4),
        ),
        rows,
        (f"{CONTEXTS} p is of the permutation test, uncorrected; {len(rows)} rows.",),
    )


def claims_table(study: Study, judged: Sequence[Judged]) -> DataTable | None:
    """The register in short."""
    by_run = {str(run): key for key, cell in study.cells.items() for run in cell.runs.run_id}
    rows = [
        Row(
            entry.claim.id,
            (
                entry.claim.id,
                entry.claim.statement,
                entry.verdict + (" †" if entry.claim.fitted else ""),
                _finite(entry.adjusted_p),
                ", ".join(filter(None, (entry.claim.place, entry.claim.figure))) or None,
            ),
            tuple(dict.fromkeys(by_run[run] for run in entry.run_ids)),
        )
        for entry in judged
    ]
    return _table(
        "claims",
        "What the paper says of its model, and what it does not compare.",
        (
            Column("claim", "claim"),
            Column("statement", "statement", printed=False),
            Column("verdict", "verdict"),
            Column("adjusted_p", "adjusted p", "p", digits=4),
            Column("place", "place in the paper", printed=False),
        ),
        rows,
    )


def table_ids(study: Study) -> dict[str, str]:
    """Names of tasks as tables' ids have them: small letters, digits and dashes, all different."""
    found: dict[str, str] = {}
    for name in study.results.tasks:
        base = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "task"
        slug, number = base, 2
        while slug in found.values():
            slug, number = f"{base}-{number}", number + 1
        found[name] = slug
    return found


def _estimate(row: dict[Any, Any]) -> Value:
    return _apart(float(row["value"]), float(row["low"]), float(row["high"]))


def _finite(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def _number(value: Value) -> float:
    if isinstance(value, Estimate):
        return value.value
    return value if isinstance(value, int | float) else math.inf


def _value(row: dict[Any, Any], source: str | tuple[str, str, str], column: Column) -> Value:
    if isinstance(source, tuple):
        value, low, high = (float(row[name]) for name in source)
        return _apart(value, low, high)
    value = row[source]
    if column.kind == "text":
        return None if pd.isna(value) or value == "" else str(value)
    return None if pd.isna(value) else value.item() if hasattr(value, "item") else value


def _table(
    name: str,
    caption: str,
    columns: tuple[Column, ...],
    rows: list[Row],
    notes: tuple[str, ...] = (),
) -> DataTable | None:
    return DataTable(name, caption, columns, tuple(rows), notes) if rows else None


def _apart(value: float, low: float, high: float) -> Value:
    if math.isnan(value):
        return None
    return Estimate(value) if math.isnan(low) else Estimate(value, None, low, high)


def _summary(summary: Summary | None) -> Estimate | None:
    return None if summary is None else Estimate(summary.mean, summary.sd)


def _whole(value: float) -> int | None:
    return None if math.isnan(value) or not value else round(value)


def _counts(hands: pd.Series) -> str | None:
    return ", ".join(f"{name} {count}" for name, count in hands.value_counts().items()) or None


def _marked(study: Study, task: str) -> str:
    return f"{task} †" if study.results.tasks[task].reconstructed else task
