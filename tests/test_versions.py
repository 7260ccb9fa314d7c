"""Two results folders against each other, on runs of our own and on planted differences."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest

from analysis.inference.equivalence import MARGIN
from analysis.versions import cells_frame, compare_versions, load_pair
from benchmarks.methods import registry
from benchmarks.suites import Cell
from coartic import CoarticError, load_task

from .test_cli import call
from .test_harness import run_and_write

RUNS = 6
RUN = ["task", "method", "variant", "seed"]
KNOWN = registry()
CELLS = [
    Cell(load_task("ascending"), KNOWN["dual-process/EC1"]),
    Cell(load_task("two-armed-2"), KNOWN["dual-process/EC3"]),
    Cell(load_task("ascending"), KNOWN["corrective-alone/given"]),
]
LEARNED = "dual-process/EC1"


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first")
    run_and_write(folder, CELLS, runs=RUNS, trials=40)
    return folder


def planted(first, folder, edit=lambda runs: runs, manifest=lambda content: None):
    """A copy of ``first`` with other runs, movements that fit them, and another manifest."""
    shutil.copytree(first, folder, ignore=shutil.ignore_patterns("records"))
    path = folder / "runs.parquet"
    runs = edit(pd.read_parquet(path, dtype_backend="numpy_nullable"))
    runs.to_parquet(path)
    old = pd.read_parquet(first / "runs.parquet", columns=[*RUN, "run_id", "reward"])
    _fit(folder / "solutions.parquet", runs.merge(old, on=RUN, suffixes=("", "_old")))
    content = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest(content)
    (folder / "manifest.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


def _fit(path, runs):
    """Movements with the ids and hands of the runs; the first takes up what the reward gained."""
    moves = pd.read_parquet(path)
    run = moves.run_id.map(dict(zip(runs.run_id_old, runs.index, strict=True)))
    run = run[run.isin(runs.index[runs.status == "ok"])].astype(int)
    moves, run = moves.loc[run.index], runs.loc[run]
    gained = (run.reward - run.reward_old).to_numpy(dtype=int)
    letters = [hands[goal - 1] for hands, goal in zip(run.hands, moves.goal, strict=True)]
    moves.assign(
        run_id=list(run.run_id),
        ticks=moves.ticks - gained * (moves.order == 0),
        hand=["left" if letter == "L" else "right" for letter in letters],
    ).to_parquet(path)


def of(runs, method=LEARNED):
    return runs.method == method


def shifted(by, method=LEARNED):
    """Edits the rewards of a method's runs by a list of numbers, in the order of the runs."""

    def edit(runs):
        runs.loc[of(runs, method), "reward"] += np.array(by)
        return runs

    return edit


def found(first, second, method=LEARNED):
    frame = compare_versions(*load_pair(first, second)).cells
    return frame.set_index("method").loc[method]


def test_the_same_runs_made_twice_are_identical(first, tmp_path):
    run_and_write(tmp_path / "again", CELLS, runs=RUNS, trials=40)
    comparison = compare_versions(*load_pair(first, tmp_path / "again"))
    cells = comparison.cells
    assert list(cells.method) == [LEARNED, "dual-process/EC3", "corrective-alone/given"]
    assert set(cells.verdict) == {"identical"}
    assert list(cells.identical) == list(cells.n_a) == [RUNS, RUNS, 1]
    assert (cells.difference == 0).all()
    assert cells.p.isna().all()
    assert cells.p_adjusted.isna().all()
    assert not comparison.differing.rows
    assert comparison.summary == ["3 cells in both: 3 identical in every run."]
    assert "6 of 6" in comparison.to_markdown()
    assert comparison.to_markdown() == compare_versions(*load_pair(
        first, tmp_path / "again"
    )).to_markdown()  # fmt: skip


def test_planted_differences_come_back_in_pairs(first, tmp_path):
    """The order of rows is none of the seeds' business."""
    by = [-20, -21, -22, -20, -23, -21]
    second = planted(
        first, tmp_path / "b", lambda runs: shifted(by)(runs).iloc[::-1].reset_index(drop=True)
    )
    row = found(first, second)
    assert row.paired
    assert row.identical == 0
    assert row.difference == pytest.approx(np.mean(by))
    assert -23 < row.low < np.mean(by) < row.high < -20
    assert row.margin == pytest.approx(MARGIN * -row.mean_a)
    assert row.verdict == "different"
    assert row.p < 0.01
    assert row.p_adjusted == row.p  # the one cell that is tested
    assert found(first, second, "dual-process/EC3").verdict == "identical"


def test_holm_over_all_cells_tested(first, tmp_path):
    def edit(runs):
        runs = shifted([-5, -1, 2, 3, -4, 1])(runs)
        return shifted([-9, -7, -8, -9, -7, -6], "dual-process/EC3")(runs)

    cells = compare_versions(*load_pair(first, planted(first, tmp_path / "b", edit))).cells
    low, high = sorted(cells.p.dropna())
    assert sorted(cells.p_adjusted.dropna()) == [2 * low, max(2 * low, high)]


def test_a_difference_within_the_margin_is_equivalent(first, tmp_path):
    row = found(first, planted(first, tmp_path / "b", shifted([-1, 1, 0, -1, 2, -2])))
    assert row.verdict == "equivalent"
    assert row.identical == 1
    # One run of six: the studentised bootstrap has no end there.
    row = found(first, planted(first, tmp_path / "c", shifted([0, 0, 0, 1, 0, 0])))
    assert row.verdict == "equivalent"
    assert row.identical == 5
    row = found(first, planted(first, tmp_path / "d", shifted([0, 0, 0, 60, 0, 0])))
    assert row.verdict == "undecided"


def test_other_hands_are_not_identical(first, tmp_path):
    def edit(runs):
        runs.loc[runs.index[of(runs, "dual-process/EC3")][2], "hands"] = "LLLL"
        return runs

    row = found(first, planted(first, tmp_path / "b", edit), "dual-process/EC3")
    assert (row.identical, row.shared, row.difference) == (RUNS - 1, RUNS, 0)
    assert row.verdict == "equivalent"


def test_without_shared_seeds_runs_are_independent(first, tmp_path):
    second = tmp_path / "seed"
    run_and_write(second, CELLS, runs=RUNS + 2, trials=40, seed=1)
    comparison = compare_versions(*load_pair(first, second))
    row = comparison.cells.set_index("method").loc[LEARNED]
    assert not row.paired
    assert (row.n_a, row.n_b, row.shared) == (RUNS, RUNS + 2, 0)
    assert row.difference == pytest.approx(row.mean_b - row.mean_a)
    assert "no seed shared" in comparison.to_markdown()
    assert ("seed", "0", "1") in comparison.differing.rows
    assert ("runs", "6", "8") in comparison.differing.rows
    alone = comparison.cells.set_index("method").loc["corrective-alone/given"]
    assert alone.verdict == "no interval"  # one run each, by other seeds


def test_one_run_that_differs_has_no_interval(first, tmp_path):
    second = planted(first, tmp_path / "b", shifted([-3], "corrective-alone/given"))
    row = found(first, second, "corrective-alone/given")
    assert row.difference == -3
    assert row.verdict == "no interval"
    assert np.isnan(row.low)
    assert np.isnan(row.p)


def test_failures_are_counted_and_nothing_compared(first, tmp_path):
    def edit(runs):
        row = runs.index[of(runs)][1]
        runs.loc[row, ["status", "reason"]] = ["timeout", "too long"]
        runs.loc[row, ["reward", "hands"]] = pd.NA
        return runs

    failing = planted(first, tmp_path / "b", edit)
    row = found(first, failing)
    assert (row.solved_a, row.solved_b, row.n_b, row.identical) == (RUNS, RUNS - 1, RUNS, RUNS - 1)
    assert row.verdict == "not compared"
    assert row[["mean_a", "mean_b", "difference", "low", "p", "solve_s_b"]].isna().all()
    assert "B solved 5 of 6" in row.remarks
    assert "A solved" not in row.remarks
    both = found(failing, planted(failing, tmp_path / "c"))
    assert both.identical == RUNS  # two missing rewards are the same result
    assert both.verdict == "not compared"


def test_tasks_of_one_name_and_other_content(first, tmp_path):
    def move(content):
        content["specification"]["tasks"]["ascending"]["goals"][1] = [6.5, 2.0]

    def rename(content):
        content["specification"]["tasks"]["ascending"]["description"] = "another text"

    second = planted(first, tmp_path / "moved", manifest=move)
    comparison = compare_versions(*load_pair(first, second))
    rows = comparison.cells.set_index("method")
    assert list(rows.verdict) == ["not compared", "identical", "not compared"]
    assert rows.remarks[LEARNED] == "the tasks of this name differ: goals"
    assert rows.identical[LEARNED] == 0
    (line,) = comparison.differing.rows
    assert line[0] == "task ascending"
    assert "6.5" not in line[1]
    assert "6.5" in line[2]
    same = planted(first, tmp_path / "renamed", manifest=rename)
    assert found(first, same).verdict == "identical"


def recoded(first, folder, rows):
    """Runs with other code, as another version would have made them."""

    def edit(runs):
        chosen = runs.index[of(runs)][rows]
        runs.loc[chosen, "code"] = "c0ffeec0ffee"
        runs.loc[chosen, "run_id"] = runs.loc[chosen, "run_id"].str[:17] + "c0ffeec0ffee"
        return runs

    def manifest(content):
        specification = content["specification"]
        specification["run_ids"] = list(pd.read_parquet(folder / "runs.parquet").run_id)
        specification["methods"][LEARNED]["code"] = "c0ffeec0ffee"

    return planted(first, folder, edit, manifest)


def test_other_code_is_said_and_never_mixed(first, tmp_path):
    other = recoded(first, tmp_path / "other", slice(None))
    comparison = compare_versions(*load_pair(first, other))
    row = comparison.cells.set_index("method").loc[LEARNED]
    assert (row.verdict, row.remarks) == ("identical", "other code")
    assert [line[0] for line in comparison.differing.rows] == [f"code of {LEARNED}"]
    mixed = recoded(first, tmp_path / "mixed", slice(2))
    with pytest.raises(CoarticError, match=r"mixed/runs.*\(4 rows are of other code than"):
        load_pair(first, mixed)
    with pytest.raises(CoarticError, match="short.*lacks 1 of 13 planned runs"):
        load_pair(planted(first, tmp_path / "short", lambda runs: runs[1:]), first)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("reward", lambda runs: runs.reward + 50, "do not add up to their reward"),
        ("hands", "LLL", "are not made with the hands of a solved run"),
        ("status", "timeout", "are not made with the hands of a solved run"),
        ("code", "c0ffeec0ffee", "6 rows are of other code than manifest.json declares"),
        ("code", pd.NA, "6 rows are of other code than manifest.json declares"),
    ],
)
def test_one_gate_for_every_command(first, tmp_path, monkeypatch, capsys, column, value, words):
    """A table edited by hand is refused by whatever reads the folder."""
    edited = shutil.copytree(first, tmp_path / "edited", ignore=shutil.ignore_patterns("records"))
    runs = pd.read_parquet(edited / "runs.parquet", dtype_backend="numpy_nullable")
    runs.loc[of(runs), column] = value(runs) if callable(value) else value
    runs.to_parquet(edited / "runs.parquet")
    for command in (("compare", first), ("analyse",), ("report",), ("cite",)):
        code, _, error = call(monkeypatch, capsys, *command, edited)
        assert code == 2
        assert words in error


def test_what_differs_in_the_environment(first, tmp_path):
    def edit(model, numpy):
        return lambda content: content["environment"].update(
            model_code=model, packages={"numpy": numpy}, date=model
        )

    one = planted(first, tmp_path / "one", manifest=edit("aaaa", "2.4.6"))
    two = planted(first, tmp_path / "two", manifest=edit("bbbb", "2.4.7"))
    assert compare_versions(*load_pair(one, two)).differing.rows == (
        ("code of the model", "aaaa", "bbbb"),
        ("library numpy", "2.4.6", "2.4.7"),
    )


def test_stale_records_are_counted(first, tmp_path):
    second = tmp_path / "b"
    shutil.copytree(first, second)
    record = next(second.glob("records/*.json"))
    shutil.copy(record, record.with_name(f"{record.stem[:17]}c0ffeec0ffee.json"))
    page = compare_versions(*load_pair(first, second)).to_markdown()
    assert "B: 1 records were made by other code and have no part here" in page
    assert "A: 1 records" not in page


def test_parameters_cells_and_spends(first, tmp_path):
    second = tmp_path / "b"
    cells = [CELLS[0], Cell(load_task("ascending"), KNOWN[LEARNED], (("noise_sd", 0.1),))]
    run_and_write(second, cells, runs=RUNS, trials=80)
    comparison = compare_versions(*load_pair(first, second))
    (row,) = comparison.cells.to_dict("records")
    assert row["remarks"] == "trials 40 → 80"
    assert (row["trials_a"], row["trials_b"]) == (40, 80)
    assert row["paired"]
    assert comparison.only == (
        {"dual-process/EC3": ["two-armed-2"], "corrective-alone/given": ["ascending"]},
        {f"{LEARNED} noise_sd=0.1": ["ascending"]},
    )
    assert comparison.summary[1:] == ["2 cells only in A.", "1 cells only in B."]
    assert comparison.table.rows[0][8] == "2"  # twice the trials
    page = comparison.to_markdown()
    assert "## Cells only in A\n\n- dual-process/EC3: two-armed-2\n" in page
    assert ("methods of one folder only", "dual-process/EC3, corrective-alone/given", "–") in (
        comparison.differing.rows
    )
    nothing = compare_versions(
        *load_pair(first, planted(second, tmp_path / "c", manifest=_without_first))
    )
    assert nothing.summary[0] == "0 cells in both: nothing to compare."
    assert cells_frame(*load_pair(first, tmp_path / "c")).empty


def _without_first(content):
    del content["specification"]["cells"][0]


def test_folders_that_cannot_be_compared(first, tmp_path):
    link = tmp_path / "link"
    link.symlink_to(first)
    for same in (first, link, first / ".." / first.name):
        with pytest.raises(CoarticError, match="are one folder"):
            load_pair(first, same)
    empty = tmp_path / "empty"
    empty.mkdir()
    for missing, words in (
        (tmp_path / "nowhere", "nowhere does not exist; name a folder"),
        (empty, "is not a results folder: .*manifest.json is missing"),
        (first / "runs.parquet", "is a file, not a results folder"),
    ):
        with pytest.raises(CoarticError, match=words):
            load_pair(first, missing)
    old = planted(first, tmp_path / "old", manifest=lambda content: content.update(format=2))
    with pytest.raises(CoarticError, match="have format 2, this version reads 3; run the same"):
        load_pair(first, old)
    damaged = planted(first, tmp_path / "damaged")
    (damaged / "runs.parquet").write_bytes((first / "runs.parquet").read_bytes()[:200])
    with pytest.raises(CoarticError, match="runs.parquet is damaged"):
        load_pair(damaged, first)


def test_command(first, tmp_path, monkeypatch, capsys):
    second = planted(first, tmp_path / "b", shifted([-20, -21, -22, -20, -23, -21]))
    page = tmp_path / "page.md"
    code, text, _ = call(monkeypatch, capsys, "compare", first, second, "--out", page)
    assert code == 0
    assert "3 cells in both: 2 identical in every run, 1 different." in text
    assert page.read_text(encoding="utf-8").startswith("# Two sets of results")
    table = pd.read_csv(tmp_path / "page.csv")
    assert list(table.verdict) == ["different", "identical", "identical"]
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    (tmp_path / "page.csv").write_text("of somebody else's")
    page.unlink()
    code, _, error = call(monkeypatch, capsys, "compare", first, second, "--out", page)
    assert (code, page.exists()) == (2, False)
    assert f"{tmp_path / 'page.csv'} is there already; add --replace" in error
    assert (tmp_path / "page.csv").read_text() == "of somebody else's"
    call(monkeypatch, capsys, "compare", first, second, "--out", page, "--replace")
    assert before == {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    code, text, _ = call(monkeypatch, capsys, "compare", first, second)
    assert code == 0
    assert "In " not in text
    code, *_ = call(monkeypatch, capsys, "compare", first, second, "--csv", tmp_path / "own.csv")
    assert code == 0
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "page.csv").read_bytes()
    for arguments, words in (
        ((first, first), "are one folder"),
        ((first, tmp_path / "nowhere"), "does not exist"),
        ((first, second, "--out", "page.html"), "the name must end in .md"),
        ((first, second, "--csv", "table.txt"), "the name must end in .csv"),
        ((first, second, "--out", "/dev/null/x.md"), "cannot write /dev/null/x.md"),
        ((first, second, "--out", second / "records" / "x.md"), "is among the records"),
    ):
        code, _, error = call(monkeypatch, capsys, "compare", *arguments)
        assert code == 2
        assert words in error
