"""The learner tuned as CMA-ES was: ``python -m coartic.analysis.calibration.tuning``.

CMA-ES's two parameters were chosen among five and four values with three or four runs each, on
the paper's tasks (baselines/cma_es.py). Here the learner's two get as much: four values of the
noise's SD, then five of ε, four runs a value and task, the best mean reward over the condition's
tasks wins. What is chosen is then compared with what is printed, on seeds that chose nothing.
Condition 1 has no ε. Takes about a minute.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from coartic import CONDITIONS, ExplorationCondition, learn_many, load_task
from coartic.analysis.statistics.estimates import Inference, paired_difference
from coartic.robot import Array

NOISE = (0.02, 0.05, 0.1, 0.2)
EPSILON = (0.05, 0.1, 0.2, 0.35, 0.5)
TASKS = {"EC1": ("ascending", "descending"), "EC4": ("two-armed-1", "two-armed-2")}
TUNED_BY, JUDGED_BY = range(600_000_000, 600_000_004), range(700_000_000, 700_000_020)
"""Seeds."""


class Tuned(NamedTuple):
    """A condition with the parameters that did best, against the printed ones."""

    task: str
    condition: ExplorationCondition
    gain: Inference
    """Learned reward less that with the printed parameters, paired by seed."""


def tuned(name: str, *, trials: int = 10_000, jobs: int = 1) -> ExplorationCondition:
    """A condition with the noise, then the ε, of the best mean reward over its tasks."""
    found = CONDITIONS[name]
    found = _best((replace(found, noise_sd=value) for value in NOISE), trials, jobs)
    if found.hand_exploration != "none":
        found = _best((replace(found, epsilon=value) for value in EPSILON), trials, jobs)
    return found


def against_printed(
    conditions: Iterable[ExplorationCondition], *, trials: int = 10_000, jobs: int = 1
) -> Iterator[Tuned]:
    """Tuned conditions against the printed ones with the same id, task by task."""
    for condition in conditions:
        for task in TASKS[condition.id]:
            pair = [
                _rewards(each, task, JUDGED_BY, trials, jobs)
                for each in (condition, CONDITIONS[condition.id])
            ]
            yield Tuned(task, condition, paired_difference(*pair))


def _best(tried: Iterable[ExplorationCondition], trials: int, jobs: int) -> ExplorationCondition:
    """The first of the best."""
    return max(tried, key=lambda condition: _mean(condition, trials, jobs))


def _mean(condition: ExplorationCondition, trials: int, jobs: int) -> float:
    tasks = TASKS[condition.id]
    return float(np.mean([_rewards(condition, t, TUNED_BY, trials, jobs).mean() for t in tasks]))


def _rewards(
    condition: ExplorationCondition, task: str, seeds: Sequence[int], trials: int, jobs: int
) -> Array:
    runs = learn_many(load_task(task), condition, seeds=seeds, trials=trials, jobs=jobs)
    return np.array([run.reward for run in runs], dtype=np.float64)


def main() -> None:
    """Tune both conditions and print a row a task."""
    print("task         condition  noise  ε     gain in reward, 95 %")
    for row in against_printed(map(tuned, TASKS)):
        print(
            f"{row.task:<12} {row.condition.id:<10} {row.condition.noise_sd:<6g} "
            f"{row.condition.epsilon:<5g} {row.gain.estimate:+.1f} "
            f"[{row.gain.low:+.1f}, {row.gain.high:+.1f}]"
        )


if __name__ == "__main__":
    main()
