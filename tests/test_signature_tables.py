"""Tables of signatures: in the right place, of the right runs, with the right p."""

from typing import get_args

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from scipy import stats

from coartic import corrective_trial, initial_hands
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.signatures import signatures_document
from coartic.analysis.report.tables.contexts import contexts_table, slopes_tables
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.report.tables.signatures import definitions_table, signatures_tables
from coartic.analysis.report.text import number_text
from coartic.analysis.signatures import register, within
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.signatures.rows import Place, Shown, Signature
from coartic.analysis.study import Study
from tests.support.suites import run_and_write, suite_of

EC1, EC4, ALONE = "dual-process/EC1", "dual-process/EC4", "corrective-alone/given"


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """Three tasks that differ in goal 2."""
    folder = tmp_path_factory.mktemp("family")
    moved = 'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\nmove = {goal=2, by=%s}'
    cells = suite_of(
        folder,
        'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]',
        moved % "[[0, -0.5], [0, -0.25]]",
    )
    return Study(run_and_write(folder / "results", cells=cells, runs=3, trials=60))


def by_column(table):
    """Values of a table by key of the row and name of the column."""
    names = [column.name for column in table.columns]
    return {row.key: dict(zip(names, row.values, strict=True)) for row in table.rows}


def tables_of(study, task):
    return {table.id.removesuffix(f"-{task}"): table for table in signatures_tables(study, task)}


def test_the_main_table_says_what_the_runs_say(traced):
    for task in ("ascending", "descending", "two-armed-1"):
        rows = by_column(tables_of(traced, task)["main-signatures"])
        initial = corrective_trial(traced.tasks[task], initial_hands(traced.tasks[task]))
        for label, row in rows.items():
            runs = traced.cells[task, label].good
            shorter = -runs.reward.to_numpy(dtype=float) - initial.ticks
            assert row["runs"] == len(runs)
            total = row["total_against_initial"]
            assert total.value == pytest.approx(shorter.mean())
            if len(shorter) > 1:
                half = stats.t.ppf(0.975, len(shorter) - 1) * stats.sem(shorter)
                assert total.high - total.low == pytest.approx(2 * half)
        rewards = [traced.cells[task, label].runs.reward.mean() for label in rows]
        assert rewards == sorted(rewards, reverse=True)
    assert "hand_entropy" not in by_column(tables_of(traced, "ascending")["main-signatures"])[EC1]
    assert not {"base_reversals_base_y", "base_reversals"} & row.keys()  # y is locked
    assert "base_reversals_base_x" in row


def test_every_signature_of_a_task_is_in_its_place(traced):
    """By goal and joint, from what the frame says of the same place; nothing is left out."""
    frame = traced.signatures
    frame = frame[(frame.task == "two-armed-1") & (frame.label == EC4) & frame.value.notna()]
    frame = frame[frame.against == ""]
    rows = {}
    for table in tables_of(traced, "two-armed-1").values():
        assert all(column.rests_on for column in table.columns if column.kind != "text")
        rows |= by_column(table)[EC4]
    for _, row in frame.iterrows():
        name = row.signature.lower().replace(" ", "_").replace("δ", "d").replace("-", "_")
        name += "" if pd.isna(row.goal) else f"_goal_{row.goal}"
        shown = rows[name + (f"_{row.joint}" if row.joint else "")]
        assert shown.value == row.value
        assert (shown.low is None) == np.isnan(row.low)
        assert shown.low is None or (shown.low, shown.high) == (row.low, row.high)
    counts = traced.cells["two-armed-1", EC4].runs.hands.value_counts()
    assert set(rows["hands"].split(", ")) == {f"{hands} {n}" for hands, n in counts.items()}


def test_what_is_empty_says_why(traced):
    synergy = tables_of(traced, "ascending")["synergy"]
    assert [row.key for row in synergy.rows] == [EC1]
    lacking = "trajectory-optimisation/path-length (one run: no variance across runs)"
    assert synergy.notes[-1] == f"Without values: {lacking}."
    assert "neutral 0.347" in synergy.columns[2].header
    other_arm = tables_of(traced, "two-armed-1")["other-arm"]
    never = f"Without values: {ALONE} (the other hand hits no later goal)."
    assert never in other_arm.notes  # it has one hand all along


def test_rounding_is_not_shown(traced):
    """A path that goes straight on turns by 3e-11 rad: by nothing."""
    (column,) = [
        column
        for column in tables_of(traced, "ascending")["main-signatures"].columns
        if column.name == "turning_angle_goal_1"
    ]
    assert number_text(3.28e-11, column) == "0.000"


def holm_by_hand(p):
    """Holm (1979): the smallest times their number, and so on, never falling."""
    found, least = {}, 0.0
    for rank, name in enumerate(sorted(p, key=p.get)):
        least = max(least, min(1.0, p[name] * (len(p) - rank)))
        found[name] = least
    return found


def test_p_values_are_adjusted_within_their_table(traced):
    frame = traced.signatures
    tests = frame[(frame.signature == "ΔV z") & (frame.task == "two-armed-1") & frame.p.notna()]
    raw = {(row.label, row.goal): row.p for row in tests.itertuples()}
    assert len(raw) > 4
    rows = by_column(tables_of(traced, "two-armed-1")["synergy"])
    for (label, goal), p in holm_by_hand(raw).items():
        assert rows[label][f"dv_z_goal_{goal}_p"] == pytest.approx(p)


def test_contexts(traced):
    rows = by_column(contexts_table(traced))
    own = rows[f"ascending, goal 1, right hand, against descending, {EC1}"]
    frame = traced.signatures
    frame = frame[(frame.task == "ascending") & (frame.label == EC1) & (frame.against != "")]
    frame = frame.set_index("signature")
    adjusted = holm_by_hand(frame.p.dropna().to_dict())
    assert len(adjusted) == 3
    for name, p in adjusted.items():
        column = name.replace(" ", "_").replace("-", "_")
        assert own[column] == Estimate(frame.value[name])
        assert own[f"{column}_p"] == pytest.approx(p)
    together = pd.isna(frame.value["lead time"])  # so few runs may not differ at the hit
    assert own["lead_at_most"] == (None if together else frame.longest["lead time"])
    assert own["runs"] == 8
    table = contexts_table(traced)
    (row,) = table.rows
    assert row.cells == (("ascending", EC1), ("descending", EC1))
    assert "methods in each by mean reward, best first: 1 row in all." in table.notes[1]
    whys = set(frame.why_not[(frame.why_not != "") & frame.value.isna()])
    assert all(any(why in note for note in table.notes[2:]) for why in whys)


def test_slopes(family):
    (table,) = [t for t in slopes_tables(family) if t.id == "slopes-ascending-1-of-2-right"]
    assert "anticipatory of goal 2" in table.caption
    frame = family.signatures
    frame = frame[(frame.goal == 1) & (frame.moving == 2)]
    slopes = frame[frame.signature == "locus slope"].set_index("joint")
    norm = frame[frame.signature == "locus slope norm"].squeeze()
    rows = by_column(table)
    assert next(iter(rows)) == f"{EC1}, norm"
    assert rows[f"{EC1}, norm"]["slope"] == Estimate(norm.value)
    assert rows[f"{EC1}, norm"]["slope_p"] == norm.p  # the only one of its kind
    moving = slopes[slopes.value.abs() > 1e-9]
    assert {row["joint"] for row in rows.values()} == {"norm", *moving.index}  # one arm is idle
    for joint, p in holm_by_hand(moving.p.to_dict()).items():
        own = rows[f"{EC1}, {joint}"]
        assert own["runs"] == 9
        assert own["slope"] == Estimate(*moving.loc[joint, ["value"]], None,
                                        *moving.loc[joint, ["low", "high"]])  # fmt: skip
        assert own["slope_p"] == pytest.approx(p)
    assert {len(row.cells) for row in table.rows} == {3}


def test_the_page_has_every_table(traced, family):
    for study in (traced, family):
        document = signatures_document(study)
        page = markdown(document, tables="")
        ids = [table.id for table in document.tables()]
        made = [table for task in study.tasks for table in signatures_tables(study, task)]
        made += [*filter(None, [contexts_table(study)]), *slopes_tables(study)]
        assert ids == [*(table.id for table in made), definitions_table().id]
        assert page.startswith("# Signatures of coarticulation\n")
        assert ("† Reconstructed" in page) == any(t.reconstructed for t in study.tasks.values())


def test_a_signature_is_a_measure_and_a_row(traced, monkeypatch):
    """Added to the register, it has values and a column of the table that it names."""

    def length(cell, signature):
        yield within.mean_at(signature, Place(), [run.ticks for run in cell.runs])

    row = Signature(
        name="length", measure=length, unit="ticks", range="ticks", meaning="how long",
        heading="length", table="main-signatures",
    )  # fmt: skip
    monkeypatch.setattr(register, "WITHIN", (*register.WITHIN, row))
    monkeypatch.setitem(REGISTER, "length", row)
    study = Study(traced.results)
    shown = by_column(tables_of(study, "ascending")["main-signatures"])[EC1]["length"]
    assert -shown.value == traced.cells["ascending", EC1].runs.reward.mean()


def test_a_signature_names_a_table_that_there_is():
    assert set(get_args(Shown)) <= LAYOUTS.keys()
    fields = dict(REGISTER["total against initial"])
    with pytest.raises(ValidationError, match="table"):
        Signature.model_validate(fields | {"table": "nowhere"})
