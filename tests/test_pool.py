"""Methods in worker processes: whatever one does, it harms no other, and its runs are kept."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from coartic import CoarticError, load_task
from coartic.analysis.study import load
from coartic.benchmarks import pool
from coartic.benchmarks.pool import Local, Workers, signal_name
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform
from coartic.runs.store import writing
from tests.support.processes import comes, folders_of_session, processes, python
from tests.support.suites import KNOWN, cell_on, made_once, planned, run_and_write

pytestmark = [pytest.mark.process, pytest.mark.usefixtures("not_repeated")]

METHODS = """
import itertools, os, shutil, signal, sys, tempfile, threading, time
import numpy as np
import coartic.benchmarks.pool, coartic.benchmarks.scoring, coartic.motion.solution
from coartic.method import Information, Method, MethodError, Parameters, Result
from coartic.motion.solution import Movement

def corrected(session, hand="right"):
    return tuple(Movement(n, hand, "corrective") for n in range(1, session.goals_count + 1))

class Runs:
    def __reduce__(self):
        return open, (__file__ + ".run", "w")

class Hand(str):
    __reduce_ex__ = lambda self, _: (open, (__file__ + ".run", "w"))

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
    "shuts_its_ears": ("signal.signal(signal.SIGPROF, signal.SIG_IGN)\n"
                       "        while True: pass", "timeout", "CPU time limit of 0.3 s exceeded"),
    "forks": ("os.fork() or signal.pause(); return Result(corrected(session))", "ok", ""),
    "forks_and_goes_on": ("os.fork(); return Result(corrected(session))", "ok", ""),
    "leaves_a_thread": ("threading.Thread(target=signal.pause).start()\n"
                        "        return Result(corrected(session))", "ok", ""),
    "closes": ("os.closerange(0, 99); return Result(corrected(session))", "ok", ""),
    "is_a_pickle": ("session._rewards.append(Runs()); return Result(corrected(session))",
                    "crashed", "Runs"),
    "is_a_hand": ("return Result(corrected(session, Hand('right')))", "ok", ""),
    "unwritten": ("return Result(corrected(session), {'x': chr(0xd800)})",
                  "solver-failed", "cannot be kept"),
    "is_killed": ("os.kill(os.getpid(), signal.SIGKILL)", "crashed", "killed by SIGKILL"),
    "is_killed_once": ("if not os.path.exists(__file__ + '.killed'):\n"
                       "            open(__file__ + '.killed', 'w').close()\n"
                       "            os.kill(os.getpid(), signal.SIGKILL)\n"
                       "        return Result(corrected(session))", "ok", ""),
    "removes_its_folder": ("shutil.rmtree(os.path.dirname(os.getcwd()))\n"
                           "        return Result(corrected(session))", "crashed", "could not be"),
    "allocates": ("kept = [np.empty(10**8) for _ in range(10**6)]", "crashed", "MemoryError"),
    "writes": ("open('large', 'wb').truncate(2**40)", "crashed", "File too large"),
    "turns_its_clock_back": ("clock = time.process_time\n"
        "        def once():\n"
        "            time.process_time = clock\n"
        "            return -1.0\n"
        "        time.process_time = once", "crashed", "ValueError: cpu_s is -"),
    "counts_back": ("session._meter.trials = -5; return Result(corrected(session))",
                    "crashed", "ValueError: trials is -5"),
    "hides_a_trial": ("session.trial(corrected(session)); session._meter.trials = 0",
                      "crashed", "ValueError: 1 rewards of 0 trials"),
    "forges_a_commit": ("answer = coartic.benchmarks.pool.answer_of\n"
        "        def once(outcomes):\n"
        "            coartic.benchmarks.pool.answer_of = answer\n"
        "            return answer(outcomes).replace(b'libraries', b'commit')\n"
        "        coartic.benchmarks.pool.answer_of = once\n"
        "        return Result(corrected(session))", "crashed", "outcomes cannot be read"),
    "has_no_words": ("def fails(self): raise ValueError('x')\n"
        "        raise type('Mute', (Exception,), {'__str__': fails})",
        "crashed", "Mute: its message cannot be shown"),
    "keeps_corrections": ("details = {'corrections': ['two', -1, 0.5] + [1] * 8}\n"
        "        return Result(corrected(session), details)", "ok", ""),
    "generates": ("return Result(m for m in corrected(session))", "ok", ""),
    "nothing": ("return None", "solver-failed", "returned NoneType, not a Result"),
    "nan": ("return Result((Movement(1, 'right', 'planned', session.q0 * np.nan),) * 3)",
            "solver-failed", "finite"),
    "far": ("return Result((Movement(1, 'right', 'planned', session.q0 + 1e6),) * 3)",
            "solver-failed", "steps; at most"),
    "many": ("return Result(corrected(session) * 4000)", "solver-failed", "movements; at most"),
    "leads_nowhere": ("return Result((Movement(1, 'right', 'path', waypoints=[]),) * 3)",
                      "solver-failed", "cannot be kept: IndexError"),
    "details": ("return Result(corrected(session), {'call': print})",
                "solver-failed", "cannot be kept: TypeError"),
    "two_ends": ("way = Movement(1, 'right', 'path', session.q0 + 1, waypoints=[session.q0])\n"
                 "        return Result((way, *corrected(session)[1:]))",
                 "solver-failed", "its target is the last of them"),
    "lies": ("error = MethodError('infeasible', 'x'); error.outcome = 'ok'; raise error",
             "solver-failed", "returned no solution"),
    "spends": ("for _ in range(2): session.spend(gradients=2**62)",
               "crashed", "it must be a whole number from 0 to 4,6"),
    "honest": ("return Result(corrected(session))", "ok", ""),
    "prints": ("print('x' * 10**6); os.write(2, b'\\x1b[31m' * 10**5)\n"
               "        return Result(corrected(session))", "ok", ""),
    "giant": ("coartic.motion.solution.execute = coartic.benchmarks.scoring.execute_all = None\n"
              "        session.model = session.model._replace(step=1.0)\n"
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
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(pool, "_SPINS_S", 0.2)
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
    died = name in ("is_killed", "removes_its_folder") or "cannot be read" in run.reason
    assert run.isna().wall_s == (died or "CPU" in words)
    assert run.isna().cpu_s == died
    assert run.isna().reward if status != "ok" else run.reward == HONEST


def test_a_signal_without_a_name_has_its_number():
    assert [signal_name(9), signal_name(999)] == ["SIGKILL", "signal 999"]


def test_a_run_that_waits_twice_is_stored_as_timed_out(tmp_path):
    """In one command, which counts what it stored; a command with more time makes it again."""
    body = """if not os.path.exists(__file__ + '.NAME'):
            open(__file__ + '.once', 'w').close()
            time.sleep(999)
        return Result(corrected(session))"""
    once, twice = (body.replace("NAME", name) for name in ("once", "ready"))
    cells = cells_of(tmp_path, once=once, twice=twice)
    executor, limits = Local(1, timeout_s=0.5), (0.3, 0.3, 0.31)
    plans = [planned(cells, runs=1, time_limit_s=limit) for limit in limits]
    said = [str(perform(plan, tmp_path / "out", executor=executor)) for plan in plans[:2]]
    runs = load(tmp_path / "out").runs
    assert runs.status.tolist() == ["ok", "timeout"]
    assert runs.reason[1] == "wall time limit of 1.4 s exceeded twice: it waited"
    assert said[0].startswith("2 runs in ")
    assert "1 failed" in said[0]
    assert said[1].startswith("2 runs (2 reused) in ")
    assert "1 failed" in said[1]
    (tmp_path / "mine.py.ready").touch()
    assert perform(plans[2], tmp_path / "out", executor=executor).failed == 0
    assert load(tmp_path / "out").runs.status.tolist() == ["ok"] * 2


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
def test_what_a_method_forks_ends_with_it():
    def left():
        folders = folders_of_session(os.getsid(0))
        return [name for name in folders if "/coartic-" in name and "(deleted)" in name]

    assert comes(lambda: not left())  # killed they are; on a busy machine they end later


PRINTS = """text = b'x' * 10**6
        for _ in range(300): os.write(1, text)
        os.write(2, b'\\none\\ntwo\\nthe end')
        os._exit(3)"""


def test_the_last_words_of_a_run_are_kept(tmp_path):
    """Of 300 MB, more than files may have, in little memory; those of an earlier run are not those
    of a crash."""
    resource = pytest.importorskip("resource")
    says = "print('x', flush=True); return Result(corrected(session))"
    cells = cells_of(tmp_path, says=says, quits="os._exit(0)", prints=PRINTS)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    runs = run_and_write(tmp_path / "out", cells, executor=Local(1), runs=1).runs
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50 * 2**10
    assert runs.status.tolist() == ["ok", "crashed", "crashed"]
    assert runs.reason[1].endswith("exit code 0): it left no message")
    assert runs.reason[2].endswith("the end")


@pytest.mark.skipif(sys.platform != "linux", reason="the test finds the processes in /proc")
def test_where_somebody_kills_their_server_runs_are_repeated(tmp_path):
    body = """try:
            open(__file__ + ".first", "x").close()
        except FileExistsError:  # all others wait until somebody is killed
            while not os.path.exists(__file__ + ".killed"): time.sleep(0.01)
        return Result(corrected(session))"""
    does, _ = entries(tmp_path, honest=body)
    cells, killed = [cell_on(TASK, replace(does, stochastic=True))], []

    def kill(progress, _):
        if progress.done != 1:
            return
        while not killed:
            killed.extend(
                pid
                for pid, (parent, _, _, command) in processes().items()
                if parent == os.getpid() and "multiprocessing.forkserver" in command
            )
        for pid in killed:
            with contextlib.suppress(ProcessLookupError):  # it has just ended
                os.kill(pid, signal.SIGKILL)
        (tmp_path / "mine.py.killed").touch()

    perform(planned(cells, runs=8), tmp_path / "out", executor=Local(2), watch=kill)
    assert killed
    assert load(tmp_path / "out").runs.status.tolist() == ["ok"] * 8


def test_without_a_place_for_answers_the_suite_ends(tmp_path):
    body = """if self.name == "test/does" and not os.path.exists(__file__ + ".over"):
            open(__file__ + ".begun", "w").close()
            shutil.rmtree(os.path.dirname(os.path.dirname(os.getcwd())))
        while not os.path.exists(__file__ + ".begun"): time.sleep(0.01)
        return Result(corrected(session))"""
    cells = [cell_on(TASK, method) for method in entries(tmp_path, honest=body)]
    plan, out = planned(cells), tmp_path / "out"
    with pytest.raises(CoarticError, match="no place for answers: .*Finished runs are kept"):
        perform(plan, out, executor=Local(2))
    with writing(out) as store:
        assert {status for *_, status, _ in store.present()} <= {"ok"}
    (tmp_path / "mine.py.over").touch()
    assert run_and_write(out, cells).runs.status.tolist() == ["ok", "ok"]


def test_a_process_that_cannot_begin_says_what_ended_and_blames_no_file(tmp_path, monkeypatch):
    def fails(_):
        raise EOFError

    monkeypatch.setattr("coartic.benchmarks.method_files.start_process", fails)
    words = "no process for it begins .EOFError.. Repeat the command$"
    with pytest.raises(CoarticError, match=f"mine.py is not read: .*{words}"):
        entries(tmp_path, honest="pass")


def test_too_few_open_files_get_a_sentence_before_a_process_begins(tmp_path, monkeypatch):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (63, 63))
    with pytest.raises(CoarticError, match="mine.py is not read: .*after `ulimit -n 1024`"):
        entries(tmp_path, honest="pass")
    with pytest.raises(CoarticError, match="Too many open files"):
        list(Local(1).perform(PLAN))


def test_a_working_folder_that_is_gone(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(CoarticError, match="mine.py is not read: .* working folder was removed"):
        entries(tmp_path, honest="pass")
    with pytest.raises(CoarticError, match="processes cannot begin .* working folder was removed"):
        list(Local(1).perform(PLAN))
    monkeypatch.chdir(tmp_path)


def test_other_methods_and_the_parent_notice_nothing(study, runs):
    assert runs.reward["test/again"] == runs.reward["corrective-alone/given"] == HONEST
    assert not list(study.folder.parent.glob("*.run"))


def test_workers_that_cannot_begin_get_a_sentence():
    task = TASK.model_copy(update={"goals": ()})
    job = replace(PLAN[0], cell=replace(PLAN[0].cell, task=task), numbers=(0,))
    with pytest.raises(CoarticError, match="processes cannot begin"):
        list(Local(1).perform([job] * 10))


def test_what_keeps_workers_from_beginning_is_said_without_a_traceback(tmp_path):
    words = ["run", "comparison", "--tasks", "two-armed-1", "--methods", "EC2", "--runs", "1"]
    done = python("-m", "coartic", *words, cwd=tmp_path, fails=True, NUMBA_DISABLE_JIT="1")
    assert "cannot begin: NUMBA_DISABLE_JIT is set: unset it" in done.stderr
    assert "File" not in done.stderr


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


@pytest.mark.skipif(sys.platform != "linux", reason="the test finds the workers in /proc")
def test_workers_end_with_their_parent(script):
    _, process = script
    while sum((Path(f) / "working").exists() for f in folders_of_session(process.pid)) < 2:
        time.sleep(0.05)
        assert process.poll() is None
    process.kill()
    assert comes(lambda: not folders_of_session(process.pid))


def test_one_worker_at_most_waits_for_jobs(monkeypatch):
    made, new = [], Workers.worker_for
    monkeypatch.setattr(Workers, "worker_for", lambda *given: made.append(new(*given)) or made[-1])
    jobs = [planned([cell_on(TASK, KNOWN["corrective-alone/given"])])[0] for _ in range(2)]

    def alive():
        return sum(worker.exit_code is None for worker in made)

    with contextlib.closing(Workers(Local(2), stays=True)) as workers:
        assert len([*workers.perform(jobs)]) == len(made) == 2
        assert comes(lambda: alive() == 1)
    assert comes(lambda: not alive())


@pytest.mark.parametrize("timeout_s", [-1.0, float("nan"), float("inf")])
def test_a_time_out_of_bounds(timeout_s):
    with pytest.raises(ValueError, match="timeout_s is .*; it must be a number from 0 to"):
        Local(timeout_s=timeout_s)


def test_workers_that_are_dropped_leave_no_folder():
    """As where a command is interrupted. A warning would fail the test."""
    workers = Workers(Local(1))
    folder = Path(workers.folder)
    assert folder.is_dir()
    del workers
    assert not folder.exists()
