"""The command line as a user meets it."""

import io
import math
import os
import re
import signal
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from coartic import CoarticError, load_task
from coartic.analysis.report import build
from coartic.analysis.study import load
from coartic.benchmarks import pool, template
from coartic.benchmarks.runner import Progress
from coartic.cli import COMMANDS, read
from coartic.cli.terminal import Display, say
from coartic.gym import TaskEnv
from coartic.pictures import film
from coartic.runs.store import lock
from coartic.tasks.task import TASK_FOLDER
from tests.support.bad_inputs import GOOD
from tests.support.processes import comes, folders_of_session, python
from tests.support.strategies import metres_task, tiny_task
from tests.support.suites import (
    KNOWN,
    ROOT,
    Failing,
    cell_on,
    edit,
    edit_movement,
    paper_cells,
    run_and_write,
)

TASK_FILE = TASK_FOLDER / "1-ascending.toml"
NEAR = GOOD.replace("[5.0, 1.0], [5.0, 2.0]", "[4.7, 0.1], [4.8, 0.1]")
"""A task of few ticks, whose film is short."""
SMALL = ("run", "paper", "--tasks", "ascending", "--runs", 2, "--trials", 40)


@pytest.mark.usefixtures("ranked")
def test_run_resumes(coartic, tmp_path):
    out = tmp_path / "my results"
    code, text, error = coartic(*SMALL, "--out", out)
    assert code == 0
    assert f"coartic report '{out}'" in " ".join(text.split())
    assert text.startswith("2 runs in ")
    assert max(map(len, text.splitlines())) <= max(80, len(str(out)) + 40)
    assert "Runs: 2/2\n" in error  # plain lines without a terminal
    made_with = load(out).made_with
    assert made_with["packages"]["numba"]
    assert made_with["command"][1:3] == ["run", "paper"]
    assert coartic(*SMALL, "--runs", 3, "--out", out)[1].startswith("3 runs (2 reused) in ")


def test_a_folder_without_any_count_of_trials_is_printed_and_reported(
    coartic, tmp_path, monkeypatch
):
    """All workers died, of a method that makes no trials."""
    monkeypatch.setattr(pool, "Local", lambda _: Failing(0))
    alone = ("run", "paper", "--tasks", "ascending", "--methods", "corrective-alone/given")
    code, text, error = coartic(*alone, "--out", tmp_path)
    assert (code, "Traceback" in error) == (1, False)
    assert "1 failed" in text
    assert "1 × exit code 9" in text
    code, text, error = coartic("report", tmp_path)
    assert (code, "fault" in text + error) == (0, False)
    assert coartic("verify", tmp_path)[0] == 0


LEFT = {
    math.nan: "",
    3.0: "less than 10 s left",
    38.0: "about 40 s left",
    2900.0: "about 49 min left",
    20_000.0: "about 6 h left",
}


@pytest.mark.parametrize("is_terminal", [True, False])
@pytest.mark.parametrize("seconds", LEFT)
def test_how_far_a_suite_is_fits_on_a_terminal(monkeypatch, capsys, is_terminal, seconds):
    """And on a narrow one; without a terminal it is one line for each time."""
    monkeypatch.setenv("COLUMNS", "44")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    monkeypatch.setattr(Display, "EVERY_S", 0.0)
    progress = Progress(Path("results"), 63, done=18, failed=1)
    progress.time_left = SimpleNamespace(seconds=seconds)
    with Display() as display:
        display.update(progress, cell_on(load_task("two-armed-2"), KNOWN["cma-es/bandit"]))
    shown = re.sub(r"\x1b\[[^a-zA-Z]*[a-zA-Z]", "", capsys.readouterr().err)
    assert "Runs: 18/63" in shown
    lines = re.split("[\r\n]+", shown)
    assert max(map(len, lines)) <= 44
    if not is_terminal:
        assert lines == ["  ".join(filter(None, ["Runs: 18/63", "1 failed", LEFT[seconds]])), ""]


@pytest.mark.parametrize("colour", [True, False])
def test_colours_can_be_switched_off(monkeypatch, capsys, colour):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    if not colour:
        monkeypatch.setenv("NO_COLOR", "1")
    with Display() as display:
        display.show("Reading")
    assert bool(re.search(r"\x1b\[[0-9;]*3[0-9]", capsys.readouterr().err)) == colour


SLOW = """from coartic import Optimiser
class Slow(Optimiser):
    name, title, citation = "slow", "Slow", "x"
    def optimise(self, objective, rng):
        for _ in range(2):
            objective(objective.x0 + 0.01 * rng.standard_normal(objective.dim))
"""


@pytest.mark.usefixtures("in_this_process")
def test_each_long_part_of_a_command_is_said(coartic, tmp_path, monkeypatch):
    monkeypatch.setattr(Display, "EVERY_S", 0.0)
    own = tmp_path / "slow.py", tmp_path / "out"
    own[0].write_text(SLOW, encoding="utf-8")
    asked = ("--tasks", "ascending", "--methods", "slow", "--runs", 1, "--out", own[1])
    shown = coartic("run", "quick", *asked, "--method-file", own[0])[2]
    assert re.search(r"Runs: 0/1(.*\n)+Runs: 1/1(.*\n)+Runs: 1/1  1 run again, ", shown)
    shown = coartic("check", "slow", "--method-file", own[0])[2]
    assert "Performing runs of slow" in shown
    shown = coartic("verify", own[1], "--again", 1, "--method-file", own[0])[2]
    assert "Performing 1 run again" in shown


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [("ascii", "-3 ? 1 -"), ("latin-1", "-3 ± 1 -"), ("utf-8", "−3 ± 1 –")],
)
def test_a_terminal_without_a_sign_shows_one_like_it(encoding, printed):
    terminal = io.TextIOWrapper(io.BytesIO(), encoding, "replaced")
    say("−3 ± 1 –", stream=terminal)
    assert terminal.buffer.getvalue().decode(encoding) == f"{printed}{os.linesep}"


def test_a_broken_law_makes_the_exit_code_of_check(coartic, tmp_path):
    (tmp_path / "mine.toml").write_text(GOOD.replace("[5.0, 2.0]", "[5.0, 1.05]"), encoding="utf-8")
    code, text, _ = coartic("check", tmp_path / "mine.toml")
    assert (code, "FAIL" in text) == (1, True)


@pytest.mark.usefixtures("in_this_process")
def test_verify_performs_runs_again(coartic, tmp_path):
    out = tmp_path / "out"
    assert coartic(*SMALL, "--out", out)[0] == 0
    first, second = load(out).runs.run_id
    code, text, _ = coartic("verify", out, "--run", first)
    assert code == 0
    assert text.splitlines()[-1] == "1 run performed again: none with another result."
    assert re.search(rf"Run +{first}: Ascending, .*, run 0\nSeed +[0-9]+\nParam.*\nResult", text)
    assert "checked" not in text
    assert (
        "with an id that begins with '0123456789'"
        in coartic("verify", out, "--run", "0123456789")[2]
    )
    part = tmp_path / "part"  # of an array, and of all methods those for one arm
    own = ("--methods", "dual-process/*", "--runs", "2..3")
    assert coartic(*SMALL, *own, "--out", part)[0] == 0
    assert "1 run performed again: none with another" in coartic("verify", part, "--again", 1)[1]
    edit(out, "UPDATE results SET movement_ticks = movement_ticks + 1 WHERE run_id = ?", second)
    code, text, _ = coartic("verify", out, "--again", 2)
    assert (code, "2 runs performed again: 1 with another result." in text) == (1, True)
    edit_movement(out, 2, lambda movement: movement[4].reverse(), "replay")
    code, text, _ = coartic("verify", out, "--run", second)
    assert code == 1
    assert f"Run {second}, performed again: movement_ticks: " in text
    assert f"Run {second}, performed again: replay: " in text
    code, _, error = coartic("verify", out, "--run", "")
    assert code == 2
    assert "beginning of a run id" in error
    cells = [cell_on(load_task("ascending"), replace(KNOWN["dual-process/EC1"], code="other"))]
    run_and_write(tmp_path / "other", cells, runs=1, trials=3)
    out = tmp_path / "other"
    code, _, error = coartic("verify", out, "--again", 1)
    assert code == 2
    assert "no run of" in error


INTERRUPTED = """
import contextlib, os, signal, sys, tempfile, threading, time
import coartic.__main__

moment, number, times = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
sys.argv[1:] = sys.argv[4:]
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # where tests run under nohup it is ignored
signal.pthread_sigmask(signal.SIG_SETMASK, signal.valid_signals())  # as some starters do

def interrupt():
    for _ in range(times):
        os.kill(os.getpid(), number)
        time.sleep(0.05)

def clean():
    with tempfile.TemporaryDirectory(), contextlib.ExitStack() as stack:
        signals = threading.Thread(target=interrupt)
        stack.callback(signals.join)
        stack.callback(signals.start)
        interrupt()

if moment == "cleaning":  # which ends after the signals
    import coartic.cli
    coartic.cli.main = clean
else:  # milliseconds after it has begun
    threading.Timer(int(moment) / 1000, interrupt).start()
coartic.__main__.main()
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("moment", "name", "times"),
    [
        ("300", "SIGINT", 2),
        ("2500", "SIGTERM", 2),
        ("1500", "SIGHUP", 1),
        ("cleaning", "SIGINT", 3),
    ],
)
def test_an_interrupted_command_ends_with_a_sentence(tmp_path_factory, moment, name, times):
    """Of a suite that would take minutes, whatever it is doing."""
    tmp_path = tmp_path_factory.mktemp("it")  # a short name
    number = getattr(signal, name)
    command = ("run", "paper", "--runs", "500", "--trials", "30000", "--jobs", "1", "--out", "out")
    code = [sys.executable, "-c", INTERRUPTED, moment, str(int(number)), str(times), *command]
    status, words = call_apart(tmp_path, code, "temporary")
    assert status == (130 if name == "SIGINT" else 143), words
    assert words.startswith("Interrupted.")
    assert len(words.splitlines()) == 1


def call_apart(place, command, temporary):
    """Exit code and standard error of a command that leaves no process and no temporary folder."""
    (place / temporary).mkdir()
    done = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=place,
        env=os.environ | {"TMPDIR": str(place / temporary), "PYTHONPATH": str(ROOT)},
        start_new_session=True,
    )  # fmt: skip
    _, words = done.communicate()
    # Python tries a folder for temporary files with a file, which a signal can leave behind.
    assert not [path for path in (place / temporary).iterdir() if path.is_dir()]
    assert comes(lambda: not folders_of_session(done.pid))
    return done.returncode, words


@pytest.mark.usefixtures("in_this_process")
def test_what_a_folder_holds_besides_is_said_before_the_first_run(coartic, tmp_path, monkeypatch):
    out, sentences = tmp_path / "out", []
    assert coartic(*SMALL, "--out", out)[0] == 0

    def interruptible(sentence):
        sentences.append(sentence)
        return nullcontext()

    monkeypatch.setattr("coartic.cli.run.interruptible", interruptible)
    error = coartic(*SMALL, "--out", out, "--seed", 7)[2]
    assert f"{out} also has 2 runs of earlier commands" in error.partition("Runs: ")[0]
    assert f"Stored in {out}: 2 runs; " in sentences[0]()
    edit(out, "DELETE FROM results")
    assert f"Stored in {out}: 0 runs; " in sentences[0]()


@pytest.mark.usefixtures("in_this_process")
def test_a_results_folder_and_a_method_file_are_named_by_their_commands(
    coartic, tmp_path, monkeypatch
):
    """A folder may have the name of a suite, and is none."""
    monkeypatch.chdir(tmp_path)
    assert coartic(*SMALL, "--out", "paper")[0] == 0
    assert coartic(*SMALL, "--out", "out")[0] == 0
    assert coartic("new", "my-search")[0] == 0
    for command in ("check", "run"):
        assert "out is a results folder: coartic report out" in coartic(command, "out")[2]
    code, text, _ = coartic("list", "out")
    runs = load("out").runs
    assert (code, text.splitlines()[-1]) == (0, f"out: {len(runs)} runs.")
    assert all(run_id in text for run_id in runs.run_id)
    assert coartic("list", "paper")[1].startswith("Suite")
    assert coartic("list", "./paper")[1].startswith("run_id")
    for command in ("check", "list"):
        assert "add --method-file my_search.py" in coartic(command, "my-search")[2]


@pytest.mark.parametrize("name", ["class", "random", "3d/search", "numpy", "my-search"])
def test_a_new_file_can_be_imported_and_hides_no_module(coartic, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    assert coartic("new", name)[0] == 0
    (file,) = tmp_path.iterdir()
    assert file.stem.isidentifier()
    assert file.stem not in {*sys.stdlib_module_names, "numpy"}
    compile(f"import {file.stem}", "", "exec")


def test_help_has_a_short_name(coartic):
    for command in ((), ("run",), ("report",)):
        assert coartic(*command, "-h") == coartic(*command, "--help") == coartic("help", *command)


SURROUNDED = """
import os, signal, sys
signal.pthread_sigmask(signal.SIG_SETMASK, signal.valid_signals())
os.closerange(0, 3)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""


@pytest.mark.process
def test_a_command_ends_well_whatever_started_it(tmp_path):
    """With all signals blocked, and without input, output and errors, whatever a method's file
    starts. Modules that a stranger has put into the working folder are imported by no process of a
    command that is installed."""
    for name in ("coartic", "multiprocessing", "numba", "numpy", "socket", "threading"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()")
    program = tmp_path / "bin" / "program.py"
    program.parent.mkdir()
    program.write_text("from coartic.__main__ import main\nmain()")
    mine = program.with_name("mine.py")
    starts = "import subprocess\nsubprocess.Popen(['sleep', '999'])\n"
    mine.write_text(starts + Path(template.__file__).read_text())
    own = ("--methods", "NAME", "--method-file", mine, "--jobs", 1)
    command = map(str, (program, *SMALL, *own, "--out", tmp_path / "out"))
    code = [sys.executable, "-I", "-c", SURROUNDED, *command]
    assert call_apart(tmp_path, code, "long" * 30) == (0, "")  # the system takes no long socket
    assert load(tmp_path / "out").runs.status.tolist() == ["ok"] * 2
    assert not (tmp_path / "run").exists()


@pytest.mark.process
def test_what_a_method_prints_and_where_it_crashes(tmp_path):
    text = Path(template.__file__).read_text().replace("def optimise", "def unused")
    body = """
    def optimise(self, *_):
        import logging
        print("it prints")
        logging.info("it logs")
        return helper()

def helper():
    raise RuntimeError("here")
"""
    (tmp_path / "mine.py").write_text(text + body)
    own = ["NAME", "--method-file", "mine.py", "--verbose"]
    done = python("-m", "coartic", "check", *own, cwd=tmp_path, fails=True)
    place = f"mine.py, line {len((text + body).splitlines())}: RuntimeError: here"
    assert (done.returncode, place in done.stdout) == (1, True)
    for words in ("it prints", "INFO:root:it logs", "Traceback", "return helper()"):
        assert words in done.stdout + done.stderr


def test_draw(coartic, tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text('title = "$x^$"\n' + GOOD, encoding="utf-8")
    assert coartic("draw", "ascending", "--out", tmp_path / "one.pdf")[0] == 0
    assert (tmp_path / "one.pdf").stat().st_size > 5000
    monkeypatch.setattr(read, "_PICTURED", 2)
    for count, words in ((2, "2 tasks."), (3, "3 tasks; the first 2 are drawn.")):
        many = (f"long/v1/i001..i00{count}", "--out", tmp_path / f"{count}.svg")
        assert coartic("draw", *many)[1].endswith(f": {words}\n")
    assert (tmp_path / "2.svg").read_bytes() == (tmp_path / "3.svg").read_bytes()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine.toml").write_text(GOOD.replace("[5.0, 2.0]", "[5.0, 2.1]"), "utf-8")
    files = [tmp_path / "mine.toml", tmp_path / "other" / "mine.toml"]
    assert "two tasks have the name 'mine'" in coartic("draw", *files, "--out", tmp_path / "two")[2]
    assert coartic("draw", tmp_path / "mine.toml", "--out", tmp_path / "own.svg")[0] == 0


def test_a_place_that_is_taken_is_said_before_anything_is_drawn(coartic, tmp_path, monkeypatch):
    monkeypatch.setattr("coartic.analysis.figures.drawings.picture_of_tasks", None)
    monkeypatch.setattr("coartic.play.page.play_page", None)
    for command, name in (("draw", "tasks.svg"), ("play", "page.html")):
        (tmp_path / name).touch()
        status, _, said = coartic(command, "ascending", "--out", tmp_path / name)
        assert (status, "exists: add --replace" in said) == (2, True)


def test_a_folder_is_no_task_to_draw(coartic, tmp_path):
    status, _, said = coartic("draw", tmp_path)
    assert status == 2
    assert f"coartic draw {tmp_path} --run ID` films a run" in said


def test_play(coartic, tmp_path, monkeypatch):
    shown = []
    monkeypatch.setattr("webbrowser.open", lambda address: not shown.append(address))
    page = tmp_path / "page.html"
    assert coartic("play", "descending", "--out", page)[:2] == (
        0,
        f"{page}: {len(page.read_bytes()) // 1000} kB.\n",
    )
    assert shown == [page.as_uri()]
    wrong = coartic("run", "quick", "--methods", "shortest-path", "--out", tmp_path / "runs")[2]
    assert "did you mean 'shortest-path plan'" in wrong
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    assert "open it in a browser" in coartic("play", "--no-open")[1]
    assert len(shown) == 1
    assert len([*tmp_path.iterdir()]) == 2


@pytest.mark.process
def test_settings_of_matplotlib_in_a_folder_are_not_read(tmp_path):
    """They may name programs, and the folder may be a stranger's."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True")
    code = """if True:
        from coartic.cli import main
        try:
            main()
        except SystemExit:
            import matplotlib
            print(matplotlib.rcParams["text.usetex"])"""
    assert python("-c", code, "--version", cwd=tmp_path).stdout.splitlines()[-1] == "False"


@pytest.mark.parametrize(("command", "example"), COMMANDS)
def test_examples_have_options_that_there_are(commands, command, example):
    name = command.__name__.removesuffix("_")
    options = {opt for parameter in commands.commands[name].params for opt in parameter.opts}
    assert {word for word in example.split() if word.startswith("--")} <= options


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("radius", [1e-3, 1.0])
def test_a_task_of_any_radius_passes_every_door(coartic, tmp_path, radius):
    task, file, out = metres_task(radius, name="arm"), tmp_path / "arm.toml", tmp_path / "runs"
    if radius > 0.2:  # elsewhere, all goals are hit at the start
        task = tiny_task(name="arm", radius=radius, goals=[[1.0, 2.5], [-1.0, 3.0]])
    task.save(file)
    run = ("run", "comparison", "--tasks", file, "--methods", "EC1,hill-climbing", "--runs", 1)
    for command in (
        ("check", file),
        ("play", file, "--out", tmp_path / "play.html", "--no-open"),
        (*run, "--trials", 5, "--out", out),
        ("verify", out),
    ):
        assert coartic(*command)[0] == 0, command
    assert (load(out).runs.status == "ok").all()
    env = TaskEnv(task)
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[1] < 0


TAKEN = (
    "play --no-open [--out a.html]",
    "play --no-open --out a.html [--replace]",
    "list [--method-file mine.py]",
    "report out [--for-paper]",
    "report out [--out mine.py]",
    "draw out --out a.gif --width 200 [--run {run}]",
    "draw out --run {run} --width 200 [--out b.gif]",
    "draw out --run {run} --width 200 --out b.gif [--replace]",
    "draw out --run {run} --width 200 --out b.gif --replace [--initial]",
    "draw out --run {run} --width 200 --out b.gif --replace [--width 300]",
    "verify out [--again 1]",
    "verify out [--run {run}]",
    "new a-search [--out b.py]",
    "new a-search [--replace]",
    "draw ascending [--out f.svg]",
    "draw ascending --out f.svg [--replace]",
    "draw metres.toml --out j.svg [--recording hits.csv]",
    "draw metres.toml --recording hits.csv --out k.svg [--ticks-per-unit 2]",
    "cite [--analysis]",
)
"""Commands with and without what is in brackets, in this order: some write over what earlier ones
have written."""
REFUSED = (
    "play --no-open [--replace]",
    "list EC1 [--method-file mine.py]",
    "list paper [--method-file mine.py]",
    "check task.toml [--verbose]",
    "check corrective-alone/given [--method-file mine.py]",
    "verify out --run {run} [--method-file mine.py]",
    "report out [--width 3.4]",
    "report out [--against EC1]",
    "verify out --run {run} [--again 1]",
    "verify out [--method-file mine.py]",
    "verify out --again 1 [--method-file mine.py]",
    "draw ascending --out g [--replace]",
    "draw ascending --out h.svg [--initial]",
    "draw ascending --out i.svg [--width 300]",
    "draw ascending --out l.svg [--ticks-per-unit 100]",
    "draw metres.toml --recording hits.csv --out m.svg [--width 300]",
)


@pytest.mark.usefixtures("in_this_process")
def test_each_option_changes_what_a_command_does_or_is_refused(
    coartic, commands, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(film, "LONGEST", 3)  # films are short
    monkeypatch.setattr(film, "PAUSE", 1)
    monkeypatch.setattr(film, "HOLD", 1)
    monkeypatch.setattr(build, "for_page", lambda _: "")
    monkeypatch.setattr(build, "picture", lambda *_: b"")
    Path("near.toml").write_text(NEAR, "utf-8")
    near = paper_cells(tasks=["near.toml"], methods=["EC1"])
    study = run_and_write(tmp_path / "out", near, runs=1, trials=5)
    Path("mine.py").write_text(
        (ROOT / "tests" / "methods" / "nearest_hand.py").read_text("utf-8"), "utf-8"
    )
    recordings = ROOT / "docs/examples/recordings"
    Path("metres.toml").write_text((recordings / "metres.toml").read_text("utf-8"), "utf-8")
    hits = pd.read_csv(recordings / "metres.csv").head(40)
    hits.assign(duration=100 * hits.duration).to_csv("hits.csv", index=False)
    Path("task.toml").write_text(TASK_FILE.read_text("utf-8"), "utf-8")

    def call(words):
        code, text, error = coartic(*words.format(run=study.runs.run_id[0][:8]).split())
        films = [path.stat().st_size for path in Path().glob("b.gif")]
        return code, re.sub("in [0-9]+ s", "", text), error, films

    tried, once = set(), cache(call)
    for entry in (*TAKEN, *REFUSED):
        without = re.sub(r" \[.*\]", "", entry)  # these say the same each time, and take long
        is_same = without == "report out" or "--replace" in without
        said = [(once if is_same else call)(without), call(re.sub(r"[][]", "", entry))]
        assert said[0] != said[1], entry
        assert ("has no effect" in said[1][2]) == (entry in REFUSED), (entry, said[1])
        assert said[1][0] == 2 or entry not in REFUSED
        option = re.search(r"\[(--[a-z-]+)", entry)[1]
        tried.add(f"{entry.split()[0]} {option}")
    assert Path("b.gif").read_bytes().startswith(b"GIF89a")
    for command, known in commands.commands.items():
        for option in known.params:
            if command != "run" and option.opts[0] not in (option.name, "--help", "--open"):
                assert {f"{command} {each}" for each in option.opts} & tried, option.opts


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is full")
def test_a_full_device_behind_a_stream_ends_no_run(coartic, tmp_path, monkeypatch):
    """What is printed on it is lost; of the standard output a sentence says so."""
    for stream, code in (("stderr", 0), ("stdout", 2)):
        out = tmp_path / stream
        with (
            open("/dev/full", "w") as full,
            monkeypatch.context() as patch,
        ):  # closed, it is written
            patch.setattr(sys, stream, full)
            ended, _, error = coartic(*SMALL, "--out", out)
        assert ended == code
        assert (load(out).runs.status == "ok").all()
    assert "Error: standard output cannot be written: No space left" in error


def test_two_reports_of_a_folder_are_written_one_after_the_other(tmp_path, traced):
    with lock(tmp_path), pytest.raises(CoarticError, match="another `coartic report` uses"):
        build.write_report(traced, tmp_path)
    assert not (tmp_path / "report.html").exists()
