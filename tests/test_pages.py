"""Pages: their tables and numbers are those of files that ship, which are made of shipped runs."""

import re
import sys
from functools import cache
from pathlib import Path

import fill_tables
import numpy as np
import pandas as pd
import pytest
import store_tables
from check_readme import differences

from coartic.estimates import Estimate, difference_of_means, mean
from coartic.runs.shipped import shipped_hashes
from coartic.tasks.optima import BEST_KNOWN
from stored import stored_picture
from tests.support.pictures import draw_the_same
from tests.support.processes import ROOT, programs

DOCS, STORED = ROOT / "docs", ROOT / "docs" / "stored"
WITH_NUMBERS = ("README.md", "docs/findings.md")
"""Pages whose numbers stand in tables that they show or link."""
NO_RESULTS = {
    *map(str, range(15)), "2013", "3.11", "95", "90", "20", "30", "40", "60", "100", "200",
    "1,000", "10,000", "0.01", "0.6", "18",
}  # fmt: skip
"""Numbers that are none of results: counts of goals, methods and worlds, years, numbers of trials,
runs and tasks, levels of intervals, sizes of noise, versions."""
RESAMPLED = r"_low$|_high$|\bp\b|^p_|_p$|_p_|verdict|replicates|more_than|beyond_"
"""Columns that depend on the number of resamples, which is smaller in tests, or on ties of them."""


def test_each_page_is_filled_from_files_that_ship():
    marked = 0
    for page in fill_tables.pages():
        text = page.read_text("utf-8")
        assert fill_tables.filled(text) == text, f"{page}: python docs/scripts/fill_tables.py"
        marked += text.count("<!-- table ")
    assert marked >= len(fill_tables.TABLES)


def test_a_table_has_the_numbers_of_its_file():
    """In per cent where the heading says so, and with another file's beside them."""
    headings, rows = fill_tables.rows_of("gaps")
    ranking = pd.read_csv(STORED / "comparison" / "ranking.csv", index_col=0)
    drawn = pd.read_csv(STORED / "families" / "random-tasks.csv", index_col=0)
    assert headings[0] == "method"
    cma = ranking.loc["cma-es/bandit"]
    assert rows[1][1] == f"{100 * cma.gap:.1f} [{100 * cma.gap_low:.1f}, {100 * cma.gap_high:.1f}]"
    assert rows[1][3] == f"{100 * drawn.gap['cma-es/bandit']:.0f}"


NUMBER = r"[-−]?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?"


def numbers_in(text):
    """Yield the numbers of a section as tuples of strings: of one, or of three with an interval.

    Links, code, comments, headings and numbers of lists are left out.
    """
    text = re.sub(r"<!--.*?-->|`[^`\n]*`|\]\([^)]*\)", " ", text)
    text = re.sub(r"^#.*$|^\s*\d+\. ", " ", text, flags=re.MULTILINE)
    interval = rf"(?<![\w.,])({NUMBER})(?: % )? ?\[({NUMBER}), ({NUMBER})\]"
    yield from re.findall(interval, text)
    for number in re.findall(rf"(?<![\w.,]){NUMBER}(?!\w)", re.sub(interval, " ", text)):
        yield (number,)


def sections_of(text):
    """Return the sections of a page, each with its heading."""
    return re.split(
        r"^(?=#+ )", re.sub(r"```.*?```", "", text, flags=re.DOTALL), flags=re.MULTILINE
    )


def files_of(page, text):
    """Return the tables that a section shows or links, also those of studies that it links.

    Tables with a row for each run or pair are too large to say anything.
    """
    shown = [fill_tables.TABLES[name] for name in re.findall(r"<!-- table (\S+) -->", text)]
    files = {ROOT / table["file"] for table in shown}
    files |= {ROOT / name for table in shown for name in re.findall(r"\S+\.csv", table["columns"])}
    for link in re.findall(r"\]\(([^)#\s]+)", text):
        target = (page.parent / link).resolve()
        if target.suffix == ".csv":
            files.add(target)
        elif target.name == "README.md" and target.parent.parent == ROOT / "studies":
            files |= {*target.parent.glob("*.csv")}
    return sorted(file for file in files if file.stat().st_size < 50_000)


@cache
def values_of(file):
    """Return all numbers in a table, and all triples of an estimate and the ends of its interval.

    Those within words are included. Shapes are (n, 1) and (m, 3).
    """
    frame = pd.read_csv(file, low_memory=False)
    numbers = frame.select_dtypes("number")
    single, triples = [*numbers.to_numpy(np.float64).ravel()], [np.empty((0, 3))]
    for name in numbers:
        ends = [name, f"{name}_low", f"{name}_high"]
        if {*ends} <= {*numbers}:
            triples.append(numbers[ends].to_numpy(np.float64))
    words = frame[[*frame.columns.difference(numbers.columns)]].fillna("").map(str)
    text = " ".join(words.to_numpy().ravel())
    found = [[number(each) for each in of] for of in numbers_in(text)]
    triples += [np.array([of]) for of in found if len(of) == 3]
    single += [each for of in found for each in of]
    return np.array(single)[:, None], np.concatenate(triples)


def number(text):
    """Return a number of a page."""
    return float(text.replace(",", "").replace("−", "-"))


def is_printed(printed, values):
    """Return whether numbers are those of a row of ``values``, or a hundred times as large.

    A single number may have the other sign.
    """
    wanted = np.array([number(each) for each in printed])
    half = 0.5 * 10.0 ** -len(printed[0].partition(".")[2]) * 1.0001
    if len(wanted) == 1:
        wanted, values = np.abs(wanted), np.abs(values)
    return any((np.abs(scale * values - wanted) <= half).all(axis=-1).any() for scale in (1, 100))


def missing_numbers(page, text):
    """Return the numbers of a section that stand in no table that it shows or links."""
    tables = [values_of(file) for file in files_of(page, text)]
    lost = []
    for printed in dict.fromkeys(numbers_in(text)):
        values = [of[len(printed) == 3] for of in tables]
        if printed[0] in NO_RESULTS and len(printed) == 1:
            continue
        if not any(is_printed(printed, each) for each in values):
            lost.append(printed)
    return lost


@pytest.mark.parametrize("name", WITH_NUMBERS)
def test_each_number_stands_in_a_table_that_its_section_shows_or_links(name):
    page = ROOT / name
    for section in sections_of(page.read_text("utf-8")):
        assert missing_numbers(page, section) == [], section.partition("\n")[0]


def test_a_wrong_number_is_found():
    """Of an interval nearly always (49 of 52), of single numbers what no table has by chance."""
    page, found = ROOT / "docs" / "findings.md", []
    for section in sections_of(page.read_text("utf-8")):
        for value, low, high in {of for of in numbers_in(section) if len(of) == 3}:
            other = f"{number(value) + 1:.{len(value.partition('.')[2])}f}".replace("-", "−")
            wrong = section.replace(f"{value} [{low}, {high}]", f"{other} [{low}, {high}]")
            found.append((other, low, high) in missing_numbers(page, wrong))
    assert len(found) > 50
    assert np.mean(found) > 0.9


def test_links_of_pages_name_files_that_are_there():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("studies/**/*.md"), *DOCS.rglob("*.md")]
    lost = []
    for page in pages:
        # Code spans and blocks have brackets of their own.
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text("utf-8"), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)#\s]+)", text):
            if "://" not in link and not (page.parent / link).exists():
                lost.append(f"{page.name}: {link}")
    assert not lost


def test_frozen_studies_say_where_they_were_made():
    alive = {"replication", "optima"}
    for page in (ROOT / "studies").glob("*/README.md"):
        line = page.read_text("utf-8").splitlines()[2]
        frozen = "*Made with 7.0.0 (a0cf376b); at this commit `make studies` makes it again.*"
        assert (line == frozen) == (page.parent.name not in alive), page
        assert page.parent.name in alive or not [*page.parent.glob("*.py")]


def test_stored_gaps_of_families_are_to_the_best_known_rewards_that_ship():
    """Else pages are behind a reward that was renewed."""
    stored = pd.read_csv(STORED / "families" / "by-task.csv")
    best = stored.task.map(pd.read_csv(BEST_KNOWN, index_col="instance").reward)
    np.testing.assert_allclose(stored.gap, (stored.reward - best) / best, rtol=1e-4, atol=1e-5)


def test_readme_is_compared_with_a_folder(shipped_study):
    """Whose rows that differ are named."""
    study = shipped_study("comparison")
    assert differences(study) == (13, [])


def compare(made, stored, what):
    """Tables have six digits. Ends of intervals and p-values may differ by a tie of resamples."""
    assert [*made] == [*stored], what
    tied = made.columns.str.contains(r"_low$|_high$|\bp\b|^p_|_p$|_p_")
    for columns, rtol in ((~tied, 1e-5), (tied, 0.02)):
        pd.testing.assert_frame_equal(
            made.loc[:, columns], stored.loc[:, columns], rtol=rtol, atol=1e-9, obj=what
        )


@pytest.mark.parametrize("suite", shipped_hashes())
def test_tables_and_figures_of_a_shipped_suite_are_made_of_its_runs(suite, shipped_study, tmp_path):
    study, todo = shipped_study(suite), "make it again: python docs/scripts/store_tables.py"
    for path in (STORED / suite).glob("*.csv"):
        store_tables.make_table(study, path.stem).to_csv(tmp_path / "made.csv", float_format="%.6g")
        made, stored = (pd.read_csv(each, index_col=0) for each in (tmp_path / "made.csv", path))
        compare(made, stored, f"{path.name} ({todo})")
    for path in (STORED / suite).glob("*.svg"):
        drawn = stored_picture(store_tables.draw, study, path.stem)
        assert draw_the_same(drawn, path.read_bytes()), f"{path}: {todo}"


def test_tables_and_figure_of_the_optima_are_made_of_what_ships():
    """But the CPU times, which are in a log that does not ship."""
    (study,) = programs("optima", "study")
    folder = ROOT / "studies" / "optima"
    for name, made in study.tabulate(folder).items():
        stored = pd.read_csv(folder / f"{name}.csv", index_col=0)
        left_out = ["seconds"]
        pd.testing.assert_frame_equal(
            made.drop(columns=left_out, errors="ignore"),
            stored.drop(columns=left_out, errors="ignore"),
            rtol=1e-4, check_dtype=False, check_names=False,
        )  # fmt: skip
    results = pd.read_csv(folder / "results.csv", index_col=0)
    drawn = stored_picture(study.draw, results)
    assert draw_the_same(drawn, (folder / "figure.svg").read_bytes())


def without_interval(sample, other=0.0):
    """A mean, or a difference between two, as ``mean`` and ``difference_of_means`` estimate it."""
    return Estimate(float(np.mean(sample) - np.mean(other)))


def test_tables_of_the_replication_are_made_of_shipped_runs(shipped_study, tmp_path):
    """But claims on runs of suite ablations, which do not ship, and intervals in evidence."""
    (study,) = programs("replication", "study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "load", shipped_study)
        patch.setattr(sys.modules["judging"], "RESAMPLES_OF_CLAIMS", 99)
        for name in ("comparisons", "families", "hands"):
            for estimate in (mean, difference_of_means):
                patch.setattr(sys.modules[name], estimate.__name__, without_interval, raising=False)
        tables = study.measure(["comparison", "families"])
    tables["claims"] = tables["claims"].query("suite != ''")
    del tables["verdicts"]  # they depend on the number of resamples
    for name, table in tables.items():
        table.drop(columns="run_ids", errors="ignore").to_csv(
            tmp_path / "made.csv", float_format="%.6g"
        )
        made = pd.read_csv(tmp_path / "made.csv", index_col=0).sort_index(kind="stable")
        stored = pd.read_csv(Path(study.HERE) / f"{name}.csv", index_col=0)
        if name == "claims":
            stored = stored[stored.suite != "ablations"]
            for column in ("evidence", "evidence_beyond"):
                stored[column] = stored[column].str.replace(r" \[[^]]*\]", "", regex=True)
        assert [*made] == [*stored]
        kept = made.columns[~made.columns.str.contains(RESAMPLED)]
        pd.testing.assert_frame_equal(
            made[kept], stored.sort_index(kind="stable")[kept], rtol=1e-4, atol=1e-6,
            check_dtype=False, check_names=False, obj=name,
        )  # fmt: skip


def test_the_counts_of_verdicts_are_those_of_the_claims():
    (study,) = programs("replication", "study")
    claims = pd.read_csv(study.HERE / "claims.csv", index_col=0).fillna({"suite": ""})
    stored = pd.read_csv(study.HERE / "verdicts.csv", index_col=0)
    assert study.count_verdicts(claims).to_dict() == stored.to_dict()


def test_a_picture_with_another_mark_is_another_picture():
    svg = (ROOT / "studies" / "dose" / "figure.svg").read_bytes()
    assert draw_the_same(svg, svg)
    moved = re.sub(rb'x="(\d+)\.', lambda found: b'x="%d.' % (int(found[1]) + 1), svg, count=1)
    assert moved != svg
    assert not draw_the_same(svg, moved)
    assert not draw_the_same(svg, svg.replace(b"<use", b"<g", 1))
