"""Methods in worker processes: whatever one does, it harms no other, and its runs are kept."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from coartic import CoarticError, load_task
from coartic.analysis.study import load
from coartic.benchmarks import pool
from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform
from tests.support.processes import (
    begin_after_deaths,
    begin_never,
    comes,
    folders_of_session,
)
from tests.support.suites import KNOWN, cell_on, made_once, planned, run_and_write

pytestmark = [pytest.mark.process, pytest.mark.usefixtures("not_repeated")]

METHODS = """
import itertools, mmap, multiprocessing, os, signal, subprocess, sys, time
import numpy as np
from coartic.method import Information, Method, Parameters, Result
from coartic.motion.solution import Movement

def corrected(session, hand="right"):
    return tuple(Movement(n, hand, "corrective") for n in range(1, session.goals_count + 1))

def hand_of(n):
    return "right" if n else "left"

def trial_of(n):
    return KEPT.trial(corrected(KEPT)).reward

class What(Parameters):
    what: str = "honest"

class Does(Method):
    name = "test/does"
    title = citation = "x"
    information = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
    stochastic = False
    Parameters = What
    def solve(self, session):
        return getattr(self, self.parameters.what)(session)

class Again(Does):
    name = "test/again"
"""
TASK = load_task("ascending")
PLAN = planned([cell_on(TASK, KNOWN["dual-process/EC1"])])
HONEST = -319  # what these movements are worth
HANDLED = {
    "burns_in_c": ("all(itertools.repeat(1))", "timeout", "CPU time limit of 0.3 s exceeded"),
    "starts_a_process": ("subprocess.Popen(['sleep', '999']); return Result(corrected(session))",
                         "ok", ""),
    "is_killed": ("os.kill(os.getpid(), signal.SIGKILL)", "crashed", "killed by SIGKILL"),
    "is_killed_once": ("if not os.path.exists(__file__ + '.killed'):\n"
                       "            open(__file__ + '.killed', 'w').close()\n"
                       "            os.kill(os.getpid(), signal.SIGKILL)\n"
                       "        return Result(corrected(session))", "ok", ""),
    "allocates": ("kept = [np.empty(10**8) for _ in range(10**6)]", "crashed",
                  "divided by the number of processes; give a smaller --jobs"),
    "reserves": ("mmap.mmap(-1, 2**50)", "crashed", "give a smaller --jobs"),
    "nothing": ("return None", "solver-failed", "returned NoneType"),
    "nan": ("return Result((Movement(1, 'right', 'planned', session.q0 * np.nan),) * 3)",
            "solver-failed", "NaN in all entries"),
    "many": ("return Result(corrected(session) * 4000)", "solver-failed", "movements; at most"),
    "details": ("return Result(corrected(session), {'call': print})",
                "solver-failed", "cannot be stored: TypeError"),
    "honest": ("return Result(corrected(session))", "ok", ""),
    "maps": ("with multiprocessing.Pool(1) as pool: (hand,) = pool.map(hand_of, [1])\n"
             "        return Result(corrected(session, hand))", "ok", ""),
    "tries_elsewhere": ("global KEPT; KEPT = session\n"
                        "        with multiprocessing.Pool(1) as pool: pool.map(trial_of, [1])",
                        "crashed", "a session cannot be used in another process"),
    "prints": ("print('x' * 10**6); os.write(2, b'\\x1b[31m' * 10**5)\n"
               "        return Result(corrected(session))", "ok", ""),
}  # fmt: skip
"""What a method does, how its run ends, and words of the reason."""


def entries(folder, **bodies):
    """Methods of a file, which do one of these things."""
    things = bodies.items()
    text = "".join(f"    def {name}(self, session):\n        {body}\n" for name, body in things)
    head, mark, tail = METHODS.partition("class Again")
    (folder / "mine.py").write_text(head + text + mark + tail, encoding="utf-8")
    methods = registry([folder / "mine.py"])
    return methods["test/does"], methods["test/again"]


def cells_of(folder, **bodies):
    """Cells of a method that does these things, one each."""
    does, _ = entries(folder, **bodies)
    return [cell_on(TASK, does, what=name) for name in bodies]


@pytest.fixture(scope="module")
def study(tmp_path_factory, not_repeated):
    """Runs in the same workers, others, and this project's; CPU time ends each, however long it has
    to wait for it."""

    def make(folder):
        folder.mkdir()
        does, again = entries(folder, **{name: body for name, (body, _, _) in HANDLED.items()})
        cells = [cell_on(TASK, does, what=name) for name in HANDLED]
        cells += [cell_on(TASK, again), cell_on(TASK, KNOWN["corrective-alone/given"])]
        options = {"runs": 1, "time_limit_s": 0.3, "trial_budget": 3}
        run_and_write(folder / "out", cells, executor=Local(2, timeout_s=600.0), **options)

    return load(made_once(tmp_path_factory, "pool", make) / "out")


@pytest.fixture(scope="module")
def runs(study):
    runs = study.runs.astype(object)
    return runs.set_index((runs.method + " " + runs.setting).str.strip())


@pytest.mark.parametrize("name", HANDLED)
def test_whatever_a_method_does_is_kept_with_a_reason(runs, name):
    run = runs.loc["test/does" if name == "honest" else f"test/does what={name}"]
    _, status, words = HANDLED[name]
    assert run.status == status, run.reason
    assert words in run.reason
    assert run.reason.isprintable()
    died = name == "is_killed"
    assert run.isna().wall_s == (died or "CPU" in words)
    assert run.isna().cpu_s == died
    assert run.isna().reward if status != "ok" else run.reward == HONEST


class Impatient(Local):
    """Ends a job that waits for its file, after a moment, and gives one whose file is there ample
    time. The file of ``once`` comes before its second attempt."""

    def __init__(self, folder):
        super().__init__(1)
        self.folder, self.asked = folder, []

    def wall_limit_s(self, job):
        name = job.cell.parameters["what"]
        self.asked.append(name)
        if self.asked.count("once") == 2:
            (self.folder / "mine.py.once").touch()
        return 600.0 if (self.folder / f"mine.py.{name}").exists() else 0.2


def test_a_run_that_waits_twice_is_stored_as_timed_out(tmp_path):
    """In one command, which counts what it stored; a command with more time makes it again."""
    body = """while not os.path.exists(__file__ + '.' + self.parameters.what):
            time.sleep(999)
        return Result(corrected(session))"""
    cells = cells_of(tmp_path, once=body, twice=body)
    limits, executor = (0.3, 0.3, 0.31), Impatient(tmp_path)
    plans = [planned(cells, runs=1, time_limit_s=limit) for limit in limits]
    said = [str(perform(plan, tmp_path / "out", executor=executor)) for plan in plans[:2]]
    runs = load(tmp_path / "out").runs
    assert runs.status.tolist() == ["ok", "timeout"]
    assert (
        runs.reason[1] == "wall time limit of 0.2 s exceeded twice: the job, or the machine, waited"
    )
    assert said[0].startswith("2 runs in ")
    assert "1 failed" in said[0]
    assert said[1].startswith("2 runs (2 reused) in ")
    assert "1 failed" in said[1]
    (tmp_path / "mine.py.twice").touch()
    assert perform(plans[2], tmp_path / "out", executor=executor).failed == 0
    assert load(tmp_path / "out").runs.status.tolist() == ["ok"] * 2


def test_the_limit_of_wall_time_follows_from_that_of_cpu_time():
    (job,) = planned([PLAN[0].cell], runs=1, time_limit_s=0.3)
    assert Local(1, timeout_s=4.1).wall_limit_s(job) == pytest.approx(3 * 0.3 + 4.1)


@pytest.mark.skipif(sys.platform != "linux", reason="the test chooses the core of processes")
def test_other_work_on_the_core_changes_no_outcome(tmp_path):
    """A run that has another beside it takes less CPU time than its limit, and more wall time."""
    burn = """os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        end = time.process_time() + self.seconds
        while time.process_time() < end: pass
        return Result(corrected(session))"""
    short, long = (burn.replace("self.seconds", seconds) for seconds in ("0.15", "99"))
    cells = cells_of(tmp_path, short=short, long=long)
    study = run_and_write(tmp_path / "out", cells, executor=Local(2), runs=1, time_limit_s=0.3)
    assert study.runs.status.tolist() == ["ok", "timeout"]
    assert study.runs.reason[1] == "CPU time limit of 0.3 s exceeded"


@pytest.mark.skipif(sys.platform != "linux", reason="the test looks into /proc")
@pytest.mark.usefixtures("runs")
def test_what_a_method_starts_ends_with_it():
    def left():
        folders = folders_of_session(os.getsid(0))
        return [name for name in folders if "/coartic-" in name and "(deleted)" in name]

    assert comes(lambda: not left())  # killed they are; on a busy machine they end later


PRINTS = """os.write(2, b'line' * 10**6 + b'\\none\\ntwo\\nthe end')
        os._exit(3)"""


def test_a_worker_that_is_killed_before_its_job_is_replaced(tmp_path, monkeypatch):
    """Unless none ever begins."""
    monkeypatch.setattr(pool, "_begin", begin_after_deaths)
    cells = [cell_on(TASK, KNOWN["corrective-alone/given"])]
    assert run_and_write(tmp_path / "out", cells, executor=Local(1)).runs.reward[0] == HONEST
    monkeypatch.setattr(pool, "_begin", begin_never)
    with pytest.raises(CoarticError, match="worker processes cannot start or work"):
        run_and_write(tmp_path / "never", cells, executor=Local(1))


def test_the_last_words_of_a_run_are_kept(tmp_path):
    """Those of an earlier run are not those of a crash."""
    says = "os.write(2, b'x'); return Result(corrected(session))"
    cells = cells_of(tmp_path, says=says, quits="os._exit(7)", prints=PRINTS)
    runs = run_and_write(tmp_path / "out", cells, executor=Local(1), runs=1).runs
    assert runs.status.tolist() == ["ok", "crashed", "crashed"]
    assert runs.reason[1].endswith("exit code 7): it printed no error")
    assert runs.reason[2].endswith("exit code 3): one | two | the end")


def test_jobs_of_many_methods_are_at_work_side_by_side(tmp_path):
    """Each waits until the other has begun; two processes at once are all that there are."""
    body = """open(__file__ + "." + self.name[5:], "w").close()
        while not all(os.path.exists(__file__ + name) for name in (".does", ".again")):
            time.sleep(0.01)
        return Result(corrected(session))"""
    cells = [cell_on(TASK, method) for method in entries(tmp_path, honest=body)]
    cells.append(cell_on(TASK, KNOWN["corrective-alone/given"]))
    study = run_and_write(tmp_path / "out", cells, executor=Local(2))
    assert study.runs.reward.tolist() == [HONEST] * 3


def test_a_file_that_is_changed_after_the_plan_ends_the_suite(tmp_path):
    cells = cells_of(tmp_path, honest="return Result(corrected(session))")
    with (tmp_path / "mine.py").open("a") as file:
        file.write("# another version\n")
    with pytest.raises(CoarticError, match="mine.py, or a file that it loads, has changed"):
        perform(planned(cells), tmp_path / "out", executor=Local(1))


def test_other_methods_and_the_parent_notice_nothing(runs):
    assert runs.reward["test/again"] == runs.reward["corrective-alone/given"] == HONEST


SCRIPT = """
from coartic.benchmarks.runner import run_suite
print("begun", flush=True)
for method, tasks in (("test/does", ["ascending"]), ("test/again", ["ascending", "descending"])):
    select = {"tasks": tasks, "methods": [method], "method_files": ["mine.py"]}
    print(run_suite("paper", method, **select), flush=True)
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """A process that runs two methods from a script without a guard; the second one never ends."""
    folder = tmp_path_factory.mktemp("script")
    body = """open("working", "w").close()
        print("what it prints", file=sys.stderr)  # is not shown
        while self.name == "test/again":
            pass
        return Result(corrected(session))"""
    entries(folder, honest=body)
    (folder / "script.py").write_text(SCRIPT)
    command = [sys.executable, "script.py"]
    with subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        yield folder, process
        process.kill()


def test_a_script_needs_no_guard(script):
    folder, process = script
    assert process.stdout.readline() == "begun\n"
    assert process.stdout.readline().startswith("1 run in")
    assert load(folder / "test" / "does").runs.reward.tolist() == [HONEST]


def test_a_program_performs_its_own_functions_in_other_processes(tmp_path):
    program = tmp_path / "squares.py"
    program.write_text(
        "from coartic.benchmarks.pool import process_pool\n"
        "def square(x):\n    return x * x\n"
        "if __name__ == '__main__':\n"
        "    with process_pool(1) as pool:\n        print(*pool.map(square, [1, 2, 3]))\n"
    )
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, timeout=600)
    assert (done.stdout, done.returncode) == ("1 4 9\n", 0), done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="the test finds the workers in /proc")
def test_workers_end_with_their_parent(script):
    _, process = script
    while sum((Path(f) / "working").exists() for f in folders_of_session(process.pid)) < 2:
        time.sleep(0.05)
        assert process.poll() is None
    process.kill()
    assert comes(lambda: not folders_of_session(process.pid))


def test_jobs_that_are_dropped_leave_no_folder(tmp_path, monkeypatch):
    """As where a command is interrupted. A warning would fail the test."""
    monkeypatch.setattr(pool.tempfile, "tempdir", str(tmp_path))
    answers = Local(1).perform([PLAN[0], PLAN[0]])
    next(answers)
    assert any(tmp_path.iterdir())
    del answers
    assert not any(tmp_path.iterdir())
