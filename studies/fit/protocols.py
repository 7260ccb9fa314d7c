"""Simulate people who practise a task by one of six models, and recover what simulated them.

    python studies/fit/protocols.py results/fit

writes ``recovery.csv``, a row for each simulated person. A cell is done at a time; what is done is
not done again. It takes about two hours of one core.
"""

import sys
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
from check import STATISTICS
from models import condition_for, tables_before, trials_of
from simulate import FOREIGN, simulate

from coartic import load_task
from coartic.benchmarks.pool import process_pool
from fit import MODELS, fit_subject

TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
INSTANCES = [f"{family}/v1/i{number:03d}" for number in range(4) for family in FAMILIES]
DATA = {
    "complete": (0.0, 0.0, 0.0), "lossy": (0.0, 0.1, 0.0), "noisy": (0.02, 0.0, 0.02),
    "ignored": (0.02, 0.0, 0.0), "lapses": (0.02, 0.0, 0.02),
}  # fmt: skip
"""SD of motor noise in recorded postures (length unit and rad), share of trials that are lost, and
the SD that the fit is given. People with lapses make 5 % of their hits with ten times the noise."""
LAPSES, LAPSE = 0.05, 10.0
PLAN = (
    (TASKS, "noisy", 100, 5), (TASKS, "complete", 100, 5), (TASKS, "lossy", 100, 5),
    (TASKS, "lapses", 100, 5), (TASKS, "ignored", 100, 2), (TASKS, "complete", 30, 4),
    (TASKS, "noisy", 30, 2), (TASKS, "lossy", 30, 2), (TASKS, "complete", 300, 2),
    (TASKS, "lossy", 300, 1), (INSTANCES, "complete", 100, 1),
    (INSTANCES[:10], "lossy", 100, 1), (INSTANCES[:10], "noisy", 100, 1),
)  # fmt: skip
"""Tasks, data, trials and repeats."""
PEOPLE = (*MODELS, "informed", *FOREIGN)
"""Models of the people of a repeat."""


def cells():
    """Return cells: a task, a number of trials, data and the number of a repeat."""
    return [(task, trials, data, repeat) for tasks, data, trials, repeats in PLAN
            for repeat in range(repeats) for task in tasks]  # fmt: skip


def recover(cell):
    """Simulate and fit people of every model of :data:`PEOPLE`; a frame with a row for each."""
    name, trials, data, _ = cell
    task, rows, (noise, lost, given) = load_task(name), [], DATA[data]
    seed = zlib.crc32(repr(cell).encode())
    for person, model in enumerate(PEOPLE):
        rng = np.random.default_rng([seed, person])
        sigma = np.exp(rng.uniform(np.log(0.01), np.log(0.1)))
        epsilon = rng.uniform(0.05, 0.5)
        kappa = rng.uniform(0.0, 1.0) if model == "informed" else 0.0
        frame = simulate(task, model, sigma, epsilon, kappa, seeds=[[seed, person, 1]],
                         trials=trials)  # fmt: skip
        joints = [*task.robot.joint_names]
        motor = noise * rng.standard_normal((len(frame), len(joints)))
        if data == "lapses":
            motor *= np.where(rng.random((len(frame), 1)) < LAPSES, LAPSE, 1.0)
        frame[joints] += motor
        kept = rng.random(trials) >= lost
        there, condition = trials_of(frame[kept[frame.trial - 1]], task), condition_for(task)
        best, first = (tables_before(task, condition, there, rule).stored
                       for rule in ("best", "memoryless"))  # fmt: skip
        truth = {"true_sigma": sigma, "true_epsilon": epsilon, "true_kappa": kappa,
                 "replaced": (best != first).mean()}  # fmt: skip
        row = dict(zip(("task", "trials", "data", "repeat", "person", "true"),
                       (*cell, person, model), strict=True))  # fmt: skip
        try:
            estimates = fit_subject(task, condition, there, noise=given,
                                    intervals=model in ("best", "informed"))  # fmt: skip
        except np.linalg.LinAlgError:
            estimates = {}
        rows.append(row | truth | estimates)
    return pd.DataFrame(rows).reindex(columns=COLUMNS)


COLUMNS = [
    "task", "trials", "data", "repeat", "person", "true", "true_sigma", "true_epsilon",
    "true_kappa", "replaced",
    *(f"{name}{end}" for name in ("sigma", "epsilon", "kappa") for end in ("", "_low", "_high")),
    *(f"bic_{model}" for model in MODELS), *(f"check_{name}" for name in (*STATISTICS, "lapses")),
    "misfit",
]  # fmt: skip


def main(folder):
    """Recover all cells that the folder does not have."""
    path = Path(folder) / "recovery.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    done = {*pd.read_csv(path)[COLUMNS[:4]].itertuples(index=False, name=None)}
    left = [cell for cell in cells() if cell not in done]
    with process_pool(1) as pool:
        for rows in pool.map(recover, left):
            with path.open("a", encoding="utf-8", newline="") as file:
                rows.to_csv(file, header=False, index=False, float_format="%.6g")


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "results/fit")
