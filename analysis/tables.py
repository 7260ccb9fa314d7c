"""The report's tables: each is a function of a study that returns a DataFrame.

The index names the rows, ``run_ids`` the runs behind each. A column that ends in ``_low``,
``_high`` or ``_sd`` belongs to the one before. What columns are called and how they are shown is
in ``columns.toml``. A table that the runs do not allow is empty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.cells import CellRuns
from coartic.analysis.claims.judge import claims_table as judged_claims
from coartic.analysis.comparisons.methods import method_rows
from coartic.analysis.comparisons.pairs import pairs_table
from coartic.analysis.comparisons.paper import paper_rows, sequence_rows
from coartic.analysis.comparisons.progress import best_so_far
from coartic.analysis.comparisons.reached import price as price_by_method
from coartic.analysis.comparisons.standings import ALL_TASKS, ends, gaps, standings
from coartic.analysis.generality.exploration import contrasts
from coartic.analysis.generality.presence import presence
from coartic.analysis.generality.sample import Sample, one_by_one, sample
from coartic.analysis.methods import (
    CONDITIONS,
    INITIAL,
    LEARNER,
    in_order,
    is_search,
    is_variant,
    main_methods,
    most_exploring,
    name_of,
)
from coartic.analysis.published import published_cell, published_initial
from coartic.analysis.signatures.locus import families, variants
from coartic.analysis.signatures.register import signatures as signature_values
from coartic.analysis.statistics.estimates import Inference, mean, standard_deviation
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.words import marked

Row = dict[str, Any]
BUDGETS = (100, 1_000, 10_000)
"""Trials after which the table of learning reads rewards."""


def _table(rows: Iterable[tuple[str, Row]]) -> pd.DataFrame:
    """A table of named rows."""
    kept = list(rows)
    columns = None if kept else ["run_ids"]
    frame = pd.DataFrame([row for _, row in kept], [name for name, _ in kept], columns)
    return frame.rename_axis("row")


def _spread(name: str, found: Inference) -> Row:
    """A value with its interval, as three columns."""
    return {name: found.estimate, f"{name}_low": found.low, f"{name}_high": found.high}


def _runs(*cells: CellRuns) -> str:
    """Ids of the runs of some cells."""
    return " ".join(str(run) for cell in cells for run in cell.runs.run_id)


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition with the highest mean reward on a task."""
    rewards = {
        label: float(cell.rewards.mean())
        for (name, label), cell in study.cells.items()
        if name == task and label in CONDITIONS and len(cell.good)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


@cached
def tasks(study: Study) -> pd.DataFrame:
    """One row a task: initial, learned, published and best possible reward."""
    rows = []
    for name in sorted(one_by_one(study), key=list(study.tasks).index):
        task, label = study.tasks[name], best_condition(study, name)
        best = study.optima.get((name, "free"))
        row: Row = {
            "task": marked(task.label, task),
            "arms": len(task.hands),
            "base": f"locked in {' and '.join(task.locked_base)}" if task.locked_base else "free",
            "optimum": best.reward if best else None,
            "bound": best.bound if best else None,
        }
        if label is not None:
            cell, condition = study.cells[name, label], label.removeprefix(LEARNER)
            paper = published_cell(name, condition)
            row |= {
                "initial": cell.good.initial_reward.dropna().mean(),
                "condition": condition,
                **_spread("learned", mean(cell.rewards)),
                "published": paper.summary.mean if paper and paper.summary else None,
                "run_ids": _runs(cell),
            }
        rows.append((name, row))
    order = "task arms base initial condition learned learned_low learned_high published optimum"
    return _ordered(_table(rows), f"{order} bound run_ids")


def _groups(frame: pd.DataFrame, *keys: str) -> Iterator[tuple[Any, pd.DataFrame]]:
    """Rows that have the same values of some columns, with these values."""
    yield from frame.groupby(list(keys), sort=False)


def _ordered(frame: pd.DataFrame, columns: str) -> pd.DataFrame:
    """With these columns in this order; empty ones where there is nothing."""
    return frame.reindex(columns=columns.split())


@cached
def published(study: Study) -> pd.DataFrame:
    """Learned rewards of the paper's cells beside ours, and whether they are equivalent."""
    rows = []
    for row in paper_rows(study):
        task, label, summary = row.cell.task, row.cell.label, row.paper.summary
        values: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "condition": label.removeprefix(LEARNER),
            "published": summary.mean if summary else None,
            "published_sd": summary.sd if summary else None,
            "published_initial": getattr(published_initial(task), "reward", None),
            "ours": row.rewards.mean() if len(row.rewards) else math.nan,
            "ours_sd": standard_deviation(row.rewards),
            "ours_initial": row.cell.good.initial_reward.dropna().mean(),
            "runs": len(row.rewards),
            "verdict": row.verdict,
            "run_ids": _runs(row.cell),
        }
        if row.difference:
            values |= {**_spread("difference", row.difference), "margin": row.difference.margin}
        rows.append((f"{task} {values['condition']}", values))
    order = "task condition published published_sd ours ours_sd runs difference difference_low"
    order += " difference_high margin verdict published_initial ours_initial run_ids"
    return _ordered(_table(rows), order)


@cached
def hands(study: Study) -> pd.DataFrame:
    """Learned rewards by hand sequence, published and ours, where there are several."""
    rows = []
    for row in sequence_rows(study):
        task, condition = row.cell.task, row.cell.label.removeprefix(LEARNER)
        good = row.cell.good
        values: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "condition": condition,
            "hands": row.hands,
            "published_runs": row.published_runs,
            "runs": len(row.rewards),
            "of_runs": len(good),
            "published": row.published.mean if row.published else None,
            "published_sd": row.published.sd if row.published else None,
            "ours": row.rewards.mean() if len(row.rewards) else math.nan,
            "ours_sd": standard_deviation(row.rewards),
            "run_ids": " ".join(map(str, good.run_id[good.hands == row.hands])),
        }
        values |= _spread("difference", row.difference) if row.difference else {}
        rows.append((f"{task} {condition} {row.hands}", values))
    order = "task condition hands published_runs runs of_runs published published_sd ours ours_sd"
    return _ordered(_table(rows), f"{order} difference difference_low difference_high run_ids")


@cached
def claims(study: Study) -> pd.DataFrame:
    """The paper's claims with their verdicts."""
    frame = judged_claims(study)
    if not len(frame):
        return _ordered(_table([]), "statement verdict")
    statement = frame.statement + frame.fitted.map({True: " †", False: ""})
    frame = frame.assign(statement=statement).rename(columns={"runs": "run_ids"})
    order = "statement verdict evidence test p_holm opposite_p_holm ensemble place quote section"
    return _ordered(frame.set_index("id").rename_axis("row"), f"{order} run_ids")


@cached
def learning(study: Study) -> pd.DataFrame:
    """Best reward after so many trials, and when half of a run's gain was there."""
    rows = []
    for (task, label), cell in study.cells.items():
        found = [best_so_far(study)[str(run)] for run in cell.runs.run_id]
        if task not in one_by_one(study) or is_variant(label) or is_search(label):
            continue
        if not found or not all(run.learns and run.solved for run in found):
            continue
        trials = min(run.total["trials"] for run in found)
        if trials < BUDGETS[0]:  # a try or two, no learning
            continue
        budgets = np.array([budget for budget in BUDGETS if budget <= trials], dtype=float)
        best = np.array([run.best("trials", budgets) for run in found])
        best[~np.isfinite(best)] = math.nan
        halves = [half_gain(run.rewards, run.spent["trials"]) for run in found]
        values: Row = {
            "task": marked(study.tasks[task].label, study.tasks[task]),
            "method": label,
            "runs": len(found),
            "initial": ends(study).get(task, (math.nan,))[0],
            **{f"after_{int(n)}": best[:, k].mean() for k, n in enumerate(budgets)},
            "half_gain": float(np.median(halves)),
            "half_gain_low": float(np.quantile(halves, 0.25)),
            "half_gain_high": float(np.quantile(halves, 0.75)),
            "run_ids": _runs(cell),
        }
        rows.append((f"{task} {label}", values))
    order = f"task method runs initial {' '.join(f'after_{n}' for n in BUDGETS)}"
    return _ordered(_table(rows), f"{order} half_gain half_gain_low half_gain_high run_ids")


def half_gain(rewards: np.ndarray, trials: np.ndarray) -> float:
    """Trial at which half of what a run gains from its first solution to its last is there."""
    return float(trials[rewards >= (rewards[0] + rewards[-1]) / 2][0])


@cached
def ranking(study: Study) -> pd.DataFrame:
    """Gap to the optimum over all tasks and on each, grouped by what methods know."""
    found = standings(study)
    names = [name for name in study.tasks if name in set(found.task)][:5]
    rows = []
    for method, rows_of in found.groupby("method", sort=False):
        by_task = rows_of.set_index("task")
        only = ALL_TASKS if len(set(found.task)) > 1 else found.task.iloc[0]
        whole = by_task.loc[only] if only in by_task.index else None
        parts = gaps(study)[gaps(study).method == method].drop_duplicates(["task", "label"])
        keys = list(zip(parts.task, parts.label, strict=True))
        by_cell = parts.set_index("task").label
        each = {
            task: method_rows(study).gap[task, by_cell[task]]
            for task in names
            if task in by_cell.index
        }
        row: Row = {
            "method": str(method),
            "knows": rows_of.knows.iloc[0],
            "gap": math.nan if whole is None else whole.gap,
            "gap_low": math.nan if whole is None else whole.low,
            "gap_high": math.nan if whole is None else whole.high,
            **{f"on {task}": each.get(task, math.nan) for task in names},
            "runs": sum(len(study.cells[key].runs) for key in keys),
            "run_ids": _runs(*(study.cells[key] for key in keys)),
        }
        rows.append((str(method), row))
    frame = _table(rows)
    return frame.sort_values(["gap"], kind="stable") if len(frame) else frame


@cached
def price(study: Study) -> pd.DataFrame:
    """What it costs to reach a quarter and half of the targets."""
    frame = price_by_method(study)
    run_ids = []
    for label, over in frame.task.items():
        parts = gaps(study)[gaps(study).method == label].drop_duplicates(["task", "label"])
        pairs = zip(parts.task, parts.label, strict=True)
        run_ids.append(_runs(*(study.cells[key] for key in pairs if over in (ALL_TASKS, key[0]))))
    frame = frame.drop(columns=["task", "knows"]).assign(run_ids=run_ids)
    frame.insert(0, "method", frame.index)
    return frame.rename_axis("row")


@cached
def methods(study: Study) -> pd.DataFrame:
    """Every method on every task: reward, gap, hands and what a run spends."""
    frame = method_rows(study).reset_index()
    frame = frame[frame.task.isin(list(one_by_one(study)))]
    cells = [study.cells[key] for key in zip(frame.task, frame.label, strict=True)]
    names = frame.task + " " + frame.label
    frame = frame.assign(
        task=[marked(study.tasks[name].label, study.tasks[name]) for name in frame.task],
        run_ids=[_runs(cell) for cell in cells],
    )
    order = "task method runs solved reward reward_sd gap hands trials forward_kinematics solve_s"
    order += " told corrections jacobians movement_ticks other_arm run_ids"
    frame = frame.rename(columns={"label": "method"}).set_index(names).rename_axis("row")
    return _ordered(frame, order)


@cached
def contexts(study: Study) -> pd.DataFrame:
    """Postures at a shared goal before different successors."""
    frame = signature_values(study)
    frame = frame[frame.against.ne("") & frame.value.notna() & frame.moving.isna()]
    rows = []
    for at, own in _groups(frame, "task", "label", "goal", "hand", "against"):
        task, label, goal, hand, against = at
        of = own.set_index("signature")
        value = of.value.to_dict()
        cells = [study.cells[name, label] for name in (task, against)]
        row: Row = {
            "method": label,
            "place": f"goal {goal} of {task} and {against}",
            "runs": int(own.n.max()),
            "distance": value.get("context distance"),
            "dependence": value.get("context dependence"),
            "p_holm": of.p.get("context dependence", math.nan),
            "equivalent": value.get("motor-equivalent part"),
            "other": value.get("non-motor-equivalent part"),
            "lead": value.get("lead time"),
            "run_ids": _runs(*cells),
        }
        rows.append((f"{task} {label} goal {goal} {hand}", row))
    order = "method place runs distance dependence p_holm equivalent other lead run_ids"
    made = _ordered(_table(rows), order)
    return made.assign(p_holm=holm(made.p_holm.tolist())) if len(made) else made


@cached
def slopes(study: Study) -> pd.DataFrame:
    """How the posture at a goal follows a neighbouring goal that moves."""
    frame = signature_values(study)
    frame = frame[frame.moving.notna() & frame.value.notna()]
    rows = []
    for at, own in _groups(frame, "task", "label", "goal", "moving", "hand"):
        task, label, goal, moving, hand = at
        kind = "anticipatory" if goal < moving else "carry-over"
        norm = own[own.signature == "locus slope norm"]
        steepest = own[own.signature == "locus slope"].sort_values("value", key=abs).tail(1)
        base = str(task).partition(".")[0]
        cells = [
            cell
            for (name, of), cell in study.cells.items()
            if of == label and name.partition(".")[0] == base
        ]
        row: Row = {
            "method": label,
            "place": f"goal {goal} of {base}, goal {moving} moves",
            "kind": kind,
            "hand": hand,
            "runs": int(own.n.max()),
            "norm": norm.value.iloc[0] if len(norm) else math.nan,
            "p_holm": norm.p.iloc[0] if len(norm) else math.nan,
            "joint": steepest.joint.iloc[0] if len(steepest) else "",
            "slope": steepest.value.iloc[0] if len(steepest) else math.nan,
            "slope_low": steepest.low.iloc[0] if len(steepest) else math.nan,
            "slope_high": steepest.high.iloc[0] if len(steepest) else math.nan,
            "run_ids": _runs(*cells),
        }
        rows.append((f"{base} {label} goal {goal} of {moving} {hand}", row))
    made = _table(rows)
    return made.assign(p_holm=holm(made.p_holm.tolist())) if len(made) else made


_MAIN_SIGNATURES = {
    "first": "first subtask against the same hands",
    "total": "total against the same hands",
    "as_in_isolation": "hand as in isolation",
    "preshaping": "preshaping of the other arm",
    "turning": "turning angle",
    "travel": "travel of the other arm",
}
"""Columns of :func:`signatures` and the signatures whose means over goals they have."""


@cached
def signatures(study: Study) -> pd.DataFrame:
    """The main signatures of every main method on every task, means over runs and goals."""
    frame = signature_values(study)
    frame = frame[frame.value.notna()]
    rows = []
    for task in (name for name in study.tasks if name in one_by_one(study)):
        labels = [label for name, label in study.cells if name == task]
        for label in in_order(main_methods(labels)):
            own = frame[(frame.task == task) & (frame.label == label)]
            if len(own) and not is_search(label):
                means = own.groupby("signature").value.mean()
                cell = study.cells[task, label]
                row: Row = {
                    "task": marked(study.tasks[task].label, study.tasks[task]),
                    "method": label,
                    "runs": len(cell.good),
                    **{name: means.get(of, math.nan) for name, of in _MAIN_SIGNATURES.items()},
                    "run_ids": _runs(cell),
                }
                rows.append((f"{task} {label}", row))
    return _table(rows)


@cached
def all_signatures(study: Study) -> pd.DataFrame:
    """Every value of every signature, one a row, with its place, interval and test."""
    frame = signature_values(study)
    names = frame.task + " " + frame.label + ", " + frame.signature + " " + frame["where"]
    columns = ["task", "label", "signature", "where", "value", "low", "high", "p", "n", "unit"]
    joined = variants(families(study.tasks))

    @cache
    def ids_of(names: tuple[str, ...], label: str) -> str:
        return _runs(*(study.cells[name, label] for name in names if (name, label) in study.cells))

    def run_ids(task: str, label: str, against: str, moving: float) -> str:
        beside = {against} if math.isnan(moving) else set().union(*(g for g in joined if task in g))
        return ids_of((task, *sorted(beside - {task, ""})), label)

    behind = frame[["task", "label", "against", "moving"]].astype({"moving": float})
    ids = [run_ids(*row) for row in behind.itertuples(index=False)]
    frame = frame[[*columns, "why_not"]].assign(run_ids=ids)
    frame = frame.rename(columns={"low": "value_low", "high": "value_high"})
    return frame.set_index(names.str.strip()).rename_axis("row")


@cached
def pairs(study: Study) -> pd.DataFrame:
    """The learner against every other method of a task, and its conditions with each other."""
    frame = pairs_table(study)
    ids = [
        _runs(study.cells[str(task), str(first)], study.cells[str(task), str(second)])
        for task, first, second in zip(frame.task, frame["first"], frame.second, strict=True)
    ]
    names = frame.task + " " + frame["first"] + " " + frame.second
    return frame.assign(run_ids=ids).set_index(names).rename_axis("row")


@cached
def family_gaps(study: Study) -> pd.DataFrame:
    """Gap to the best known reward over families with two arms, and in each family."""
    instances = sample(study)
    if instances is None:
        return _table([])
    together = [
        name for name, own in instances.families.items() if len(instances.tasks[own[0]].hands) > 1
    ]
    rows = []
    for label in ("learner", *(own for own in instances.labels if not is_variant(own))):
        scores, bounded = (_family_scores(instances, label, to_bound=to) for to in (False, True))
        if not scores:
            continue
        row: Row = {"method": label, "instances": sum(map(len, scores.values()))}
        for name, of in (("gap", scores), ("to_bound", bounded)):
            if together and set(together) <= of.keys():
                row |= _spread(name, other_tasks({family: of[family] for family in together}))
        for family in instances.families:
            if family in scores:
                row[f"in {family}"] = other_tasks({family: scores[family]}).estimate
        cells = [
            cell
            for (task, own), cell in study.cells.items()
            if task in instances.tasks and own == _on(instances, label, task)
        ]
        rows.append((label, row | {"run_ids": _runs(*cells)}))
    families = [f"in {family}" for family in instances.families]
    order = [
        "method",
        "instances",
        "gap",
        "gap_low",
        "gap_high",
        "to_bound",
        "to_bound_low",
        "to_bound_high",
    ]
    made = _table(rows).reindex(columns=[*order, *families, "run_ids"])
    return made.sort_values("gap", kind="stable")


def _on(instances: Sample, label: str, task: str) -> str:
    """Label on an instance: of the learner the condition that explores most."""
    return most_exploring(instances.tasks[task]) if label == "learner" else label


def _family_scores(instances: Sample, label: str, *, to_bound: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for family, names in instances.families.items():
        own = _on(instances, label, names[0])
        found |= dict(instances.gaps(own, families=[family], to_bound=to_bound))
    return found


def _family_runs(study: Study, family: str, labels: Iterable[str]) -> str:
    cells = [
        cell
        for (task, label), cell in study.cells.items()
        if label in labels and (not family or study.tasks[task].family == family)
    ]
    return _runs(*cells)


@cached
def exploration(study: Study) -> pd.DataFrame:
    """More exploration against less, by family and over all of them."""
    rows = []
    for found in contrasts(study):
        second = "the initial solution" if found.second == INITIAL else name_of(found.second)
        row: Row = {
            "contrast": f"{name_of(found.first)} over {second}",
            "family": found.family or "all",
            "instances": found.instances,
            **_spread("gain", found.difference),
            "median": found.median,
            **_spread("by_hands", found.hands),
            "better": found.better,
            "worse": found.worse,
            "told_apart": found.told,
            "run_ids": _family_runs(study, found.family, (found.first, found.second)),
        }
        rows.append((f"{row['contrast']}, {row['family']}", row))
    return _table(rows)


_SIGNS = {
    "hand": "share of goals hit with the slower hand for them",
    "arm": "ticks by which the next goal is nearer",
    "other arm": "share of its way that the waiting hand makes",
    "first": "ticks by which the first movement is slower",
    "whole": "ticks by which the whole task is faster",
}


@cached
def family_signs(study: Study) -> pd.DataFrame:
    """Signs of coarticulation over instances, by condition and family."""
    instances = sample(study)
    rows = []
    for found in presence(instances) if instances else ():
        row: Row = {
            "sign": _SIGNS[found.sign],
            "method": found.label,
            "family": found.family or "all",
            "instances": found.instances,
            "there": found.there,
            **_spread("mean", found.value),
            "run_ids": _family_runs(study, found.family, (found.label,)),
        }
        rows.append((f"{found.sign}, {found.label}, {row['family']}", row))
    return _table(rows)


TABLES: Mapping[str, Callable[[Study], pd.DataFrame]] = {
    "tasks": tasks,
    "published": published,
    "claims": claims,
    "hands": hands,
    "learning": learning,
    "ranking": ranking,
    "price": price,
    "contexts": contexts,
    "slopes": slopes,
    "signatures": signatures,
    "methods": methods,
    "family-gaps": family_gaps,
    "exploration": exploration,
    "family-signs": family_signs,
    "all-signatures": all_signatures,
    "pairs": pairs,
}
"""Every table by its id; the last two are CSV files only."""
