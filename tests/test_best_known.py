"""The best known rewards of instances: solutions that come to them, and who reads them."""

import csv
import json
import lzma
from collections import Counter
from pathlib import Path

import pytest
from renew_best_known import movements_of

from coartic import execute, load_task
from coartic.motion.solution import corrective_trial
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
