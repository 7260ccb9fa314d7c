"""The best known rewards of instances: solutions that come to them, and who reads them."""

import csv
import json
import lzma
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from renew_best_known import movements_of

import coartic
from coartic import execute, load_task
from coartic.analysis.optima import known_optima
from coartic.motion.initial import corrective_trial
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import BEST_KNOWN, best_shipped, essence

SOLUTIONS = json.loads(
    lzma.decompress(Path(__file__).with_name("best_known_solutions.json.xz").read_bytes())
)
with BEST_KNOWN.open(encoding="ascii", newline="") as lines:
    ROWS = {row["instance"]: row for row in csv.DictReader(lines)}


def test_the_first_forty_test_instances_of_every_family_have_one():
    assert ROWS.keys() == SOLUTIONS.keys()
    counts = Counter(name.rpartition("/")[0] for name in ROWS)
    assert counts == dict.fromkeys(shipped_families(), 40)


@pytest.mark.parametrize("family", sorted({name.rpartition("/")[0] for name in ROWS}))
def test_solutions_come_to_the_best_known_reward(family):
    """Executed, with the hands of the table, and no better than what is proven."""
    for name in (name for name in ROWS if name.startswith(f"{family}/")):
        task, known = load_task(name), best_shipped(load_task(name))
        assert known is not None
        assert ROWS[name]["essence"] == essence(task)
        execution = execute(task, movements_of(SOLUTIONS[name]))
        assert (execution.reward, execution.hands) == (known.reward, known.hands)
        assert known.bound is None or known.reward <= known.bound
        alone = corrective_trial(task, task.initial_hands).reward
        assert alone is None or known.reward >= alone


def test_problems_of_a_family_have_a_target():
    first, *_ = coartic.problems("two-armed/v1", count=2)
    known = best_shipped(load_task("two-armed/v1/i000"))
    assert first.best_known == -known.reward
    assert first.proven == known.proven
    assert coartic.objective("two-armed/v1/i900").best_known is None


def test_a_movement_is_compared_with_the_best_known_of_an_instance():
    name = "one-armed/v1/i000"
    movement = coartic.trajectory(name, movements_of(SOLUTIONS[name]))
    frame = movement.compare("optimum")
    assert frame.this_is_better_by.tolist() == [0.0, 0.0]


def test_gaps_of_a_folder_without_a_search_are_to_the_best_known():
    import pandas as pd

    name = "one-armed/v1/i001"
    runs = pd.DataFrame(
        [(name, "other", -100_000, None, "ok", "RRR", "{}")],
        columns=["task", "method", "reward", "proven_bound", "status", "hands", "parameters"],
    ).astype({"proven_bound": "Int64"})
    best = known_optima(runs, {name: load_task(name)})[name]
    shipped = best_shipped(load_task(name))
    assert (best.reward, best.bound) == (shipped.reward, shipped.bound)
    assert np.isfinite(best.reward)
