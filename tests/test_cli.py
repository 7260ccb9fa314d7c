"""The command line as a user meets it."""

import io
import json
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from coartic import __version__
from coartic.analysis.report import analyses
from coartic.benchmarks import conformance, executors
from coartic.benchmarks.conformance import Law
from coartic.benchmarks.store import Store
from coartic.files import LISTING
from coartic.record import run_seeds
from tests.support import commands
from tests.support.commands import call
from tests.support.packs import packs_of, records_of
from tests.support.suites import BROKEN, ROOT, InProcess

from .attacks.inputs import GOOD


def test_run_paper(monkeypatch, capsys, tmp_path):
    out = tmp_path / "results"
    command = ("run", "paper", "--out", out, "--runs", 2, "--trials", 60, "--jobs", 1)
    code, text, error = call(monkeypatch, capsys, *command)
    assert code == 0
    assert {path.name for path in out.iterdir()} == {
        LISTING,
        "records",
        "runs.parquet",
        "solutions.parquet",
        "paths.parquet",
        "learning.parquet",
        "sequences.parquet",
        "manifest.json",
        "comparison.md",
        "methods.csv",
    }
    page = (out / "comparison.md").read_text(encoding="utf-8")
    for words in ("| −303 | 2.9 | 20 |", "| −319 | −319 |", "*Reconstructed.*", "LRLR −532"):
        assert words in page
    assert "*Trials.* The paper's runs have 10000 trials" in page  # here 60
    assert "−303 ± 2.9" in text
    assert "14 runs: 0 were there, 14 done in" in text
    assert "0 failed" in text
    assert "14 of 14 runs, 0 failed" in error  # plain lines without a terminal
    manifest = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["environment"]["packages"]["numba"]
    assert manifest["environment"]["command"][1:3] == ["run", "paper"]
    # The same command again has nothing to do and changes no table.
    monkeypatch.setattr(executors, "Local", InProcess)
    tables = {path: path.read_bytes() for path in out.glob("*.parquet")}
    code, text, error = call(monkeypatch, capsys, *command)
    assert code == 0
    assert "14 runs: 14 were there, 0 done in" in text
    assert "already there: 14 of 14 runs" in error
    assert tables == {path: path.read_bytes() for path in out.glob("*.parquet")}
    # A larger one does what is missing; a damaged record is reported and done again.
    (pack, *_) = packs_of(out)
    pack.write_bytes(pack.read_bytes()[:-20])
    code, text, error = call(
        monkeypatch, capsys, "run", "paper", "--out", out, "--runs", 3, "--trials", 60
    )
    assert code == 0
    assert "21 runs: 13 were there, 8 done in" in text
    assert f"{pack}: a line of it is damaged" in error
    assert len(pd.read_parquet(out / "runs.parquet")) == 21


def test_run_own_task(monkeypatch, capsys, tmp_path, in_this_process):
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


def test_seed_and_jobs_reach_the_runs(monkeypatch, capsys, tmp_path):
    asked = []

    class Watched(InProcess):
        def __init__(self, jobs):
            asked.append(jobs)

    monkeypatch.setattr(executors, "Local", Watched)
    command = ("run", "paper", "--tasks", "ascending", "--runs", 2, "--trials", 40)
    for seed in (0, 5):
        call(
            monkeypatch,
            capsys,
            *command,
            "--seed",
            seed,
            "--jobs",
            3,
            "--out",
            tmp_path / f"{seed}",
        )
    first, second = (pd.read_parquet(tmp_path / f"{seed}" / "runs.parquet") for seed in (0, 5))
    assert asked == [3, 3]
    assert list(first.seed) == run_seeds(0, "ascending", 2)
    assert list(second.seed) == run_seeds(5, "ascending", 2)


def test_the_commit_is_recorded(monkeypatch, capsys, tmp_path, in_this_process):
    git = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    head = subprocess.run(git, capture_output=True, text=True)
    call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 1, "--trials", 1,
        "--out", tmp_path / "out",
    )  # fmt: skip
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text(encoding="utf-8"))
    commit = manifest["environment"]["commit"]
    if head.returncode == 0:
        assert commit["id"] == head.stdout.strip()
    else:
        assert commit is None


def test_a_run_writes_over_nothing_of_the_users(monkeypatch, capsys, tmp_path, in_this_process):
    command = (
        "run",
        "paper",
        "--tasks",
        "ascending",
        "--runs",
        1,
        "--trials",
        1,
        "--out",
        tmp_path,
    )
    for name in ("manifest.json", "runs.parquet", "comparison.md"):
        (tmp_path / name).write_text("mine")
        code, _, error = call(monkeypatch, capsys, *command)
        assert code == 2
        assert f"holds {name}, not listed there" in error
        assert not (tmp_path / "records").exists()  # before any run
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).unlink()
    assert call(monkeypatch, capsys, *command, "--seed", 2**63 - 1)[0] == 0
    (tmp_path / "runs.parquet").write_bytes(b"damaged")
    assert call(monkeypatch, capsys, *command, "--seed", 2**63 - 1)[0] == 0  # made anew


def test_crashed_runs_make_the_exit_code(monkeypatch, capsys, tmp_path):
    code, text, _ = call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--methods", "test/dies",
        "--method-file", BROKEN, "--runs", 1, "--jobs", 1, "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 1
    assert "ascending: 1 run is crashed (the worker process ended" in text
    assert "1 failed" in text


@pytest.mark.usefixtures("one_by_one")
def test_an_interrupt_that_gets_lost_is_raised_again(monkeypatch, capsys, tmp_path):
    """What a signal raises in a destructor, Python drops; the run that was done is kept."""

    class Fragile:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    class Interrupted(InProcess):
        def perform(self, jobs):
            for answer in super().perform(jobs):
                Fragile()
                yield answer

    dropped = []
    monkeypatch.setattr(executors, "Local", lambda jobs: Interrupted())
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: dropped.append(lost.exc_type))
    before = signal.getsignal(signal.SIGINT)
    code, _, error = call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 3, "--trials", 2,
        "--out", tmp_path,
    )  # fmt: skip
    assert dropped == [KeyboardInterrupt]
    assert code == 130
    assert f"interrupted; 1 run done now is kept in {tmp_path}" in error
    assert len(records_of(tmp_path)) == 1
    assert signal.getsignal(signal.SIGINT) is before


def test_in_the_background_ctrl_c_stays_ignored(monkeypatch, capsys, tmp_path):
    """As `nohup` and `&` in a script leave it: it is meant for somebody else."""

    class Interrupted(InProcess):
        def perform(self, jobs):
            for answer in super().perform(jobs):
                signal.raise_signal(signal.SIGINT)
                yield answer

    monkeypatch.setattr(executors, "Local", lambda jobs: Interrupted())
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        code, text, _ = call(
            monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 2,
            "--trials", 2, "--out", tmp_path,
        )  # fmt: skip
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == 0
    assert "2 done in" in text


def test_trial_budget(monkeypatch, capsys, tmp_path, in_this_process):
    code, _, _ = call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 1,
        "--trial-budget", 12, "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    assert list(pd.read_parquet(tmp_path / "out" / "runs.parquet").trials) == [12]


def test_check(monkeypatch, capsys):
    """Of a task file, and what is said of a law that does not hold."""
    shipped = ROOT / "coartic" / "tasks" / "1-ascending.toml"
    code, text, _ = call(monkeypatch, capsys, "check", shipped)
    assert code == 0
    assert re.search(r"(\d) of \1 laws hold", text)
    assert "FAIL" not in text
    asked = []

    def check_method(entry):
        asked.append(entry.declared.name)
        return [Law("limits", True, "kept"), Law("information", False, "it used 'Jacobian'")]

    monkeypatch.setattr(conformance, "check_method", check_method)
    code, text, _ = call(monkeypatch, capsys, "check", "test/peeks", "--method-file", BROKEN)
    assert code == 1
    assert asked == ["test/peeks"]
    assert text.splitlines() == [
        "pass  limits: kept", "FAIL  information: it used 'Jacobian'", "",
        "test/peeks: 1 of 2 laws hold.",
    ]  # fmt: skip
    asked.clear()
    _, text, _ = call(monkeypatch, capsys, "check", "EC4")
    assert asked == ["dual-process/EC4"]
    _, text, _ = call(monkeypatch, capsys, "check", "cma-es/*")
    assert asked == ["dual-process/EC4", "cma-es/bandit", "cma-es/every"]
    assert text.splitlines()[2:6] == [
        "", "cma-es/bandit: 1 of 2 laws hold.", "", "pass  limits: kept",
    ]  # fmt: skip
    code, _, said = call(monkeypatch, capsys, "check", "ascending")
    assert code == 2
    assert said.endswith("A task is checked by its file.\n")


def test_show_and_reproduce(monkeypatch, capsys, tmp_path, in_this_process):
    call(
        monkeypatch, capsys, "run", "paper", "--tasks", "ascending", "--runs", 2,
        "--trials", 50, "--out", tmp_path / "out",
    )  # fmt: skip
    first, second = pd.read_parquet(tmp_path / "out" / "runs.parquet").run_id
    code, text, _ = call(monkeypatch, capsys, "show", first, "--in", tmp_path)
    assert code == 0
    shown = json.loads(text.partition("\nReproduce it with")[0])
    assert shown["specification"]["task"]["name"] == "ascending"
    assert shown["environment"]["commit"] is None or shown["environment"]["commit"]["id"]
    code, text, _ = call(monkeypatch, capsys, "reproduce", first, "--in", tmp_path)
    assert (code, text) == (
        0,
        f"{first} (dual-process/EC1 on ascending, run 0): identical.\n",
    )
    # A record that agrees with itself and says something else than the code gives.
    store = Store(tmp_path / "out")
    record = store.read(second)
    worst = min(range(1, 50), key=record.rewards.__getitem__)
    rewards = list(record.rewards)
    rewards[worst] -= 1
    spent = replace(record.meter, movement_ticks=record.meter.movement_ticks + 1)
    store.write([record.model_copy(update={"rewards": tuple(rewards), "meter": spent})])
    code, text, _ = call(monkeypatch, capsys, "reproduce", second, "--in", tmp_path)
    assert code == 1
    assert "different." in text
    assert f"- movement_ticks: {spent.movement_ticks} against" in text
    assert f"- rewards by trial differ, first at trial {worst}" in text
    # One that contradicts itself, with a checksum that fits.
    solution = record.solution.model_copy(update={"reward": record.solution.reward + 1})
    store.write([record.model_copy(update={"solution": solution})])
    for command in ("show", "reproduce"):
        code, _, error = call(monkeypatch, capsys, command, second, "--in", tmp_path)
        assert code == 2
        assert f"run {second} contradicts itself" in error
    code, _, error = call(monkeypatch, capsys, "show", "", "--in", tmp_path)
    assert code == 2
    assert "is no run id" in error
    assert "the beginning is enough" in error


def test_short_names_of_conditions(monkeypatch, capsys, tmp_path, in_this_process):
    code, _, _ = call(
        monkeypatch, capsys, "run", "paper", "--methods", "EC4", "--tasks", "two-armed-2",
        "--runs", 1, "--trials", 3, "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    assert list(pd.read_parquet(tmp_path / "out" / "runs.parquet").method) == ["dual-process/EC4"]


def test_a_terminal_without_the_signs(monkeypatch, capsys):
    shown = io.BytesIO()
    with io.TextIOWrapper(shown, encoding="ascii", write_through=True) as terminal:
        monkeypatch.setattr(sys, "stdout", terminal)
        assert call(monkeypatch, capsys, "list")[0] == 0
        assert b"ascending" in shown.getvalue()
        assert b"?" in shown.getvalue()


def test_list(monkeypatch, capsys):
    code, text, _ = call(monkeypatch, capsys, "list")
    assert code == 0
    for name in ("ascending", "two-armed-2", "dual-process/EC4", "paper"):
        assert name in text
    monkeypatch.setenv("COLUMNS", "80")
    narrow = call(monkeypatch, capsys, "list")[1].splitlines()
    assert max(map(len, map(str.rstrip, narrow))) <= 80
    assert "dual-process/EC4" in narrow
    assert "    told: corrective process, reward by trial" in map(str.rstrip, narrow)


def test_draw(monkeypatch, capsys, tmp_path):
    no_formula = 'title = "$x^$"\n'  # titles are text
    (tmp_path / "mine.toml").write_text(no_formula + GOOD, encoding="utf-8")
    one = ("draw", "--tasks", "ascending")
    for name in ("one.PNG", "one.svg", "one.pdf"):
        assert call(monkeypatch, capsys, *one, "--out", tmp_path / name)[0] == 0
        assert (tmp_path / name).stat().st_size > 5000
    own = tmp_path / "own.svg"
    code, text, _ = call(
        monkeypatch, capsys, "draw", "--task-file", tmp_path / "mine.toml", "--out", own
    )
    assert code == 0
    assert text.startswith("mine drawn in")
    before = own.read_bytes()
    code, _, error = call(monkeypatch, capsys, *one, "--out", own)
    assert (code, own.read_bytes()) == (2, before)
    assert f"{own} is there already; add --replace to write over it" in error
    assert call(monkeypatch, capsys, *one, "--out", own, "--replace")[0] == 0
    assert own.read_bytes() == (tmp_path / "one.svg").read_bytes() != before


def test_the_readme_picture_is_what_the_project_draws(monkeypatch, capsys, tmp_path):
    call(monkeypatch, capsys, "draw", "--out", tmp_path / "tasks.svg")
    assert (tmp_path / "tasks.svg").read_bytes() == (ROOT / "docs" / "tasks.svg").read_bytes()


def test_the_moving_picture_is_what_the_project_draws(
    monkeypatch, capsys, tmp_path, in_this_process
):
    """docs/race.svg, of the first run of condition 4 on two-armed task 1."""
    monkeypatch.chdir(tmp_path)
    run = ("run", "paper", "--tasks", "two-armed-1", "--methods", "EC4", "--runs", 1)
    call(monkeypatch, capsys, *run, "--out", "results")
    (id_,) = pd.read_parquet("results/runs.parquet").run_id
    call(monkeypatch, capsys, "animate", id_, "--in", "results", "--initial", "--out", "race.svg")
    assert Path("race.svg").read_bytes() == (ROOT / "docs" / "race.svg").read_bytes()


def test_entry_points():
    """The installed script and ``python -m coartic``, in processes of their own."""
    for command in (
        [str(Path(sys.executable).parent / "coartic"), "--version"],
        [sys.executable, "-m", "coartic", "--version"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout == f"coartic {__version__}\n"


def test_analyse(monkeypatch, capsys, tmp_path, in_this_process):
    out = tmp_path / "results"
    chosen = ("--tasks", "ascending,two-armed-2", "--runs", 3, "--trials", 40)
    assert call(monkeypatch, capsys, "run", "paper", "--out", out, *chosen)[0] == 0
    code, text, _ = call(monkeypatch, capsys, "analyse", out)
    assert code == 0
    names = text.splitlines()[-1].removesuffix(".").partition(": ")[2].split(", ")
    assert {"claims.md", "comparisons.md", "comparisons.csv", "profiles.csv"} <= set(names)
    written = {name: (out / name).read_bytes() for name in names}
    assert len(pd.read_csv(out / "comparisons.csv")) == 1  # EC4 against EC3
    assert set(pd.read_csv(out / "profiles.csv").method) == {
        "dual-process (EC1, EC3)",
        "dual-process (EC1, EC4)",
    }
    assert call(monkeypatch, capsys, "analyse", out)[0] == 0  # over what it wrote itself
    assert written == {name: (out / name).read_bytes() for name in names}
    (out / "claims.md").write_text("annotated")
    monkeypatch.setattr(analyses, "analyse", lambda study: written)
    (out / LISTING).rename(tmp_path / "listing")  # as in a folder of an older version
    code, _, error = call(monkeypatch, capsys, "analyse", out)
    assert code == 2
    assert "holds claims.md, not listed there as written by `coartic analyse`" in error
    (tmp_path / "listing").rename(out / LISTING)
    code, _, error = call(monkeypatch, capsys, "analyse", out)
    assert code == 2
    assert "holds claims.md, changed since `coartic analyse` wrote it; move it away" in error
    assert (out / "claims.md").read_text() == "annotated"
    code, _, error = call(monkeypatch, capsys, "analyse", tmp_path)
    assert code == 2
    assert "not a results folder" in error


def completed(monkeypatch, capsys, *words):
    """What a shell offers for the last of these words."""
    monkeypatch.setenv("_COARTIC_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(["coartic", *words]))
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    code, text, _ = call(monkeypatch, capsys)
    assert code == 0
    return text.split()


def test_completion(monkeypatch, capsys):
    assert completed(monkeypatch, capsys, "r") == [
        "run", "reproduce", "report", "readings", "reconstruct", "robustness",
    ]  # fmt: skip
    assert completed(monkeypatch, capsys, "run", "p") == ["paper"]
    assert completed(monkeypatch, capsys, "run", "paper", "--tr") == ["--trials", "--trial-budget"]
    command = ("run", "paper", "--out", "x")
    offered = completed(monkeypatch, capsys, *command, "--tasks", "ascending,d")
    assert offered == ["ascending,descending"]
    offered = completed(monkeypatch, capsys, *command, "--methods", "EC")
    assert {"EC1", "EC4"} <= set(offered)
    offered = completed(monkeypatch, capsys, *command, "--methods", "corr")
    assert offered[0].startswith("corrective-alone/")


def test_completion_is_offered_where_the_shell_is_not_known(monkeypatch, capsys):
    code, text, _ = call(monkeypatch, capsys, "--show-completion")
    assert code in (0, 1)  # by the shell around the tests
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    monkeypatch.setattr(commands, "ready", lambda: commands.APP)  # it looks when put together
    code, text, error = call(monkeypatch, capsys, "--show-completion", "zsh")
    assert (code, error) == (0, "")
    assert "_COARTIC_COMPLETE=complete_zsh" in text
