"""The comparison with the paper: its statistics against independent ones."""

import numpy as np
import pytest
from scipy import stats

from coartic.analysis.comparisons.paper import paper_rows, sequence_rows
from coartic.analysis.markup import words
from coartic.analysis.published import (
    Summary,
    pooled,
    published_cell,
    published_exhaustive,
    published_initial,
)
from coartic.analysis.report.comparison import comparison_document, notes_of
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.tables.paper import published_table, sequences_table
from coartic.analysis.report.text import parts
from coartic.analysis.study import Study
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import load_suite, select_cells
from tests.support.made_up import fake_results

MIXED = {
    "run": [0, 1, 2],
    "status": ["ok", "ok", "infeasible"],
    "reason": ["", "", "planted"],
    "reward": [-520, -610, None],
    "hands": ["RRLR", "RRRR", None],
    "initial_reward": [-671, -671, None],
}


def rows_of(table):
    names = [column.name for column in table.columns]
    return [dict(zip(names, row.values, strict=True)) for row in table.rows]


def test_published_numbers():
    assert published_cell("ascending", "EC1").summary == Summary(-303, 2.9, 20, digits=(0, 1))
    assert published_cell("descending", "EC1").summary.digits == (0, 2)
    assert published_cell("two-armed-2", "EC3").summary.digits == (1, 1)
    assert published_cell("two-armed-1", "EC2").summary.digits is None  # derived
    assert published_initial("descending")[:3] == ("RRR", -333, True)
    assert published_initial("two-armed-1")[:3] == ("RRRR", -675, False)
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


def test_a_cell_beside_the_papers(tmp_path):
    study = Study(fake_results(tmp_path, MIXED))
    (cell,) = paper_rows(study)
    # Twenty values with the printed mean and SD, whichever.
    theirs = stats.zscore(np.arange(20.0), ddof=1) * cell.paper.summary.sd - 560.05
    welch = stats.ttest_ind([-520, -610], theirs, equal_var=False).confidence_interval()
    assert cell.difference.estimate == pytest.approx(-4.95)
    assert (cell.difference.low, cell.difference.high) == pytest.approx((welch.low, welch.high))
    assert cell.margin == pytest.approx(5.6005)
    assert cell.margin_of_gain == pytest.approx(5.6005 / (675 - 560.05))
    (row,) = rows_of(published_table(study))
    assert row["task"] == "two-armed-1 †"
    assert (row["published"].value, row["published"].sd) == pytest.approx((-560.05, 47.1), abs=0.1)
    assert (row["published_runs"], row["published_as"]) == (20, "derived")
    assert (row["ours"].value, row["runs"]) == (-565.0, 2)
    assert row["ours"].sd == pytest.approx(90 / 2**0.5)
    assert row["verdict"] == "undecided"
    assert (row["initial"], row["published_initial"]) == (-671, -675)
    assert (row["hands"], row["published_hands"]) == ("RRLR 1, RRRR 1", "RRLR 11, RRRR 9")


def test_hand_sequences_beside_the_papers(tmp_path):
    study = Study(fake_results(tmp_path, MIXED | {"hands": ["RRLR", "LLLR", None]}))
    found = [(r.hands, r.published_runs, list(r.rewards)) for r in sequence_rows(study)]
    # As the runs of both printed ones are printed, there was none of another.
    assert found == [("RRLR", 11, [-520.0]), ("RRRR", 9, []), ("LLLR", 0, [-610.0])]
    apart = [None if r.difference is None else r.difference.estimate for r in sequence_rows(study)]
    assert apart == [0.0, None, None]
    first = rows_of(sequences_table(study))[0]
    assert (first["hands"], first["published"].value, first["ours"].value) == ("RRLR", -520, -520)


def test_rows_of_hand_sequences_add_up_to_all_runs(tmp_path):
    """EC4 of two-armed 1 is printed without its runs, which we take as all."""
    hands = {"hands": ["LRLR", "LRLR", None]}
    results = fake_results(tmp_path, MIXED | hands, method="dual-process/EC4")
    table = sequences_table(Study(results))
    (row,) = rows_of(table)
    assert (row["published_runs"], row["published_as"]) == (20, "printed, runs assumed")
    assert table.rows[0].rests_on["published_runs"] == ("ours",)
    shown = [part.text(table.rows[0].values[part.index]) for part in parts(table)]
    assert shown[3:7] == ["−484", "2.0", "20", "printed, runs assumed"]
    mixed = rows_of(sequences_table(Study(fake_results(tmp_path, MIXED))))
    assert sum(row["published_runs"] for row in mixed) == 20
    assert sum(row["runs"] for row in mixed) == 2


def test_the_page_says_what_failed_and_where_it_was_made(tmp_path):
    document = comparison_document(Study(fake_results(tmp_path, MIXED)))
    page = markdown(document, tables="")
    assert [section.id for section in document.sections] == ["paper", "methods", "limitations"]
    assert "two-armed-1: 1 run is infeasible (planted): `dual-process/EC2` (1 of 3)" in page
    assert "commit abc4567 with changes" in page
    assert "*Reconstructed.* two-armed-1" in page
    notes = notes_of(document)
    assert len(notes) == len(set(notes))
    assert not any(mark in note for note in notes for mark in ("`", "\\*"))


def test_what_is_said_of_several_tables_is_said_once(tmp_path):
    page = markdown(comparison_document(Study(fake_results(tmp_path, MIXED))), tables="")
    lines = [line for line in page.splitlines() if len(line) > 40]
    assert len(lines) == len(set(lines))
    for start in ("Published: Shah", "Told: ", "† Reconstructed"):
        assert sum(line.startswith(start) for line in lines) == 1


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
        task="two-armed-2", method="dual-process/EC4",
    )  # fmt: skip
    study = Study(results)
    found = [(r.hands, r.published, r.published_runs) for r in sequence_rows(study)]
    assert found == [("RLRR", None, None), ("RRRR", None, None)]
    (row,) = rows_of(published_table(study))
    assert row["published_as"] == "not printed, higher than EC3"
    assert {row["published_as"] for row in rows_of(sequences_table(study))} == {"not printed"}
    assert row["verdict"] is row["margin"] is row["published_hands"] is None


def test_no_run_at_all(tmp_path):
    columns = {"status": ["crashed"], "reason": ["x"], "run": [0]}
    nothing = {"reward": [None], "hands": [None], "initial_reward": [None]}
    (row,) = rows_of(published_table(Study(fake_results(tmp_path, columns | nothing))))
    assert (row["ours"], row["runs"], row["difference"], row["verdict"]) == (None, 0, None, None)
