"""Our studies: each measures a small stored folder as version 1.1.0 did, and its page is current.

``tests/studies/NAME`` has a results folder of a small version of the study's suite, and the tables
that the report of version 1.1.0 (commit f7064014, before studies left the package) made of it; but
one verdict of dose there is now undecided, as it hangs on one of five tasks, two of human are, as
verdicts are corrected over models, and comparisons of dose and human with random search have the
same hands.
"""

import hashlib
import re

import pandas as pd
import pytest

from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.suites import load_suite
from coartic.tasks.families import instance_of, own_families
from coartic.tasks.optima import KnownOptimum
from coartic.tasks.task import address_of, task_text
from common.writing import fill_page, stored_picture, write_study
from tests.support.made_up import row, study_of
from tests.support.pictures import draw_the_same
from tests.support.processes import ROOT, program

ALL = sorted(path.parent for path in (ROOT / "studies").glob("*/study.py"))
DRAWN = [folder for folder in ALL if (folder / "figure.svg").exists()]
STUDIES = [folder.name for folder in ALL if (folder / "suite.toml").exists()]
"""Studies of runs; the others have protocols of their own."""
SMALL = ROOT / "tests" / "studies"
INSTANCES = {
    "fourteen-one/v1/i017": "bad507514407bc5c",
    "fourteen-two/v1/i017": "b39b17fca94fc804",
    "seven-one/v1/i017": "a5e8d899533de3da",
    "seven-two/v1/i017": "66b839fbe0b33d6d",
}
"""Hashes of instances of the studies' own families, as version 1.1.0 drew them."""


def read(path):
    return pd.read_csv(path, index_col=0)


def comparable(table, path):
    """A table as it is read from its file, without what a tie of resamples decides."""
    table.to_csv(path, float_format="%.6g")
    table = read(path)
    ends = [name for name in table if name.endswith(("_low", "_high"))]
    resampled = {"evidence", "p", "p_holm", "beyond_p", "p_without", "opposite_p_holm"}
    return table.drop(columns=[*ends, *(resampled & {*table})])


@pytest.mark.parametrize("name", STUDIES)
def test_tables_are_those_of_version_1_and_are_drawn(name, measured, tmp_path):
    assert load_suite(str(ROOT / "studies" / name / "suite.toml")).name == name
    study, _, tables = measured(name)
    for path in (SMALL / name).glob("*.csv"):
        ours, theirs = tables[path.stem], read(path)
        for name in {"p", "p_holm"} & {*ours}:
            assert ours[name].tolist() == pytest.approx([*theirs[name]], abs=0.03, nan_ok=True)
        ours, theirs = (comparable(each, tmp_path / "table.csv") for each in (ours, theirs))
        ours = ours.loc[theirs.index, theirs.columns]  # later versions may have more signatures
        pd.testing.assert_frame_equal(ours, theirs, rtol=1e-4, atol=1e-9, check_dtype=False)
    tables["results"].to_csv(tmp_path / "results.csv")
    panels = study.draw(read(tmp_path / "results.csv")).axes
    assert all(axes.has_data() or axes.texts for axes in panels)


@pytest.mark.parametrize("folder", ALL, ids=lambda folder: folder.name)
def test_page_says_what_the_tables_say(folder):
    tables = {path.stem: read(path) for path in folder.glob("*.csv")}
    page = fill_page(folder / "README.md.jinja", **tables)
    assert page == (folder / "README.md").read_text("utf-8")


@pytest.mark.parametrize("folder", DRAWN, ids=lambda folder: folder.name)
def test_figure_is_drawn_from_the_stored_results(folder):
    study, results = program(folder / "study.py"), read(folder / "results.csv")
    todo = f"make it again: PYTHONPATH=studies python studies/{folder.name}/study.py"
    drawn = stored_picture(study.draw, results)
    assert draw_the_same(drawn, (folder / "figure.svg").read_bytes()), todo


def test_families_of_studies_are_what_they_were():
    families = own_families(sorted((ROOT / "studies").glob("*/*.v[0-9]*.toml")))
    for name, due in INSTANCES.items():
        task = instance_of(families[address_of(name).family], address_of(name))
        assert hashlib.sha256(task_text(task).encode()).hexdigest()[:16] == due


def test_the_page_on_studies_has_a_whole_study(tmp_path):
    """Without tables its figure and page are made again of the stored ones. Runs are made up, with
    gaps of 5 % and 3 %."""
    page = (ROOT / "studies" / "README.md").read_text("utf-8")
    folder = tmp_path / "mine"
    folder.mkdir()
    for text in re.findall(r"```(?:toml|python|jinja)\n(.*?)```", page, re.DOTALL):
        (tmp_path / re.search(r"mine/\S+", text)[0]).write_text(text, "utf-8")
    cells = [job.cell for job in plan_suite(folder / "suite.toml")]
    tasks = {cell.task.name: cell.task for cell in cells}
    rows = [row(cell.method.name, -103 - 2 * (cell.method.name.endswith("current-goal")),
                task=cell.task.name, trials=0) for cell in cells]  # fmt: skip
    best = dict.fromkeys(tasks, KnownOptimum(-100, -100))
    study = program(folder / "study.py")
    made = [folder / "README.md", folder / "figure.svg"]
    tables, written = study.measure(study_of(rows, tasks.values(), optima=best)), []
    for given in (tables, {}):
        write_study(folder, given, study.draw)
        written.append([file.read_bytes() for file in made])
        for file in made:
            file.unlink()
    assert written[0] == written[1]
    assert b"gap is 3.0 %" in written[0][0]
    evidence = read(folder / "claims.csv").evidence["goals-ahead-gain"]
    assert evidence.startswith("The gap falls by 2.00 ")


def test_a_picture_with_another_mark_is_another_picture():
    svg = (ROOT / "studies" / "dose" / "figure.svg").read_bytes()
    assert draw_the_same(svg, svg)
    moved = re.sub(rb'x="(\d+)\.', lambda found: b'x="%d.' % (int(found[1]) + 1), svg, count=1)
    assert moved != svg
    assert not draw_the_same(svg, moved)
    assert not draw_the_same(svg, svg.replace(b"<use", b"<g", 1))
