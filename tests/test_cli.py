"""The command line as a user meets it."""

import hashlib
import html
import io
import json
import lzma
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from coartic import CoarticError, builtin_tasks, load_task
from coartic.analysis.report import build
from coartic.analysis.study import load
from coartic.benchmarks import template
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import run_suite
from coartic.benchmarks.suites import suites
from coartic.cli import COMMANDS, completion
from coartic.cli.arguments import resolve_methods
from coartic.cli.terminal import complain, say, say_pairs
from coartic.pictures import film
from coartic.runs import shipped
from coartic.runs.store import RUNS_FILE, lock, open_store
from coartic.tasks.task import TASK_FOLDER
from tests.support.bad_inputs import GOOD
from tests.support.processes import comes, folders_of_session, python
from tests.support.strategies import metres_task
from tests.support.suites import (
    KNOWN,
    ROOT,
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


def test_commands_are_not_wrapped(coartic, monkeypatch, capsys):
    """However narrow the terminal is: they are to be copied."""
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    command = "coartic run comparison --tasks 'my own/shelf.toml' --methods hill-climbing,cma-es"
    say_pairs([("Check", command), ("", f"{'words ' * 12}`{command}` {'and more ' * 9}")])
    complain("Error", f"{'words ' * 12}`{command}` {'and more ' * 9}")
    for text in capsys.readouterr():
        lines = text.splitlines()
        assert text.count(command) == sum(command in line for line in lines) > 0
        assert all(len(line) <= 40 for line in lines if "coartic" not in line)
    assert "CMA-ES --runs 5 --out results\n" in coartic("run", "--help")[1]


def test_a_terminal_without_a_sign_shows_one_like_it():
    terminal = io.TextIOWrapper(io.BytesIO(), "latin-1", "replaced")
    say("−3 ± 1 –", stream=terminal)
    assert terminal.buffer.getvalue().decode("latin-1") == f"-3 ± 1 -{os.linesep}"


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
    text = coartic("verify", out, "--run", first, "--run", second)[1]
    assert text.splitlines()[-1] == "2 runs performed again: none with another result."
    assert f"`coartic list {out}`" in coartic("verify", out, "--run", "0123456789")[2]
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


INTERRUPTED = """
import os, signal, sys, threading, time
import coartic.__main__

moment, number, times = map(int, sys.argv[1:4])
sys.argv[1:] = sys.argv[4:]
signal.pthread_sigmask(signal.SIG_SETMASK, signal.valid_signals())  # as some starters do

def interrupt():
    for _ in range(times):
        os.kill(os.getpid(), number)
        time.sleep(0.05)

threading.Timer(moment / 1000, interrupt).start()  # moment: ms after it has begun
coartic.__main__.main()
"""


@pytest.mark.process
@pytest.mark.parametrize(
    ("moment", "name", "times"),
    [
        ("300", "SIGINT", 2),
        ("2500", "SIGTERM", 2),
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


LOST = """
import os, signal, sys
import coartic.__main__
from coartic.benchmarks import pool

class Finaliser:
    def __del__(self):  # Python drops what is raised here
        os.kill(os.getpid(), signal.SIGTERM)

def perform(self, *arguments, perform=pool.Local.perform):
    Finaliser()
    return perform(self, *arguments)

pool.Local.perform = perform
sys.argv[1:] = ["run", "paper", "--runs", "500", "--trials", "30000", "--jobs", "1", "--out", "out"]
coartic.__main__.main()
"""


@pytest.mark.process
def test_a_command_ends_although_a_finaliser_has_dropped_the_interruption(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("it")
    status, words = call_apart(tmp_path, [sys.executable, "-c", LOST], "temporary")
    assert status == 143, words
    assert "Exception ignored" in words
    assert words.splitlines()[-1].startswith("Interrupted.")


def call_apart(place, command, temporary, **environment):
    """Exit code and standard error of a command that leaves no process and no temporary folder."""
    (place / temporary).mkdir()
    done = subprocess.Popen(
        [*command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=place,
        env=os.environ | environment
        | {"TMPDIR": str(place / temporary), "PYTHONPATH": str(ROOT)},
        start_new_session=True,
    )  # fmt: skip
    _, words = done.communicate()
    # Python tries a folder for temporary files with a file, which a signal can leave behind.
    assert not [path for path in (place / temporary).iterdir() if path.is_dir()]
    assert comes(lambda: not folders_of_session(done.pid))
    return done.returncode, words


@pytest.mark.parametrize("name", ["class", "random", "3d/search", "numpy", "my-search"])
def test_a_new_file_can_be_imported_and_hides_no_module(coartic, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    assert coartic("new", name)[0] == 0
    (file,) = tmp_path.iterdir()
    assert file.stem.isidentifier()
    assert file.stem not in {*sys.stdlib_module_names, "numpy"}
    compile(f"import {file.stem}", "", "exec")


PROGRAM = """
from coartic.__main__ import main
from coartic.benchmarks import provenance, runner
from coartic.cli import run

provenance.arithmetic = lambda: ""  # it and these take long
run.say_ranking = runner.perform_in_order = lambda *_, **__: ()
main()
"""

MINE = """
import subprocess
import numpy as np
from coartic.method import Information, Method, Result
from coartic.motion.solution import Movement

subprocess.Popen(["sleep", "999"])

class Mine(Method):
    name, title, citation, stochastic = "mine", "Mine", "none", False
    information = frozenset({Information.CORRECTIVE_PROCESS})

    def solve(self, session):
        first, second = np.random.default_rng(0).random((2, 100, 100))
        movements = [Movement(number, "right", "corrective") for number in (1, 2, 3)]
        return Result(tuple(movements), {"solved": np.linalg.solve(first, second[0]).tolist()})
"""


@pytest.mark.process
def test_workers_round_alike_and_import_nothing_from_the_working_folder(tmp_path):
    """By no process of a command that is installed, whatever a method's file starts. The
    environment of these tests is that of workers (tests/conftest.py): this process rounds as they
    should; that of the command is another one."""
    for name in ("coartic", "multiprocessing", "numba", "numpy", "socket", "threading"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'run')!r}, 'w').close()")
    program = tmp_path / "bin" / "program.py"
    program.parent.mkdir()
    program.write_text(PROGRAM)
    mine, out = program.with_name("mine.py"), tmp_path / "out"
    mine.write_text(MINE)
    own = (*SMALL[:4], "--methods", "mine", "--method-file", mine, "--jobs", 1, "--out", out)
    other = {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": ""}
    command = map(str, (sys.executable, program, *own))
    status, words = call_apart(tmp_path, command, "long" * 30, **other)
    assert status == 0, words  # the system takes no long socket
    assert not (tmp_path / "run").exists()
    with open_store(out) as store:
        (run,) = map(store.run, store.ids())
    first, second = np.random.default_rng(0).random((2, 100, 100))
    assert run.details == {"solved": np.linalg.solve(first, second[0]).tolist()}


@pytest.mark.process
def test_the_template_of_a_planner_keeps_the_rules(coartic, tmp_path):
    file = tmp_path / "my_plan.py"
    code, text, _ = coartic("new", "my-plan", "--planner", "--out", file)
    assert code == 0
    assert f"coartic check my-plan --method-file {file}" in text
    code, text, error = coartic("check", "my-plan", "--method-file", file)
    assert code == 0, text + error
    assert "9 of 9 checks passed" in text


def test_the_report_of_shipped_results_goes_where_git_ignores_it(coartic, monkeypatch, tmp_path):
    written = []
    monkeypatch.setattr(build, "write_report", lambda _, out, **__: (written.append(out) or [], {}))
    monkeypatch.chdir(tmp_path)
    assert coartic("report", "shipped")[0] == 0
    assert written == [Path("results/shipped/report")]
    assert "/results/" in (ROOT / ".gitignore").read_text().split()


@pytest.fixture
def shipped_and_own(traced, tmp_path, monkeypatch):
    """A small folder in place of the shipped results, and a folder of one's own of this name."""
    place = tmp_path / "package"
    place.mkdir()
    content = lzma.compress((traced.folder / RUNS_FILE).read_bytes(), preset=0)
    (place / "comparison.sqlite.xz").write_bytes(content)
    digits = hashlib.sha256(content).hexdigest()
    (place / "SHA256SUMS").write_text(f"{digits}  comparison.sqlite.xz\n")
    monkeypatch.setattr(shipped, "SHIPPED_FOLDER", place)
    monkeypatch.chdir(tmp_path)
    run_and_write(
        Path("shipped"),
        [cell_on(load_task("ascending"), KNOWN["dual-process/EC1"])],
        runs=2,
        trials=40,
    )
    return len(traced.stored), 2


def test_the_word_shipped_and_a_folder_of_this_name(coartic, shipped_and_own):
    of_package, own = shipped_and_own
    names = {"shipped": of_package, "./shipped": own, "shipped/": own, Path.cwd() / "shipped": own}
    for name, runs in names.items():
        assert coartic("list", name)[1].endswith(f"shipped: {runs} runs.\n")
        assert coartic("verify", name)[1].startswith(f"{runs} runs checked")
        assert len(load(name).runs) == runs
        assert ("Natural Computing" in coartic("cite", name)[1]) == (runs == of_package)
        ids = completion.runs(SimpleNamespace(args=[name]), "")
        assert len(ids) == runs
        code, _, error = coartic("draw", name)
        assert (code, f"`coartic draw {name} --run ID`" in " ".join(error.split())) == (2, True)
    assert len(load(Path("shipped")).runs) == own
    code, _, error = coartic(*SMALL, "--out", "shipped")
    assert (code, "write ./shipped" in " ".join(error.split())) == (2, True)
    with pytest.raises(CoarticError, match="write ./shipped"):
        run_suite("paper", "shipped")
    assert len(load("./shipped").runs) == own


@pytest.mark.parametrize("name", ["shipped", "./shipped", "my results/it's 100 %"])
def test_commands_of_a_page_work(name, coartic, shipped_and_own, in_this_process):
    """All of them, as the page has them, in the folder in which it was written."""
    if not name.endswith("shipped"):
        Path(name).parent.mkdir(exist_ok=True)
        shutil.move("shipped", name)
    assert coartic("report", name)[0] == 0
    page = (Path("results" if name == "shipped" else ""), name, "report", "report.html")
    text = Path(*page).read_text("utf-8")
    commands = [*map(html.unescape, re.findall("<code>(coartic [^<]+)</code>", text))]
    assert {command.split()[1] for command in commands} == {"cite", "draw", "run", "verify"}
    (run_id,) = load(name).runs.run_id[:1]
    (player,) = re.findall(r'"folder": ?("(?:[^"\\]|\\.)*")', text)  # for its script
    commands.append(f"coartic draw {json.loads(player)} --run RUN --out other.gif")
    for command in commands:
        words = shlex.split(command.replace("RUN", run_id))[1:]
        if words != ["run"]:  # the one that made the folder
            code, said, error = coartic(*words)
            assert code == 0, (command, error)
            assert said


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
    assert coartic("draw", tmp_path / "mine.toml", "--out", tmp_path / "own.svg")[0] == 0


SETTINGS = """if True:
    from coartic.cli import main
    try:
        main()
    except SystemExit:
        import matplotlib
    from coartic.motion.kernels.compile import import_numba
    import_numba()
    with open(".numba_config.yaml", "w") as file:
        file.write("cache_dir: kept\\ndisable_jit: 1\\n")
    from numba.core import config
    config.reload_config()
    print(matplotlib.rcParams["text.usetex"], config.CACHE_DIR, config.DISABLE_JIT)"""


@pytest.mark.process
def test_settings_of_matplotlib_and_numba_in_a_folder_are_not_read(tmp_path):
    """They may name programs, and the folder may be a stranger's."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True")
    (tmp_path / ".numba_config.yaml").write_text(": {{{ \0")  # which no import would survive
    command = ("-W", "error", "-c", SETTINGS, "--version")
    done = python(*command, cwd=tmp_path, NUMBA_CACHE_DIR="/ours")
    assert done.stdout.splitlines()[-1] == "False /ours 0"


@pytest.mark.parametrize(("command", "example"), COMMANDS)
def test_examples_have_options_that_there_are(commands, command, example):
    name = command.__name__.removesuffix("_")
    options = {opt for parameter in commands.commands[name].params for opt in parameter.opts}
    assert {word for word in example.split() if word.startswith("--")} <= options


def test_lines_of_the_help_are_whole_sentences(coartic, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    names = [command.__name__.removesuffix("_") for command, _ in COMMANDS]
    for arguments in (["--help"], *([name, "--help"] for name in names)):
        code, text, _ = coartic(*arguments)
        lines = [line for line in text.splitlines() if not line.startswith("Usage:")]
        assert (code, [line for line in lines if line.endswith(("...", "…"))]) == (0, [])
        assert max(map(len, lines)) <= 80


COMPLETED = """if True:
    import os, sys
    from coartic.cli import main
    for typed in sys.argv[1:]:
        sys.argv = ["coartic"]
        os.environ.update(COMP_WORDS=typed, COMP_CWORD=str(len(typed.split(" ")) - 1))
        try:
            main()
        except SystemExit:
            print(";")
    print("imported:", *sys.modules.keys() & {"matplotlib", "numba", "pandas"})"""


@pytest.mark.process
def test_a_shell_completes_names_and_prints_no_error(tmp_path):
    cells = [cell_on(load_task("ascending"), KNOWN["dual-process/EC1"])]
    run_id = run_and_write(tmp_path / "out", cells, runs=1, trials=3).runs.run_id[0]
    offers = {
        "run qu": ["quick"],
        "run quick --tasks ascending,d": ["ascending,descending"],
        "run quick --methods EC1,CMA": ["EC1,CMA-ES"],
        "check optimum/": ["optimum/search", "optimum/in-model"],
        "list comp": ["comparison"],
        f"verify {tmp_path}/out --run {run_id[:3]}": [run_id],
        f"draw {tmp_path}/out --run ": [run_id],
        f"verify {tmp_path}/nowhere --run ": [],
    }
    lines = [f"coartic {line}" for line in offers]
    done = python("-c", COMPLETED, *lines, _COARTIC_COMPLETE="complete_bash")
    *offered, imported = done.stdout.split(";")
    assert [words.split() for words in offered] == [*offers.values()]
    assert (imported.strip(), done.stderr) == ("imported:", "")


def test_names_that_are_completed_are_those_that_commands_take():
    registered = registry()
    taken = resolve_methods(completion.methods(), registered)
    assert {*taken} == {*registered}
    assert {*completion.suites()} == {*suites()}
    assert {*builtin_tasks()} <= {load_task(name).name for name in completion.tasks()}


@pytest.mark.usefixtures("in_this_process")
def test_a_task_of_a_small_radius_passes_every_door(coartic, tmp_path):
    task, file, out = metres_task(1e-3, name="arm"), tmp_path / "arm.toml", tmp_path / "runs"
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


@pytest.mark.parametrize(
    ("command", "code", "words"),
    [
        ("run quick --runs 50..9", 2, "'50..9' goes backwards"),
        ("draw other", 2, "other is not a results folder"),
        ("draw suite.toml", 2, "suite.toml is a suite: use `coartic run suite.toml`"),
        ("draw ascending --run 12", 2, "--run needs a results folder; ascending is a task"),
        ("check nothere", 2, "`coartic list` shows all"),
        ("check bytes.toml", 1, "bytes.toml is not UTF-8"),
    ],
)
def test_the_subject_of_a_command_is_explained(
    coartic, tmp_path, monkeypatch, command, code, words
):
    monkeypatch.chdir(tmp_path)
    Path("other").mkdir()
    Path("suite.toml").write_text("blocks = []", "utf-8")
    Path("bytes.toml").write_bytes(b'title = "\xff"')
    ended, text, error = coartic(*command.split())
    assert ended == code
    assert words in text + error


REFUSED = (
    "play --no-open [--replace]",
    "list EC1 [--method-file mine.py]",
    "check task.toml [--verbose]",
    "report out [--width 3.4]",
    "verify out --run {run} [--again 1]",
    "verify out [--method-file mine.py]",
    "draw ascending --out h.svg [--initial]",
)


@pytest.mark.usefixtures("in_this_process")
def test_an_option_that_has_no_effect_is_refused(coartic, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(film, "MAX_FRAMES", 3)  # films are short
    monkeypatch.setattr(film, "PAUSE", 1)
    monkeypatch.setattr(film, "HOLD", 1)
    Path("near.toml").write_text(NEAR, "utf-8")
    near = paper_cells(tasks=["near.toml"], methods=["EC1"])
    study = run_and_write(tmp_path / "out", near, runs=1, trials=5)
    Path("mine.py").write_text(
        (ROOT / "tests" / "methods" / "nearest_hand.py").read_text("utf-8"), "utf-8"
    )
    Path("task.toml").write_text(TASK_FILE.read_text("utf-8"), "utf-8")

    def call(words):
        code, _, error = coartic(*words.format(run=study.runs.run_id[0][:8]).split())
        return code, error

    for entry in REFUSED:
        code, error = call(re.sub(r"[][]", "", entry))
        assert (code, " no effect" in error) == (2, True), (entry, error)
    assert call("draw out --run {run} --width 200 --out b.gif") == (0, "")
    assert Path("b.gif").read_bytes().startswith(b"GIF89a")


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


def test_two_reports_of_a_folder_are_written_one_after_the_other(tmp_path):
    cells, report = paper_cells(tasks=["ascending"]), tmp_path / "report"
    study = run_and_write(tmp_path / "out", cells, runs=1, trials=3)
    report.mkdir()
    with lock(report), pytest.raises(CoarticError, match="another `coartic report` uses"):
        build.write_report(study, report)
    assert not (report / "report.html").exists()
