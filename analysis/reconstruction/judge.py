"""Readings before what is printed of the one-armed tasks, whose goals are printed as well.

The rule: a printed constant stands unless the printed results refute it. They refute a reading
under which something as unlikely as what is printed comes out less often than REFUTED, by the
reading's own runs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import pandas as pd

from coartic import CONDITIONS, Task, builtin_tasks, corrective_trial, load_task
from coartic.analysis import printed
from coartic.analysis.reconstruction.likelihood import Likelihood, likelihoods, of_gain, together
from coartic.analysis.reconstruction.scoring import Figure, Learned, learned
from coartic.analysis.reconstruction.targets import conditions_of, tests_of
from coartic.tasks.readings import (
    ChosenReading,
    condition_under,
    load_readings,
    model_under,
    readings,
    task_under,
)

REFUTED = 0.01
"""Chance below which a reading is refuted."""
_SEEDS = 900_000_000  # of runs that judge a reading begin here


@dataclass(frozen=True)
class JudgedReading:
    """What is printed of the one-armed tasks, under some readings."""

    chosen: tuple[ChosenReading, ...]
    """Readings that are not the default; none: the default."""
    initial: dict[str, int | None]
    """Reward of the initial solution by task; None where the corrective process fails."""
    cells: dict[str, Learned]
    parts: tuple[Likelihood, ...]

    @property
    def whole(self) -> Likelihood:
        """All parts as one."""
        return together(self.parts)

    def is_as(self, other: JudgedReading) -> bool:
        """Whether all runs are the same: one arm, or these figures, cannot tell the readings."""
        return self.initial == other.initial and all(
            cell.rewards.tolist() == other.cells[name].rewards.tolist()
            for name, cell in self.cells.items()
        )

    @property
    def refuted(self) -> bool:
        """By the rule."""
        return self.whole.p < REFUTED


def one_armed() -> tuple[Task, ...]:
    """The tasks whose goals are printed."""
    return tuple(
        task for task in map(load_task, builtin_tasks()) if "goals" not in task.reconstructed
    )


def combinations(pairs: bool) -> Iterator[tuple[str, ...]]:
    """The default, each other choice alone, and two of different readings together.

    Every two of what the text says at its word; with ``pairs`` every two.
    """
    yield ()
    choices = {
        f"{reading.id}={choice.written}": choice.printed
        for reading in readings()
        for choice in reading.alternatives
    }
    yield from ((choice,) for choice in choices)
    for first, second in itertools.combinations(choices, 2):
        different = first.partition("=")[0] != second.partition("=")[0]
        if different and (pairs or (choices[first] and choices[second])):
            yield first, second


def judge(texts: Sequence[str], *, runs: int, trials: int = 10_000) -> JudgedReading:
    """Readings, written as ``ties=right``, by runs of their own; same seeds for all."""
    chosen = load_readings(texts)
    model, fields = model_under(chosen), condition_under(chosen)
    initial: dict[str, int | None] = {}
    cells: dict[str, Learned] = {}
    parts: list[Likelihood] = []
    seeds = range(_SEEDS, _SEEDS + runs)
    for plain in one_armed():
        task = task_under(chosen, plain)
        first = initial[task.name] = corrective_trial(task, task.initial_hands, model=model).reward
        for name in conditions_of(task.name):
            condition = replace(CONDITIONS[name], **fields)
            cell = learned(task, condition, seeds, model=model, trials=trials)
            cells[f"{task.name}/{name}"] = cell
            figures = [t for t in tests_of(task.name) if isinstance(t, Figure)]
            parts += [replace(part, what=f"{task.name} {part.what}")
                      for part in likelihoods(figures, cell)]  # fmt: skip
            for gain in printed.tests(task.name):
                if isinstance(gain, printed.Gain) and first is not None:
                    mean = next(f for f in figures if f.kind == "mean")
                    part = of_gain(float(gain.value), first, mean)
                    if part is not None:
                        parts.append(replace(part, what=f"{task.name} {part.what}"))
    if any(reward is None for reward in initial.values()):
        parts.append(Likelihood("the initial solution fails", -math.inf, 0.0))
    return JudgedReading(chosen, initial, cells, tuple(parts))


def judge_all(
    combined: Iterable[Sequence[str]],
    *,
    runs: int,
    trials: int = 10_000,
    jobs: int = 2,
    progress: Callable[[JudgedReading], None] = lambda judged: None,
) -> list[JudgedReading]:
    """Each combination of readings, on threads."""

    def perform(texts: Sequence[str]) -> JudgedReading:
        judged = judge(texts, runs=runs, trials=trials)
        progress(judged)
        return judged

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(perform, combined))


def judged_table(judgements: Iterable[JudgedReading]) -> pd.DataFrame:
    """A row a combination: figures of its runs, likelihood and chance of what is printed."""
    known = list(judgements)
    default = next((judged for judged in known if not judged.chosen), None)
    return pd.DataFrame([dict(_row(judged, default)) for judged in known])


def _row(judged: JudgedReading, default: JudgedReading | None) -> Iterator[tuple[str, object]]:
    yield "readings", " ".join(map(str, judged.chosen)) or "default"
    for task, reward in judged.initial.items():
        yield f"{task} initial", reward
    for name, cell in judged.cells.items():
        some = len(cell.rewards) > 1
        yield f"{name} runs", len(cell.rewards)
        yield f"{name} mean", round(float(cell.rewards.mean()), 2) if some else math.nan
        yield f"{name} sd", round(float(cell.rewards.std(ddof=1)), 2) if some else math.nan
    for part in judged.parts:
        yield f"p: {part.what}", float(f"{part.p:.3g}")
    whole = judged.whole
    yield "log likelihood", round(whole.log_chance, 2)
    yield "p", float(f"{whole.p:.3g}")
    same = default is not None and judged.chosen and judged.is_as(default)
    yield "verdict", "refuted" if judged.refuted else "as the default" if same else "stands"
