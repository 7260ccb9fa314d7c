"""Published against ours: the comparison table of a results folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.comparisons.methods import methods_notes, methods_tables
from analysis.markup import code, escaped
from analysis.page import Heading, Part, page
from analysis.published import (
    RUNS,
    TRIALS,
    PublishedCell,
    SequenceResult,
    Summary,
    published_cell,
    published_exhaustive,
    published_initial,
)
from analysis.results.folder import CellRuns, Results
from analysis.statistics.equivalence import MARGIN, difference
from analysis.statistics.estimates import CONFIDENCE
from analysis.statistics.spread import sd
from analysis.table import NONE, Table, interval, tally

Rewards = Sequence[float] | NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """All tables of a comparison, and the notes that belong to them."""

    title: str
    tables: tuple[Table, ...]
    notes: tuple[str, ...]
    """In inline markup."""

    def to_markdown(self) -> str:
        """The comparison as a Markdown page."""
        parts: list[Part] = [Heading(1, self.title)]
        for table in self.tables:
            parts += [Heading(2, table.title), table]
        return page([*parts, Heading(2, "Notes"), self.notes])


def compare(results: Results) -> Comparison:
    """Compare every cell of a results folder with what the paper prints."""
    tables = [
        _cells_table(results),
        _sequences_table(results.cells),
        *methods_tables(results),
        _initial_table(results),
    ]
    return Comparison(
        title="Published and ours",
        tables=tuple(table for table in tables if table.rows),
        notes=(*_notes(results), *methods_notes(results)),
    )


def _cells_table(results: Results) -> Table:
    tasks = results.tasks
    rows = []
    for cell in results.cells:
        paper, good = published_of(cell), cell.good
        if paper is None:
            continue
        rewards = good.reward.to_numpy(dtype=np.float64)
        same_length = bool((good.trials == TRIALS).all())
        rows.append(
            (
                f"{cell.task} †" if tasks[cell.task].reconstructed else cell.task,
                cell.label,
                _published_text(paper),
                _mean_sd(rewards),
                _difference_text(rewards, paper.summary),
                _verdict(cell.task, rewards, paper.summary if same_length else None),
                _beside(_distinct(cell.runs.initial_reward), _initial_text(cell.task)),
                _beside(tally(good.hands.value_counts().to_dict()), _published_hands(paper)),
            )
        )
    columns = (
        "task",
        "method",
        "published",
        "ours: mean ± SD (n)",
        f"difference [{CONFIDENCE:.0%} CI]",
        f"verdict (margin ±{MARGIN:.0%})",
        "initial (published)",
        "hands: runs (published)",
    )
    return Table("Learned reward, published and ours", columns, tuple(rows))


def _sequences_table(cells: Iterable[CellRuns]) -> Table:
    """Rewards by hand sequence, where the paper tells them apart."""
    rows = []
    for cell in cells:
        paper, good = published_of(cell), cell.good
        if paper is None:
            continue
        printed = {s.hands: s for s in paper.sequences}
        if not printed and good.hands.nunique() < 2:
            continue
        found = list(good.hands.value_counts().index)
        for hands in dict.fromkeys([*printed, *found]):
            rewards = good[good.hands == hands].reward.to_numpy(dtype=np.float64)
            summary = printed[hands].summary if hands in printed else None
            rows.append(
                (
                    cell.task,
                    cell.label,
                    hands,
                    _summary_text(summary),
                    _printed_runs(printed, hands),
                    _mean_sd(rewards),
                    _difference_text(rewards, summary),
                )
            )
    columns = (
        "task",
        "method",
        "hands",
        "published reward",
        "published runs",
        "ours: mean ± SD (n)",
        f"difference [{CONFIDENCE:.0%} CI]",
    )
    return Table("By hand sequence", columns, tuple(rows))


def _initial_table(results: Results) -> Table:
    """The corrective process alone: the best hand sequences of every task."""
    rows = []
    for task in results.tasks:
        trials = results.sequences[results.sequences.task == task]
        if len(trials) < 2:
            continue
        paper = published_exhaustive(task)
        best = trials.dropna(subset=["reward"]).head(4)
        rows.append(
            (
                task,
                f"{paper[0]} {paper[1]}" if paper else NONE,
                ", ".join(f"{row.hands} {row.reward}" for row in best.itertuples()) or NONE,
                f"{len(trials)} ({trials.reward.isna().sum()} failed)",
            )
        )
    columns = ("task", "best, published", "best four, ours", "sequences tried")
    return Table("Corrective process alone, every hand sequence", columns, tuple(rows))


def _notes(results: Results) -> list[str]:
    specification = results.manifest.specification
    environment = results.manifest.environment
    notes = [
        "Published: Shah, Barto & Fagg (2013). A dual process account of coarticulation in "
        "motor skill acquisition. *Journal of Motor Behavior*. Rewards are -1 per control "
        "tick; printed means are rounded to the digits shown.",
        "Learned reward of a run: the highest total reward of any of its trials. "
        f"Difference: ours less published, with a {CONFIDENCE:.0%} interval (Welch, from the "
        "printed mean, SD and number of runs; where no SD is printed, the printed mean is "
        f"taken as exact). It is equivalent where the interval lies within ±{MARGIN:.0%} of "
        "the published reward, different where it lies outside, undecided otherwise; the "
        "verdict shows the margin in ticks and as a share of what learning gained in the paper. "
        "Rewards are not normally distributed, as the paper says of its own, so the intervals "
        "are approximate, most of all where runs settle on several hand sequences; the table by "
        "hand sequence says more of those. Intervals are for each row alone, not adjusted for "
        "their number.",
    ]
    if any(_starred(cell) for cell in results.cells):
        notes.append("\\* derived from other printed numbers, not printed itself.")
    for name, task in results.tasks.items():
        if task.reconstructed:
            what = escaped(" and ".join(task.reconstructed))
            notes.append(
                f"† Reconstructed: {what} of **{escaped(name)}** are not printed; they are "
                "inferred from what is (docs/model.md), and rewards on it depend on them."
            )
    for cell in results.cells:
        trials, lost = cell.runs.trials.sum(), cell.runs.failed_trials.sum()
        if trials and lost:
            notes.append(
                f"{escaped(cell.task)} x {escaped(cell.label)}: {lost} of {trials} trials failed "
                "(they did not hit every goal); they taught nothing."
            )
    failed = results.runs[results.runs.status != "ok"]
    for key, runs in failed.groupby(["task", "method", "status", "reason"]).run.count().items():
        name, method, status, text = key if isinstance(key, tuple) else (key,)
        notes.append(f"{runs} runs of {escaped(f'{name} x {method} are {status}: {text}')}")
    commits = results.runs["commit"].nunique(dropna=False)
    if commits > 1:
        notes.append(
            f"The runs were made at {commits} commits; the code behind each method's results "
            "is the same in all of them."
        )
    if any(published_of(cell) and (cell.good.trials != TRIALS).any() for cell in results.cells):
        notes.append(
            f"The published runs have {TRIALS} trials; learned rewards of runs with another "
            "number are not comparable, so those get no verdict."
        )
    libraries = len(results.runs["packages"].unique())
    if libraries > 1:
        notes.append(
            f"The runs were made with {libraries} different sets of "
            "library versions (column packages of runs.parquet)."
        )
    commit = environment.commit
    version = f"coartic {environment.coartic}"
    if commit:
        version += f", commit {commit.id[:12]}{' with changes' if commit.dirty else ''}"
    made = (
        f", {specification.runs} runs of {specification.trials} trials, "
        f"seed {specification.seed}; {version}, model code "
        f"{environment.model_code}; Python {environment.python}, "
        f"{environment.platform}; {environment.date}."
    )
    notes.append(f"Suite {code(specification.suite)}{escaped(made)}")
    return notes


def published_of(cell: CellRuns) -> PublishedCell | None:
    """What the paper prints about a cell: about its own learner as it stands."""
    family, _, condition = cell.method.partition("/")
    if family != "dual-process" or cell.variant:
        return None
    return published_cell(cell.task, condition)


def _starred(cell: CellRuns) -> bool:
    paper, initial = published_of(cell), published_initial(cell.task)
    return bool((paper and paper.summary and paper.summary.derived) or (initial and initial[2]))


def _published_text(paper: PublishedCell) -> str:
    if paper.summary is None:
        return f"not printed ({paper.remark})" if paper.remark else "not printed"
    return _summary_text(paper.summary)


def _summary_text(summary: Summary | None) -> str:
    if summary is None:
        return NONE
    text = f"{summary.mean:.1f}" if summary.derived else f"{summary.mean:g}"
    if summary.sd is not None:
        text += f" ± {summary.sd:.1f}" if summary.derived else f" ± {summary.sd:g}"
    runs = f"{summary.runs}" if summary.runs_printed else f"{summary.runs} assumed"
    return f"{text} ({runs}){'*' if summary.derived else ''}"


def _mean_sd(rewards: Rewards) -> str:
    if len(rewards) == 0:
        return f"{NONE} (0)"
    spread = f" ± {sd(rewards):.1f}" if len(rewards) > 1 else ""
    return f"{np.mean(rewards):.1f}{spread} ({len(rewards)})"


def _difference_text(rewards: Rewards, published: Summary | None) -> str:
    if published is None or len(rewards) == 0:
        return NONE
    return interval(difference(rewards, published), "+.1f")


def _verdict(task: str, rewards: Rewards, published: Summary | None) -> str:
    """The verdict, with the margin in ticks and as a share of the published learning."""
    if published is None or len(rewards) == 0:
        return NONE
    found, initial = difference(rewards, published), published_initial(task)
    margin = f"±{found.margin:.1f}"
    if initial is not None and published.mean > initial[1]:
        margin += f", {found.margin / (published.mean - initial[1]):.0%} of the gain"
    return f"{found.verdict} ({margin})"


def _printed_runs(printed: dict[str, SequenceResult], hands: str) -> str:
    """Printed number of runs with a hand sequence; 0 only where all others are printed."""
    if hands in printed:
        return NONE if printed[hands].runs is None else str(printed[hands].runs)
    complete = sum(result.runs or 0 for result in printed.values()) == RUNS
    return "0" if complete else NONE


def _published_hands(paper: PublishedCell) -> str:
    if not paper.sequences:
        return NONE
    return ", ".join(f"{s.hands} {s.runs or ''}".strip() for s in paper.sequences)


def _beside(ours: str, published: str) -> str:
    """Ours with the published in brackets, where there is ours to compare."""
    return ours if NONE in (ours, published) else f"{ours} ({published})"


def _initial_text(task: str) -> str:
    initial = published_initial(task)
    return f"{initial[1]}{'*' if initial[2] else ''}" if initial else NONE


def _distinct(values: pd.Series) -> str:
    return ", ".join(str(value) for value in sorted(values.dropna().unique())) or NONE
