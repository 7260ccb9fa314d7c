"""Twenty numbers of the pages against a computation in plain NumPy from the shipped runs."""

import re
from pathlib import Path

import pandas as pd
import pytest

from tests import plain_numbers
from tests.support.processes import ROOT

STORED = ROOT / "docs" / "stored" / "comparison"


def test_stored_tables_have_the_numbers_of_the_plain_computation():
    source = Path(plain_numbers.__file__).read_text("utf-8")
    assert not re.search(r"^\s*(import|from) (coartic|tests)", source, re.MULTILINE)
    signs, ranking, methods = (
        pd.read_csv(STORED / f"{name}.csv", index_col=0)
        for name in ("signatures", "ranking", "methods")
    )
    plain = plain_numbers.numbers()
    stored = {
        f"{column} {task} {method}": signs[column + ending][f"{task} dual-process/EC1 RRR"]
        for column in ("first", "whole")
        for task in ("ascending", "descending")
        for method, ending in (("dual-process/EC1", ""), ("random-search", "_control"))
    }
    rows = {"learner": "learner", "cma": "cma-es/bandit",
            "hill climbing": "hill-climbing", "random search": "random-search"}  # fmt: skip
    stored |= {f"{score} {name}": ranking[score][row]
               for score in ("gap", "share") for name, row in rows.items()}  # fmt: skip
    stored["RLRR random search"] = methods.reward["two-armed-2 random-search hands=RLRR"]
    stored["EC4 two-armed-2"] = methods.reward["two-armed-2 dual-process/EC4"]
    rewards = pd.read_csv(ROOT / "studies" / "replication" / "rewards.csv", index_col=0)
    for name, row in (("EC2 RRLR", "two-armed-1 EC2"), ("EC3 RLRR", "two-armed-2 EC3")):
        stored[name] = rewards.runs[f"{row} {name.split()[1]}"]
    assert len(plain) == 20
    assert plain == pytest.approx(stored, rel=1e-5)
