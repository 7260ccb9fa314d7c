"""The instances of a folder: the best known of each, how far methods stay behind it, and in how
many coarticulation is there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from coartic import Task
from coartic.analysis.methods import LEARNERS, PLACEBO, most_exploring
from coartic.analysis.optima import gap_share, locks_base
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.subtasks import ROUNDING
from coartic.analysis.statistics.instances import Runs, Scores
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.topics.coarticulation.placebo import of_placebo
from coartic.robot import Array
from coartic.runs.plan import SEARCH
from coartic.tasks.optima import KnownOptimum


@dataclass(frozen=True, eq=False)
class Sample:
    """Instances of families: the tasks of a folder that were drawn."""

    study: Study

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """The instances by name."""
        items = self.study.tasks.items()
        return {name: task for name, task in items if task.family is not None}

    @cached_property
    def families(self) -> dict[str, tuple[str, ...]]:
        """Names of the instances with a reference, by family with its version."""
        names_by_family: dict[str, list[str]] = {}
        for name in self.references:
            names_by_family.setdefault(str(self.tasks[name].family), []).append(name)
        return {family: tuple(names) for family, names in names_by_family.items()}

    @cached_property
    def references(self) -> dict[str, KnownOptimum]:
        """What the solutions of each instance are measured by, where there is any."""
        known = self.study.best_known
        return {name: known[name] for name in self.tasks if name in known}

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Methods with their variants but for searches for the optimum, in the plan's order."""
        cells = self.study.cells.items()
        return tuple(
            dict.fromkeys(
                label
                for (name, label), cell in cells
                if name in self.references
                and not label.startswith(SEARCH)
                and not locks_base(cell.runs)
                and len(cell.good)
            )
        )

    def label_on(self, name: str, label: str) -> str:
        """Label of a method on an instance: ``learner`` is the condition that explores most."""
        return most_exploring(self.tasks[name]) if label == "learner" else label

    def cell(self, name: str, label: str) -> CellRuns | None:
        """Runs of a method on an instance with a reference; None where none has a solution."""
        cell = self.study.cells.get((name, self.label_on(name, label)))
        return cell if cell is not None and name in self.references and len(cell.good) else None

    def gap(self, name: str, label: str, *, to_bound: bool = False) -> Array | None:
        """Gaps of the solved runs (n,), as shares of the best known reward; None without any.

        The gap to the optimum is at least this. To the proven bound, which it is at most, it is
        None where nothing is proven.
        """
        cell = self.cell(name, label)
        if cell is None:
            return None
        reference = self.references[name]
        to = reference.bound if to_bound else reference.reward
        return None if to is None else gap_share(cell.rewards, to)

    def gaps(self, label: str, *, to_bound: bool = False) -> Scores:
        """Gaps by family, on the instances that the method solved in some run.

        A family without one is left out.
        """
        by_family: dict[str, list[Runs]] = {}
        for family, names in self.families.items():
            for name in names:
                gap = self.gap(name, label, to_bound=to_bound)
                if gap is not None:
                    by_family.setdefault(family, []).append((gap,))
        return by_family

    def shared(self, *labels: str) -> dict[str, tuple[str, ...]]:
        """Names of the instances that all of the methods solved in some run, by family."""
        by_family = {
            family: tuple(
                n for n in names if all(self.gap(n, label) is not None for label in labels)
            )
            for family, names in self.families.items()
        }
        return {family: names for family, names in by_family.items() if names}

    @cached_property
    def by_hands(self) -> dict[str, dict[str, int]]:
        """Best reward of any run of the folder with each hand sequence, by instance.

        The corrective process alone with every sequence counts as well. The best that a sequence
        can give is at least that.
        """
        runs = self.study.runs
        columns = ["task", "hands", "reward"]
        alone = [self.study.sequences(name).assign(task=name) for name in self.tasks]
        every = pd.concat([part[columns] for part in (runs[runs.status == "ok"], *alone)]).dropna()
        best: dict[str, dict[str, int]] = {name: {} for name in self.tasks}
        of_instances = every[every.task.isin(best)]
        for task, hands, reward in zip(
            of_instances.task, of_instances.hands, of_instances.reward, strict=True
        ):
            best[task][hands] = max(int(reward), best[task].get(hands, int(reward)))
        return best


@cached
def sample(study: Study) -> Sample:
    """The instances of a folder, which may have none."""
    return Sample(study)


THERE = {"hand": 0.1, "arm": ROUNDING, "other arm": 0.1, "first": ROUNDING, "whole": ROUNDING}
"""Least values with which signs of :data:`~coartic.analysis.signatures.signs.SIGNS` are there: a
tenth of the goals, or of the way; more than a tick, which rounding can make."""


@cached
def signs(study: Study) -> dict[tuple[str, str], dict[str, Array]]:
    """Values of signs (n,) on every instance, of the learner by condition and of the placebo that
    shows most of a sign.

    By the instance's name and the method's label, then by the sign's name in :data:`THERE`; a
    value for each run that has one. A sign without any is left out.
    """
    by_cell = {}
    for name in sample(study).references:
        for label in (*LEARNERS, PLACEBO):
            cell = study.cells.get((name, label))
            if cell is not None and len(cell.good):
                measured = {
                    sign: of_placebo(study, name, sign) if label == PLACEBO
                    else SIGNS[sign].of(study.executed(name, label))
                    for sign in THERE
                }  # fmt: skip
                by_cell[name, label] = {sign: each for sign, each in measured.items() if len(each)}
    return by_cell


def scores_of(sample: Sample, label: str, sign: str) -> dict[str, list[Runs]]:
    """A sign of a condition by family, of the instances that have a value."""
    by_cell, scores = signs(sample.study), {}
    for family, names in sample.families.items():
        values = [by_cell.get((name, label), {}).get(sign) for name in names]
        instances: list[Runs] = [(of_runs,) for of_runs in values if of_runs is not None]
        if instances:
            scores[family] = instances
    return scores
