"""The comparison with the paper: its statistics against independent ones."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.comparisons.paper import Comparison, Table, compare
from analysis.markup import words
from analysis.published import (
    Summary,
    pooled,
    published_cell,
    published_exhaustive,
    published_initial,
)
from benchmarks.registry import registry
from benchmarks.suites import load_suite, select_cells
from coartic import load_task
from tests.support.made_up import fake_results, manifest_for


def test_published_numbers():
    assert published_cell("ascending", "EC1").summary == Summary(-303, 2.9, 20)
    assert published_initial("descending") == ("RRR", -333, True)
    assert published_initial("two-armed-1") == ("RRRR", -675, False)
    assert published_exhaustive("two-armed-1") == ("LRLR", -532)
    assert published_exhaustive("two-armed-2") == ("RRRR", -357)
    assert published_cell("two-armed-2", "EC4").summary is None
    assert published_cell("two-armed-2", "EC4").remark == "higher than EC3"
    assert published_cell("ascending", "EC4") is None
    assert published_cell("own", "EC1") is published_initial("own") is None


def test_every_cell_of_the_suite_is_published():
    for cell in select_cells(load_suite("paper"), registry()):
        assert published_cell(cell.task.name, cell.method.rpartition("/")[2]) is not None


def test_pooling_groups_gives_mean_and_sd_of_all():
    rng = np.random.default_rng(12)
    groups = [rng.normal(-520, 8, 11), rng.normal(-609, 17, 9)]
    summary = pooled([Summary(g.mean(), g.std(ddof=1), len(g)) for g in groups])
    together = np.concatenate(groups)
    assert summary.mean == pytest.approx(together.mean())
    assert summary.sd == pytest.approx(together.std(ddof=1))
    assert summary.runs == 20
    assert summary.derived


def test_cells_and_sequences(tmp_path):
    page = compare(
        fake_results(
            tmp_path,
            {
                "run": [0, 1, 2],
                "status": ["ok", "ok", "infeasible"],
                "reason": ["", "", "planted"],
                "reward": [-520, -610, None],
                "hands": ["RRLR", "RRRR", None],
                "initial_reward": [-671, -671, None],
            },
        )
    )
    cells, sequences, methods = page.tables
    assert methods.title.startswith("two-armed-1 †: all methods; optimum")
    row = dict(zip(cells.columns, cells.rows[0], strict=True))
    assert row["published"] == "-560.0 ± 47.1 (20)*"
    assert row["ours: mean ± SD (n)"] == "-565.0 ± 63.6 (2)"
    assert row["initial (published)"] == "-671 (-675)"
    assert row["hands: runs (published)"] == "RRLR 1, RRRR 1 (RRLR 11, RRRR 9)"
    assert [r[2] for r in sequences.rows] == ["RRLR", "RRRR"]
    assert any("1 runs of two-armed-1 x dual-process/EC2 are infeasible: planted" in note
               for note in page.notes)  # fmt: skip
    assert "commit abc4567 with changes" in page.to_markdown()
    assert any("7 of 30000 trials failed" in note for note in page.notes)
    assert row["task"] == "two-armed-1 †"
    assert any(note.startswith("† Reconstructed: goals and start") for note in page.notes)


def test_notes_for_a_terminal():
    assert words("\\* of **x** and `y` in *z*") == "* of x and y in z"


def test_hands_the_paper_does_not_print(tmp_path):
    """EC4 of two-armed 2: no hand sequences are printed, so none is printed as 0."""
    results = fake_results(
        tmp_path,
        {
            "run": [0, 1], "status": ["ok", "ok"], "reason": ["", ""], "reward": [-330, -350],
            "hands": ["RLRR", "RRRR"], "initial_reward": [-357, -357],
        },
    )  # fmt: skip
    runs = results.runs.assign(task="two-armed-2", method="dual-process/EC4")
    results = replace(results, manifest=manifest_for([load_task("two-armed-2")], runs), runs=runs)
    sequences = compare(results).tables[1]
    assert [row[2:5] for row in sequences.rows] == [("RLRR", "–", "–"), ("RRRR", "–", "–")]


def test_no_run_at_all(tmp_path):
    columns = {"status": ["crashed"], "reason": ["x"], "run": [0]}
    nothing = {"reward": [None], "hands": [None], "initial_reward": [None]}
    cells = compare(fake_results(tmp_path, columns | nothing)).tables[0]
    assert cells.rows[0][3:5] == ("– (0)", "–")


def test_markdown():
    page = Comparison("T", (Table("A", ("x", "y"), (("1", "a|b"),)),), ("note",)).to_markdown()
    assert page == "# T\n\n## A\n\n| x | y |\n| --- | --- |\n| 1 | a\\|b |\n\n## Notes\n\n- note\n"
