"""The command line as a user meets it."""

import json
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from coartic import __version__, cli

from .test_task import BAD, GOOD

ROOT = Path(__file__).parent.parent


def call(monkeypatch, capsys, *arguments):
    """Exit code, standard output, standard error."""
    monkeypatch.setattr(sys, "argv", ["coartic", *map(str, arguments)])
    try:
        cli.main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_run_paper(monkeypatch, capsys, tmp_path):
    out = tmp_path / "results"
    code, text, _ = call(
        monkeypatch, capsys, "run", "paper", "--out", out, "--runs", 2, "--trials", 60
    )
    assert code == 0
    assert {path.name for path in out.iterdir()} == {
        "runs.parquet",
        "solutions.parquet",
        "learning.parquet",
        "sequences.parquet",
        "manifest.json",
        "comparison.md",
    }
    page = (out / "comparison.md").read_text(encoding="utf-8")
    for words in ("-303 ± 2.9 (20)", "-319 (-319*)", "Reconstructed: goals", "LRLR -533"):
        assert words in page
    assert "-303 ± 2.9 (20)" in text
    assert "14 runs in" in text
    assert "0 failed" in text
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["environment"]["packages"]["numba"]
    assert manifest["environment"]["command"][1:3] == ["run", "paper"]
    # A second run refuses to replace the first, and does where it is told to.
    again = ("run", "paper", "--out", out, "--runs", 1, "--trials", 1, "--tasks", "ascending")
    code, _, error = call(monkeypatch, capsys, *again)
    assert code == 2
    assert "already holds results" in error
    assert len(pd.read_parquet(out / "runs.parquet")) == 14
    assert call(monkeypatch, capsys, *again, "--overwrite")[0] == 0
    assert len(pd.read_parquet(out / "runs.parquet")) == 1


def test_run_own_task(monkeypatch, capsys, tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD, encoding="utf-8")
    code, text, _ = call(
        monkeypatch, capsys, "run", "paper", "--task-file", tmp_path / "mine.toml",
        "--tasks", "mine", "--runs", 2, "--trials", 30, "--jobs", 1, "--seed", 7,
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    runs = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    assert list(runs.method) == [f"dual-process/EC{k}" for k in (1, 1, 2, 2, 3, 3, 4, 4)]
    assert set(runs.task) == {"mine"}
    assert "Reconstructed" not in text


@pytest.mark.parametrize("case", BAD)
def test_bad_task_files(case, monkeypatch, capsys, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(BAD[case][0], encoding="utf-8")
    code, out, error = call(
        monkeypatch, capsys, "run", "paper", "--task-file", path, "--out", tmp_path / "out"
    )
    assert (code, out) == (2, "")
    assert error.startswith(f"error: {path}: ")
    assert BAD[case][1] in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "papr", "--out", "x"], "did you mean 'paper'?"),
        (
            ["run", "paper", "--out", "x", "--tasks", "nope"],
            "unknown task of suite 'paper' 'nope'",
        ),
        (["run", "paper", "--out", "x", "--tasks", "ascending,"], "has an empty name"),
        (["run", "paper", "--out", "x", "--methods", "EC1"], "unknown method 'EC1'"),
        (["run", "paper", "--out", "x", "--jobs", "0"], "--jobs 0"),
        (["run", "paper", "--out", "x", "--runs", "0"], "Invalid value for '--runs'"),
        (["run", "paper", "--out", "x", "--seed", "-1"], "Invalid value for '--seed'"),
        (["run", "paper", "--out", "x", "--trials", "many"], "Invalid value for '--trials'"),
        (["run", "paper"], "Missing option"),
        (["run", "paper", "--out", "/dev/null/x"], "cannot write to /dev/null/x"),
        (["run", "paper", "--out", "x", "--task-file", "no.toml"], "no.toml: cannot be read"),
        (["draw", "--out", "x.bmp"], "the name must end in .png"),
        (["draw", "--out", "/dev/null/x.png"], "cannot write /dev/null/x.png"),
        (["draw", "--out", "x.png", "--tasks", "nope"], "unknown task 'nope'"),
        (["fly"], "No such command 'fly'"),
    ],
)
def test_usage_errors(arguments, words, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, _, error = call(monkeypatch, capsys, *arguments)
    assert code == 2
    assert words in " ".join(error.replace("│", " ").split())
    assert "Traceback" not in error
    assert list(tmp_path.iterdir()) == []


def test_crashed_runs_make_the_exit_code(monkeypatch, capsys, tmp_path):
    from benchmarks import runner

    def broken(*_, **__):
        raise FloatingPointError("planted")

    monkeypatch.setattr(runner, "learn", broken)
    code, text, _ = call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 3,
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 1
    assert (
        "3 runs of ascending x dual-process/EC1 are crashed: FloatingPointError: planted" in text
    )
    assert "3 failed" in text


def test_list(monkeypatch, capsys):
    code, text, _ = call(monkeypatch, capsys, "list")
    assert code == 0
    for name in ("ascending", "two-armed-2", "dual-process/EC4", "paper"):
        assert name in text


def test_draw(monkeypatch, capsys, tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD, encoding="utf-8")
    for name in ("all.png", "all.svg", "all.pdf"):
        assert call(monkeypatch, capsys, "draw", "--out", tmp_path / name)[0] == 0
        assert (tmp_path / name).stat().st_size > 5000
    own = tmp_path / "own.svg"
    code, text, _ = call(
        monkeypatch, capsys, "draw", "--task-file", tmp_path / "mine.toml", "--out", own
    )
    assert code == 0
    assert text.startswith("mine drawn in")


def test_the_readme_picture_is_what_the_project_draws(monkeypatch, capsys, tmp_path):
    call(monkeypatch, capsys, "draw", "--out", tmp_path / "tasks.svg")
    assert (tmp_path / "tasks.svg").read_bytes() == (ROOT / "docs" / "tasks.svg").read_bytes()


def test_entry_points():
    """The installed script and ``python -m coartic``, in processes of their own."""
    for command in (
        [str(Path(sys.executable).parent / "coartic"), "--version"],
        [sys.executable, "-m", "coartic", "--version"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout == f"coartic {__version__}\n"
