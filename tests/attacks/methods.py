"""Hostile methods: files that forge, break out, never end, or are not what they should be.

Each is the text of a method file. None can harm the machine it runs on: what they leave behind
ends by itself within a minute, and what they fill or exhaust is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import dedent, indent
from typing import Literal

Expectation = Literal["recorded", "refused", "either", "seen", "ended"]
"""What the suite may come to, every time with nothing forged and nothing left behind:

- ``recorded``: it ends, and the method's runs are in its tables, whatever their status;
- ``refused``: a sentence before anything is run, exit code 2;
- ``either`` of these;
- ``seen``: either, or a folder that is refused when it is read (the method wrote into it);
- ``ended``: also the end of the command itself, which the same command goes on from.
"""

PRELUDE = '''
import atexit, ctypes, gc, hashlib, itertools, json, os, random, resource, signal
import subprocess, sys, threading, time
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

import coartic
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.model import PAPER
from coartic.solution import Execution, Movement

FAR = PAPER._replace(step=1.0)


def honest(session, details=None, **changes):
    """Every goal by the corrective process, with the changes asked for in every movement."""
    hand, q, movements = session.hands[-1], session.q0, []
    for number in range(1, session.goals_count + 1):
        q = session.correct(q, hand, number).q
        movements.append(Movement(**{
            "goal": number, "hand": hand, "kind": "planned", "target": q, **changes
        }))
    return Result(tuple(movements), details or {})


def everywhere(name, value):
    """Replace a name in every module that has it."""
    for module in list(sys.modules.values()):
        if module is not None and name in getattr(module, "__dict__", {}):
            try:
                setattr(module, name, value)
            except Exception:
                pass


def cheap(task, solution, **_):
    """An execution that nobody has to pay for."""
    made = tuple(
        Movement(m.goal, m.hand, "planned", np.array(task.q0), 1) for m in solution
    )
    return Execution(made, np.array([task.q0] * len(task.goals)), len(made), 0)


def results_folder():
    """Where the suite keeps its results: any process may read another's arguments."""
    pid = os.getpid()
    while pid > 1:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\\0")
        if "--out" in words:
            folder = Path(os.readlink(f"/proc/{pid}/cwd")) / words[words.index("--out") + 1]
            assert "coartic-attacks" in str(folder)  # touch nothing else
            return folder
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    raise LookupError("nobody says where")


def suite_process():
    """Process id of the command itself."""
    pid = os.getpid()
    while pid > 1:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\\0")
        if "--out" in words:
            return pid
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    raise LookupError("nobody asked for this")


def sleeper(**options):
    """A process that ends by itself in a minute."""
    return subprocess.Popen(
        [sys.executable, "-c", "import time; time.sleep(60)", "hostile"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **options
    )


def pipes():
    """Descriptors of pipes and sockets that this process has open."""
    for name in os.listdir("/proc/self/fd"):
        try:
            where = os.readlink(f"/proc/self/fd/{name}")
        except OSError:
            continue
        if where.startswith(("pipe:", "socket:")):
            yield int(name)
'''

TEMPLATE = '''"""%(tries)s."""
%(prelude)s

%(before)s


class Hostile(Method):
    name = "hostile"
    title = "Hostile"
    citation = "Nobody (2026)."
    told = frozenset({
        Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL, Information.GOALS,
        Information.FORWARD_KINEMATICS,
    })
    stochastic = True
%(declares)s

    def solve(self, session):
%(solve)s


%(after)s
'''


@dataclass(frozen=True)
class Attack:
    """One hostile method file."""

    id: str
    tries: str
    """What it tries, as the end of "it ..."."""
    source: str
    expects: Expectation
    method: str
    """Name under which the suite asks for it."""
    after_others: bool
    """Whether its runs come after those of the built-in methods, not before."""
    installed: bool
    """Whether it comes as a plug-in (an entry point) instead of a file."""


ATTACKS: dict[str, Attack] = {}


def attack(
    name: str,
    tries: str,
    solve: str = "return honest(session)",
    *,
    before: str = "",
    declares: str = "",
    after: str = "",
    source: str | None = None,
    expects: Expectation = "recorded",
    method: str = "hostile",
    after_others: bool = False,
    installed: bool = False,
) -> None:
    """Add a method file, made of its parts."""
    assert name not in ATTACKS, name
    text = source or TEMPLATE % {
        "tries": tries,
        "prelude": PRELUDE,
        "before": dedent(before).strip("\n"),
        "declares": indent(dedent(declares).strip("\n"), "    "),
        "solve": indent(dedent(solve).strip("\n"), "        "),
        "after": dedent(after).strip("\n"),
    }
    ATTACKS[name] = Attack(name, tries, text, expects, method, after_others, installed)


# Its own score: what scores a solution is within its reach while it runs.

attack(
    "score/model",
    "gives the session another model, which scoring then uses",
    "session.model = session.model._replace(step=1.0)\nreturn honest(session)",
)
attack(
    "score/model-in-place",
    "writes another step size into the memory of the paper's model",
    """
    found = honest(session)
    for model in (PAPER, session.model):
        ctypes.c_double.from_address(id(model.step) + 16).value = 1.0
    return found
    """,
)
attack(
    "score/radius",
    "makes the goals as large as the room, in the task's own dictionary",
    """
    found = honest(session)
    session._task.__dict__["radius"] = 50.0
    return found
    """,
)
attack(
    "score/goals",
    "moves the goals to where the hand is",
    """
    found = honest(session)
    here = tuple(map(float, session.forward_kinematics(session.q0, session.hands[-1])))
    goals = (here,) * session.goals_count
    for thing in gc.get_objects():
        if isinstance(thing, coartic.Task):
            thing.__dict__["goals"] = goals
            thing.__dict__.pop("goal_array", None)
    return found
    """,
)
attack(
    "score/specification",
    "changes every dictionary that looks like a specification's model, to be found by gc",
    """
    for thing in gc.get_objects():
        if type(thing) is dict and "arrival_tolerance" in thing:
            thing["step"] = 1.0
    return honest(session)
    """,
)
attack(
    "score/model-class",
    "has every motion model made from now on take long steps",
    """
    everywhere("MotionModel", lambda *a, **k: FAR)
    everywhere("PAPER", FAR)
    everywhere("checked_model", lambda *a, **k: FAR)
    return honest(session)
    """,
)
attack(
    "score/execute-of-main",
    "replaces the worker's execute",
    'sys.modules["__main__"].execute = cheap\nreturn honest(session)',
)
attack(
    "score/execute",
    "replaces execute in every module",
    'everywhere("execute", cheap)\nreturn honest(session)',
)
attack(
    "score/move",
    "replaces the movement that scoring makes by one that always hits",
    """
    from coartic.movement import MoveResult
    move = coartic.solution.move
    def jump(robot, q, target, *a, **k):
        return move(robot, q, target, *a, **k)._replace(ticks=1, hit=True)
    everywhere("move", jump)
    return honest(session)
    """,
)
attack(
    "score/reward-property",
    "has every execution say -3",
    """
    Execution.reward = property(lambda self: -3)
    Execution.ticks_by_goal = lambda self: (1, 1, 1)
    Execution.completed = property(lambda self: True)
    return honest(session)
    """,
)
attack(
    "score/incomplete",
    "has no solution, and every execution say that it is complete",
    """
    Execution.completed = property(lambda self: True)
    Execution.ticks = property(lambda self: 3, lambda self, value: None)
    return Result((Movement(1, session.hands[-1], "planned", session.q0),))
    """,
)
attack(
    "score/scorer",
    "replaces the worker's scoring",
    """
    score = {"reward": -3, "hands": "RRR", "ticks_by_goal": [1, 1, 1], "corrections": 0,
             "other_arm_travel": 0.0}
    everywhere("_score", lambda *a, **k: ("ok", "", score, []))
    return honest(session)
    """,
)
attack(
    "score/json",
    "has JSON say that every reward is -3",
    """
    import re
    dumps = json.dumps
    json.dumps = lambda *a, **k: re.sub(r'"reward": ?-\\d+', '"reward":-3', dumps(*a, **k))
    return honest(session)
    """,
)
attack(
    "score/encode",
    "replaces the store's writer of records",
    """
    import coartic.benchmarks.store as store
    encode = store.encode
    def forged(record, *a, **k):
        if isinstance(record, dict) and record.get("score"):
            record["score"]["reward"] = -3
        return encode(record, *a, **k)
    everywhere("encode", forged)
    return honest(session)
    """,
)
attack(
    "score/builtins",
    "has every sum be 3",
    "import builtins\nbuiltins.sum = lambda *a, **k: 3\nreturn honest(session)",
)
attack(
    "score/numpy",
    "has every distance be 0",
    """
    np.linalg.norm = lambda *a, **k: 0.0
    everywhere("hypot", lambda *a: 0.0)
    return honest(session)
    """,
)
attack(
    "score/kernel",
    "replaces the compiled kernel of a movement",
    """
    kernel = coartic.movement._move
    def short(*a, **k):
        found = kernel(*a, **k)
        return (*found[:-1], 1) if isinstance(found, tuple) else found
    coartic.movement._move = short
    coartic.movement.scratch_for = lambda *a: None
    return honest(session)
    """,
)
attack(
    "score/frames",
    "writes into the variables of whoever called it",
    """
    frame = sys._getframe(1)
    while frame is not None:
        for name, value in (("model", FAR), ("status", "ok")):
            if name in frame.f_locals:
                frame.f_locals[name] = value
                ctypes.pythonapi.PyFrame_LocalsToFast(ctypes.py_object(frame), ctypes.c_int(0))
        frame.f_globals["execute"] = cheap
        frame = frame.f_back
    return honest(session)
    """,
)
attack(
    "score/profiler",
    "leaves a profiler behind that changes what functions see",
    """
    def spy(frame, event, argument):
        if frame.f_code.co_name == "execute":
            frame.f_globals["PAPER"] = FAR
            frame.f_globals["move"] = None
    sys.setprofile(spy)
    threading.setprofile(spy)
    return honest(session)
    """,
)
attack(
    "score/later",
    "leaves a thread and an alarm behind that replace execute when it has returned",
    """
    def soon():
        for _ in range(2000):
            everywhere("execute", cheap)
            time.sleep(0.001)
    threading.Thread(target=soon, daemon=True).start()
    signal.signal(signal.SIGALRM, lambda *_: everywhere("execute", cheap))
    signal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)
    return honest(session)
    """,
)
attack(
    "score/session",
    "has its session say that nothing was spent and every trial was perfect",
    """
    found = honest(session)
    session._rewards[:] = [-1] * 5
    session._meter.trials = -5
    session._used.clear()
    type(session).rewards = property(lambda self: [-1] * 10**6)
    return found
    """,
)

# Solutions that change while they are looked at, or are none.

attack(
    "solution/result-changes",
    "returns a result whose solution is another one every time",
    """
    good = honest(session)
    looks = itertools.count()
    class Changing(Result):
        @property
        def solution(self):
            return good.solution if next(looks) % 2 else good.solution[:1]
        @solution.setter
        def solution(self, value):
            pass
    try:
        return Changing(good.solution)
    except Exception:
        return object.__new__(Changing)
    """,
)
attack(
    "solution/list-changes",
    "returns a list that is another one every time it is gone through",
    """
    good = honest(session)
    class Changing(list):
        def __iter__(self):
            here = Movement(1, session.hands[-1], "planned", session.q0)
            return iter([here, *good.solution] if random.random() < 0.5 else good.solution)
    return Result(Changing(good.solution))
    """,
)
attack(
    "solution/endless",
    "returns a solution without an end",
    """
    first = honest(session).solution[0]
    resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))
    return Result(itertools.repeat(first))
    """,
)
attack(
    "solution/long",
    "returns 200 000 movements that get nowhere",
    """
    good, q = honest(session).solution, session.q0
    away = q.copy()
    away[0] -= 0.001
    stay = [Movement(1, session.hands[-1], "planned", p) for p in (away, q)] * 100_000
    return Result((*stay, *good))
    """,
)
attack(
    "solution/far",
    "aims so far away that the way there takes a hundred years",
    "return honest(session, target=session.q0 + 1e12)",
)
attack(
    "solution/farthest",
    "aims at the largest number there is",
    "return honest(session, target=np.full(session.dof, 1.7e308))",
)
attack(
    "solution/waypoints",
    "follows ten million waypoints",
    """
    resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))
    points = np.broadcast_to(session.q0, (10**7, session.dof))
    return honest(session, kind="path", target=None, waypoints=points)
    """,
)
attack(
    "solution/nan",
    "aims at nothing that is a number",
    "return honest(session, target=np.full(session.dof, np.nan))",
)
attack(
    "solution/moving-target",
    "has targets that are elsewhere every time",
    """
    class Moving(Movement):
        @property
        def target(self):
            return session.q0 + next(STEPS) * 0.1
        @target.setter
        def target(self, value):
            pass
    hand = session.hands[-1]
    moves = []
    for number in range(1, session.goals_count + 1):
        one = object.__new__(Moving)
        one.__dict__.update(goal=number, hand=hand, kind="planned", ticks=None, waypoints=None)
        moves.append(one)
    return Result(tuple(moves))
    """,
    before="STEPS = itertools.count()",
)
attack(
    "solution/changing-hand",
    "has movements whose goal and kind are others every time",
    """
    good = honest(session).solution
    class Shifty(Movement):
        def __getattribute__(self, name):
            value = super().__getattribute__(name)
            if name == "ticks":
                return 0
            if name == "kind" and next(STEPS) % 3 == 0:
                return "corrective"
            return value
    return Result(tuple(Shifty(m.goal, m.hand, m.kind, m.target) for m in good))
    """,
    before="STEPS = itertools.count()",
)
attack(
    "solution/array",
    "has targets that say other numbers when they are stored than when they are executed",
    """
    class Liar(np.ndarray):
        def tolist(self):
            return [0.0] * self.size
        def __array_finalize__(self, other):
            pass
    good = honest(session).solution
    return Result(tuple(Movement(m.goal, m.hand, m.kind, m.target.view(Liar)) for m in good))
    """,
)
attack(
    "solution/array-like",
    "has targets that turn into other arrays every time",
    """
    class Array:
        shape, ndim, size, dtype = (session.dof,), 1, session.dof, np.dtype(float)
        def __array__(self, dtype=None, copy=None):
            return session.q0 + 0.1 * next(STEPS)
        def __len__(self):
            return session.dof
    return honest(session, target=Array())
    """,
    before="STEPS = itertools.count()",
)
attack(
    "solution/float",
    "has targets of floats that are others every time",
    """
    class Float(float):
        def __float__(self):
            return float.__add__(self, next(STEPS) * 0.01)
        def __repr__(self):
            return "0.0"
    good = honest(session).solution
    return Result(tuple(
        Movement(m.goal, m.hand, m.kind, [Float(x) for x in m.target]) for m in good
    ))
    """,
    before="STEPS = itertools.count()",
)
attack(
    "solution/text",
    "has hands and kinds that are equal to everything",
    """
    class Any(str):
        def __eq__(self, other):
            return True
        def __ne__(self, other):
            return False
        __hash__ = str.__hash__
    return honest(session, hand=Any("third"), kind=Any("teleport"))
    """,
)
attack(
    "solution/pretends",
    "returns things that say they are movements",
    """
    class Pretender:
        __class__ = Movement
        goal, hand, kind, target, waypoints, ticks = 1, "right", "planned", None, None, -9
    return Result(tuple(Pretender() for _ in range(session.goals_count)))
    """,
)
attack(
    "solution/teleport",
    "makes movements of a kind of its own",
    'return honest(session, kind="teleport")',
)
attack(
    "solution/ticks",
    "says itself what its movements took: less than nothing",
    "return honest(session, ticks=-1000)",
)
attack(
    "solution/ticks-nan",
    "says itself what its movements took: no number",
    'return honest(session, ticks=float("nan"))',
)
attack(
    "solution/ticks-huge",
    "says itself what its movements took: more than fits",
    "return honest(session, ticks=-(10**30))",
)
attack("solution/none", "returns nothing", "return None")
attack("solution/goal", "hits a goal that is not there", "return honest(session, goal=-1)")

# Its neighbours: what the next method's run, or the harness, will use.

attack(
    "neighbour/import-execute",
    "replaces execute everywhere while it is imported",
    before='everywhere("execute", cheap)',
)
attack(
    "neighbour/import-learner",
    "spoils the learner while it is imported",
    before="""
    from coartic.dual_process import DualProcess
    DualProcess.solve = lambda self, session: honest(session)
    """,
)
attack(
    "neighbour/import-model",
    "replaces the paper's model while it is imported",
    before='everywhere("PAPER", FAR)',
)
attack(
    "neighbour/import-tables",
    "replaces what makes the rows of tables while it is imported",
    before="""
    import coartic.tables as tables
    row = tables._run_row
    def forged(*a, **k):
        found = row(*a, **k)
        found["reward"] = -3
        return found
    everywhere("_run_row", forged)
    """,
)
attack(
    "neighbour/import-registry",
    "replaces a built-in method in the registry while it is imported",
    before="""
    import coartic.benchmarks.registry as methods
    def worse(self, session):
        return honest(session)
    for built_in in methods.BUILT_IN:
        built_in.solve = worse
    """,
)
attack(
    "neighbour/metaclass",
    "spoils the learner while its class is made",
    before="""
    from abc import ABCMeta
    from coartic.dual_process import DualProcess
    class Meta(ABCMeta):
        def __new__(mcs, name, bases, space, **k):
            DualProcess.solve = lambda self, session: honest(session)
            return super().__new__(mcs, name, bases, space, **k)
    class Base(Method, metaclass=Meta):
        pass
    """,
    after="""
    class Other(Base):
        name, title, citation, told = "hostile-2", "Other", "Nobody (2026).", Hostile.told
        def solve(self, session):
            return honest(session)
    """,
)
attack(
    "neighbour/init-subclass",
    "has every later method class be spoilt",
    before="""
    def spoil(cls, **k):
        coartic.solution.execute = cheap
        everywhere("execute", cheap)
    Method.__init_subclass__ = classmethod(spoil)
    """,
)
attack(
    "neighbour/why-not",
    "spoils the learner when it is asked whether it applies to a task",
    declares="""
    def why_not(self, task):
        from coartic.dual_process import DualProcess
        DualProcess.solve = lambda self, session: honest(session)
        everywhere("execute", cheap)
        return None
    """,
)
attack(
    "neighbour/why-not-task",
    "moves the goals of the task when it is asked whether it applies to it",
    declares="""
    def why_not(self, task):
        task.__dict__["radius"] = 3.0
        task.__dict__["goals"] = tuple((x - 2.0, y) for x, y in task.goals)
        task.__dict__.pop("goal_array", None)
        return None
    """,
)
attack(
    "neighbour/validator",
    "spoils the learner while its parameters are checked",
    before="""
    class Spoiling(Parameters):
        speed: int = 1

        @model_validator(mode="after")
        def spoil(self):
            from coartic.dual_process import DualProcess
            DualProcess.solve = lambda self, session: honest(session)
            everywhere("execute", cheap)
            return self
    """,
    declares="Parameters = Spoiling",
)
attack(
    "neighbour/solve-learner",
    "spoils the learner while it solves",
    """
    from coartic.dual_process import DualProcess
    DualProcess.solve = lambda self, session: honest(session)
    return honest(session)
    """,
)
attack(
    "neighbour/rng",
    "takes the dice of everyone who comes after it",
    """
    fixed = np.random.default_rng(7)
    np.random.default_rng = lambda *a, **k: fixed
    return honest(session)
    """,
)
attack(
    "neighbour/corrective",
    "replaces the corrective process of everyone who comes after it",
    """
    found = honest(session)
    right = coartic.corrective.correct
    def wrong(robot, q, hand, goal, **k):
        return right(robot, np.asarray(q) + 0.1, hand, goal, **k)
    everywhere("correct", wrong)
    return found
    """,
)
attack(
    "neighbour/surroundings",
    "changes folder, file mode, locale, error handling, recursion and warnings for all",
    """
    import decimal, locale, warnings
    os.umask(0o777)
    os.chdir("/")
    np.seterr(all="raise")
    np.set_printoptions(precision=1)
    warnings.simplefilter("error")
    sys.setrecursionlimit(120)
    decimal.getcontext().prec = 1
    random.seed(1)
    np.random.seed(1)
    gc.disable()
    os.environ.clear()
    return honest(session)
    """,
)
attack(
    "neighbour/surroundings-at-import",
    "changes folder, file mode, error handling and environment of all while it is imported",
    before="""
    os.umask(0o777)
    os.chdir("/tmp")
    np.seterr(all="raise")
    os.environ["TMPDIR"] = "/nowhere"
    os.environ["PYTHONPATH"] = "/nowhere"
    """,
)
attack(
    "neighbour/modules",
    "takes modules away from everyone who comes after it",
    """
    found = honest(session)
    for name in ("coartic.baselines.random_search", "coartic.learner", "json", "numpy"):
        sys.modules[name] = None
    return found
    """,
)
attack(
    "neighbour/shadow",
    "puts a module named json before everyone else's",
    before="""
    here = Path.cwd() / "shadow"
    here.mkdir(exist_ok=True)
    (here / "tomllib.py").write_text("raise SystemExit('shadowed')")
    (here / "hashlib.py").write_text("raise SystemExit('shadowed')")
    sys.path.insert(0, str(here))
    os.environ["PYTHONPATH"] = f"{here}:{os.environ.get('PYTHONPATH', '')}"
    """,
)
attack(
    "neighbour/answer",
    "answers for the harness on every pipe that it finds open, a record of -3 in hand",
    """
    score = {"reward": -3, "hands": "RRR", "ticks_by_goal": [1, 1, 1], "corrections": 0,
             "other_arm_travel": 0.0}
    for thing in gc.get_objects():
        if type(thing) is dict and "run_id" in thing and "specification" in thing:
            record = {
                "run_id": thing["run_id"], "run": thing.get("run", 0),
                "specification": thing["specification"], "code": thing.get("code", ""),
                "status": "ok", "reason": "", "score": score, "solution": [], "told": [],
                "secondary": [], "used": [], "meter": None, "details": {}, "rewards": [],
                "timing": {"wall_s": 0, "cpu_s": 0, "warm": True, "process_peak_mb": 1,
                           "time_limit_s": 600}, "origin": thing.get("origin", "built in"),
                "environment": {"commit": None, "python": "3", "packages": {}},
            }
            answer = {"answer": {"timing": record["timing"], "runs": [record],
                                 "environment": record["environment"]}}
            lines = {"status": "ok"}, record, answer
            text = "".join(f"{json.dumps(line)}\\n" for line in lines).encode()
            break
    for fd in pipes():
        try:
            os.set_blocking(fd, False)
            os.write(fd, text)
        except OSError:
            pass
    time.sleep(0.2)
    return honest(session)
    """,
)
attack(
    "neighbour/answers-twice",
    "answers again and again on every pipe, so that later jobs are answered before they run",
    """
    for fd in pipes():
        try:
            os.set_blocking(fd, False)
            os.write(fd, (b'{"status": "ok"}\\n' + b'{"forged": true}\\n') * 20)
        except OSError:
            pass
    return honest(session)
    """,
)
attack(
    "neighbour/garbage",
    "writes a megabyte without a line's end into every pipe",
    """
    for fd in pipes():
        try:
            os.set_blocking(fd, False)
            for _ in range(16):
                os.write(fd, b"\\xff\\x00[{" * 16384)
        except OSError:
            pass
    return honest(session)
    """,
)
attack(
    "neighbour/reads-jobs",
    "reads the jobs that are meant for others",
    """
    for fd in pipes():
        try:
            os.set_blocking(fd, False)
            os.read(fd, 1 << 20)
        except OSError:
            pass
    return honest(session)
    """,
)
attack(
    "neighbour/record",
    "rewrites the records of others, with a good checksum",
    """
    for path in (results_folder() / "records").glob("*.pack"):
        text, common = b"", b""
        for line in path.read_bytes().splitlines():
            name, _, body = line.split(b" ", 2)
            if name != b"common":
                record = json.loads(body)
                if record.get("solution"):
                    record["solution"]["reward"] = -3
                    record["solution"]["ticks_by_goal"] = [1, 1, 1]
                body = json.dumps(record).encode()
            checked = body if name == b"common" else common + b"\\n" + body
            common = body if name == b"common" else common
            text += b" ".join([name, hashlib.sha256(checked).hexdigest().encode(), body]) + b"\\n"
        path.write_bytes(text)
    return honest(session)
    """,
    expects="seen",
    after_others=True,
)
attack(
    "neighbour/records-gone",
    "deletes the records of others",
    """
    for path in (results_folder() / "records").glob("*.pack"):
        path.unlink()
    return honest(session)
    """,
    expects="seen",
    after_others=True,
)
attack(
    "neighbour/records-link",
    "puts a link to elsewhere in the place of the records",
    """
    records = results_folder() / "records"
    elsewhere = records.with_name("elsewhere")
    if not records.is_symlink():
        records.rename(elsewhere)
        records.symlink_to("/nowhere")
    return honest(session)
    """,
    expects="seen",
    after_others=True,
)
attack(
    "neighbour/lock",
    "takes the lock of the folder in a process that stays",
    """
    import fcntl
    if os.fork() == 0:
        os.setsid()
        lock = open(results_folder() / "records" / ".lock", "ab")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            pass
        time.sleep(60)
        os._exit(0)
    return honest(session)
    """,
)
attack(
    "neighbour/tables-later",
    "leaves a process behind that rewrites the tables when they are there",
    """
    if os.fork() == 0:
        os.setsid()
        table = results_folder() / "methods.csv"
        for _ in range(300):
            if table.exists():
                table.write_text("forged")
                (table.parent / "runs.parquet").write_bytes(b"forged")
            time.sleep(0.1)
        os._exit(0)
    return honest(session)
    """,
    expects="seen",
)
attack(
    "neighbour/at-exit",
    "has something to do when the command ends",
    before="""
    def last():
        (results_folder() / "runs.parquet").write_bytes(b"forged")
        os._exit(0)
    atexit.register(last)
    """,
)

# Names that mean something.

attack(
    "name/learner",
    "calls itself a condition of the learner",
    'return honest(session, {"replay_reward": "x", "best_trial": "third"})',
    declares='name = "dual-process/EC9"',
    method="dual-process/EC9",
    expects="refused",
)
attack(
    "name/optimum",
    "calls itself the optimum",
    'return honest(session, {"proven_bound": -319})',
    declares='name = "optimum/mine"',
    method="optimum/mine",
    expects="refused",
)
attack(
    "name/taken",
    "takes the name of the learner's first condition",
    declares='name = "dual-process/EC1"',
    method="dual-process/EC2",
    expects="refused",
)
attack(
    "name/escape",
    "puts an escape sequence into its name",
    declares='name = "hos\\x1b[2Jtile"',
    expects="refused",
)
attack(
    "name/lines",
    "puts a line's end, HTML and a pipe into its name",
    declares='name = "a\\x0b|<script>alert(1)</script>"',
    expects="refused",
)
attack(
    "name/path",
    "calls itself a way out of the folder",
    declares='name = "../../../etc"',
    method="../../../etc",
    expects="either",
)
attack(
    "name/right-to-left",
    "has a name that turns the direction of writing",
    declares='name = "\\u202eelitsoh"',
    expects="refused",
)
attack(
    "name/long",
    "has a name of 100 000 letters",
    declares='name = "h" * 100_000',
    expects="refused",
)
attack(
    "name/random",
    "has another name every time it is imported",
    declares='name = f"hostile-{os.urandom(4).hex()}"',
    after='class Steady(Hostile):\n    name = "hostile"',
    expects="either",
)
attack(
    "name/property",
    "has a name that is computed anew every time",
    before="""
    class Meta(type(Method)):
        name = property(lambda cls: f"hostile{next(cls.counter)}")
        counter = itertools.count()
    class Base(Method, metaclass=Meta):
        def solve(self, session):
            return honest(session)
    """,
    declares="",
    after="""
    class Changing(Base):
        title, citation, told = "Changing", "Nobody (2026).", frozenset()
    """,
    expects="either",
)
attack(
    "name/str",
    "has a name that is a text of a class of its own",
    before="""
    class Name(str):
        def __eq__(self, other):
            return True
        def __hash__(self):
            return hash("dual-process/EC1")
        def startswith(self, *a):
            return False
    """,
    declares='name = Name("hostile")',
    expects="either",
)
attack("name/number", "has a number for a name", declares="name = 7", expects="refused")
attack(
    "title/escape",
    "puts escape sequences, lines and HTML into its title",
    declares='title = "\\x1b]0;owned\\x07 a\\nb <script>alert(1)</script>"',
    expects="either",
)
attack("title/long", "has a title of a megabyte", declares='title = "t" * 2**20', expects="either")
attack("title/none", "has no title", declares="title = None", expects="refused")
attack("citation/bytes", "has bytes for a citation", declares='citation = b"x"', expects="refused")
attack("told/text", "says in a word what it is told", declares='told = "goals"', expects="refused")
attack("told/none", "is told None", declares="told = None", expects="refused")
attack(
    "told/endless",
    "is told without an end",
    declares="told = itertools.repeat(Information.GOALS)",
    expects="refused",
)
attack(
    "told/unknown",
    "is told what does not exist",
    declares='told = frozenset({"everything, <b>really</b>"})',
    expects="refused",
)
attack(
    "told/mutated",
    "takes back what it was told while it works",
    """
    found = honest(session)
    Hostile.told = frozenset()
    object.__setattr__(session, "_told", frozenset())
    return found
    """,
)
attack(
    "secondary/types",
    "has secondary objectives that are no words",
    declares="secondary = (b'x', 7, ['y'])",
    expects="refused",
)
attack(
    "stochastic/property",
    "is stochastic or not, every time another",
    before="""
    class Coin:
        def __get__(self, instance, owner):
            return os.urandom(1)[0] % 2 == 0
    """,
    declares="stochastic = Coin()",
    expects="either",
)
attack(
    "stochastic/text", "is stochastic perhaps", declares='stochastic = "perhaps"', expects="either"
)
attack(
    "why-not/number",
    "gives a number for a reason",
    declares="def why_not(self, task):\n    return 5",
    expects="refused",
)
attack(
    "why-not/exit",
    "ends the program when it is asked whether it applies to a task",
    declares="def why_not(self, task):\n    sys.exit(0)",
    expects="refused",
)
attack(
    "why-not/loop",
    "never says whether it applies to a task",
    declares="def why_not(self, task):\n    while True:\n        pass",
    expects="either",
)
attack(
    "why-not/flood",
    "gives a reason of 50 MB with escape sequences",
    declares='def why_not(self, task):\n    return "\\x1b[2J" * 10_000_000',
    expects="refused",
)
attack(
    "why-not/moods",
    "applies to a task every other time",
    declares="""
    def why_not(self, task):
        return None if os.urandom(1)[0] % 2 else "not today"
    """,
    expects="either",
)

# Parameters.

attack(
    "parameters/object",
    "has a default that is no plain data",
    before="""
    class Odd(Parameters):
        model_config = ConfigDict(arbitrary_types_allowed=True)
        thing: object = object()
    """,
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/nan",
    "has a default that is no number",
    before='class Odd(Parameters):\n    speed: float = float("nan")',
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/drawn",
    "has a default that is drawn every time",
    before="""
    class Odd(Parameters):
        seed: float = Field(default_factory=lambda: os.urandom(1)[0] / 7)
    """,
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/large",
    "has a default of 50 MB",
    before='class Odd(Parameters):\n    text: str = "p" * 50_000_000',
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/surrogate",
    "has a default that cannot be written as UTF-8",
    before='class Odd(Parameters):\n    text: str = "\\ud800"',
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/dump",
    "has parameters that say other values when they are written down",
    before="""
    class Odd(Parameters):
        speed: int = 1
        def model_dump(self, **k):
            return {"speed": 99, "\\x1b[2J": [1] * 10}
    """,
    declares="Parameters = Odd",
    expects="either",
)
attack(
    "parameters/none", "has no Parameters at all", declares="Parameters = None", expects="refused"
)
attack(
    "parameters/dict", "has a dict for Parameters", declares="Parameters = dict", expects="refused"
)
attack(
    "parameters/fields",
    "has fields that are others every time",
    before="""
    class Odd(Parameters):
        speed: int = 1
    class Fields(dict):
        def __contains__(self, key):
            return True
        def __iter__(self):
            return iter(["a", "\\x1b[2J", 7])
    Odd.__pydantic_fields__ = Fields(Odd.__pydantic_fields__)
    """,
    declares="Parameters = Odd",
    expects="either",
)

# Details and reasons.

attack("details/list", "has a list of details", "return Result(honest(session).solution, [1])")
attack("details/keys", "has keys that are no text", "return honest(session, {1: 2, None: 3})")
attack(
    "details/deep",
    "has details a million levels deep",
    """
    deep = leaf = {}
    for _ in range(1_000_000):
        leaf["a"] = leaf = {}
    return honest(session, deep)
    """,
)
attack(
    "details/nested",
    "has details 900 levels deep, which some readers take and others do not",
    """
    deep = 0
    for _ in range(900):
        deep = [deep]
    return honest(session, {"deep": deep})
    """,
)
attack(
    "details/integer",
    "has an integer of 5000 digits",
    'return honest(session, {"value": 1 << 16000})',
)
attack(
    "details/large",
    "has details of 100 MB",
    'return honest(session, {"text": "d" * 100_000_000})',
)
attack(
    "details/many",
    "has a million details",
    "return honest(session, {str(n): n for n in range(1_000_000)})",
)
attack("details/bytes", "has bytes in its details", 'return honest(session, {"value": b"x"})')
attack(
    "details/surrogate",
    "has text that cannot be written as UTF-8",
    'return honest(session, {"value": "\\ud800", "\\udfff": 1})',
)
attack(
    "details/escape",
    "has escape sequences and HTML in its details",
    'return honest(session, {"\\x1b[2J": "\\x1b]0;owned\\x07</script><script>alert(1)//"})',
)
attack("details/nan", "has NaN in it", 'return honest(session, {"value": float("nan")})')
attack(
    "details/changing",
    "has a dict that is another one every time",
    """
    class Changing(dict):
        def items(self):
            return iter([(f"key{next(STEPS)}", next(STEPS))])
    return honest(session, Changing(a=1))
    """,
    before="STEPS = itertools.count()",
)
for _id, _value in {
    "text": '"none"',
    "below": "-1000",
    "own": "-319",
    "float": "-319.5",
    "huge": "-(10**30)",
    "true": "True",
    "list": "[-292]",
    "zero": "0",
}.items():
    attack(
        f"bound/{_id}",
        f"says that it has proven a bound: {_value}",
        f'return honest(session, {{"proven_bound": {_value}}})',
    )
attack(
    "details/learner",
    "has details named like the learner's columns, of wrong types",
    """return honest(session, {
        "replay_reward": "x", "initial_reward": [1], "best_trial": {}, "initial_hands": 7,
        "replay_hands": None, "reward": -3, "status": "ok", "run_id": "x",
    })""",
)
attack(
    "reason/escape",
    "fails with escape sequences, lines and HTML",
    'raise MethodError("infeasible", "\\x1b[2J\\x1b]0;owned\\x07\\n\\r<script>|\\u202e")',
)
attack("reason/long", "fails with 50 MB", 'raise ValueError("e" * 50_000_000)')
attack(
    "reason/surrogate",
    "fails with what cannot be written as UTF-8",
    'raise MethodError("infeasible", "\\ud800")',
)
attack(
    "reason/number",
    "fails with a number, and details that are none",
    'raise MethodError("infeasible", 5, [1, {2}])',
)
attack(
    "reason/status",
    "fails with an outcome of its own",
    """
    error = MethodError("infeasible", "x")
    error.outcome = "ok"
    raise error
    """,
)
attack(
    "reason/status-type",
    "fails with an outcome that is no text",
    """
    error = MethodError("infeasible", "x")
    error.outcome = ["timeout", "\\x1b[2J"]
    error.details = "text"
    raise error
    """,
)
attack(
    "reason/str",
    "fails with an error that cannot be told",
    """
    class Untold(Exception):
        def __str__(self):
            raise SystemExit(0)
    raise Untold()
    """,
)

# The end of a process, and what is left of it.

attack("end/sys-exit", "exits as if all were well", "sys.exit(0)")
attack("end/exit", "exits at once as if all were well", "os._exit(0)")
attack("end/abort", "aborts", "os.abort()")
attack("end/segfault", "reads where nothing is", "ctypes.string_at(0)")
attack("end/sigkill", "kills itself", "os.kill(os.getpid(), signal.SIGKILL)")
attack("end/sigstop", "stops itself", "os.kill(os.getpid(), signal.SIGSTOP)\nos._exit(0)")
attack("end/group", "kills its process group", "os.killpg(0, signal.SIGKILL)")
attack("end/interrupt", "raises KeyboardInterrupt", "raise KeyboardInterrupt")
attack("end/generator-exit", "raises GeneratorExit", "raise GeneratorExit")
attack(
    "end/base",
    "raises what is no Exception and cannot be told",
    """
    class Base(BaseException):
        def __str__(self):
            raise RuntimeError("no")
        __repr__ = __str__
    raise Base
    """,
)
attack(
    "end/code",
    "exits with a code that is no number",
    """
    class Code:
        def __str__(self):
            os._exit(0)
    raise SystemExit(Code())
    """,
)
attack(
    "end/foreign",
    "raises the harness's own error for other code",
    """
    import coartic.benchmarks.worker
    for module in (sys.modules["__main__"], coartic.benchmarks.worker):
        error = getattr(module, "ForeignCodeError", None)
        if error is not None:
            raise error("hostile")
    raise coartic.CoarticError("hostile")
    """,
)
attack("end/recursion", "calls itself for ever", "return self.solve(session)")
attack("end/loop", "never returns", "while True:\n    pass")
attack(
    "end/deaf",
    "never returns, deaf to signals and without letting go of the interpreter",
    """
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)
    return 7 ** (10 ** 9)
    """,
)
attack("end/descriptors", "closes every descriptor", "os.closerange(0, 256)\nreturn None")
attack(
    "end/output",
    "closes what it could answer on, and goes on",
    """
    for fd in pipes():
        os.close(fd)
    time.sleep(60)
    """,
)
attack(
    "end/parent",
    "kills the process that started it",
    "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(1)\nreturn honest(session)",
    expects="ended",
)
attack(
    "end/suite",
    "kills the command itself",
    "os.kill(suite_process(), signal.SIGKILL)\ntime.sleep(1)\nreturn honest(session)",
    expects="ended",
)
attack(
    "end/suite-interrupt",
    "interrupts the command",
    "os.kill(suite_process(), signal.SIGINT)\ntime.sleep(1)\nreturn honest(session)",
    expects="ended",
)
attack(
    "end/suite-stop",
    "stops the command",
    "os.kill(suite_process(), signal.SIGSTOP)\ntime.sleep(1)\nreturn honest(session)",
    expects="ended",
)
attack(
    "end/suite-terminate",
    "terminates the command",
    "os.kill(suite_process(), signal.SIGTERM)\ntime.sleep(1)\nreturn honest(session)",
    expects="ended",
)
attack(
    "left/thread",
    "leaves a thread behind",
    "threading.Thread(target=time.sleep, args=(60,)).start()\nreturn honest(session)",
)
attack("left/child", "leaves a process behind", "sleeper()\nreturn honest(session)")
attack(
    "left/session",
    "leaves a process with a session of its own behind",
    "sleeper(start_new_session=True)\nreturn honest(session)",
)
attack(
    "left/daemon",
    "leaves a daemon behind: forked twice, own session, deaf, not told when its parent dies",
    """
    if os.fork() == 0:
        os.setsid()
        ctypes.CDLL(None).prctl(1, 0, 0, 0, 0)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        if os.fork() == 0:
            os.closerange(0, 256)
            time.sleep(60)
        os._exit(0)
    return honest(session)
    """,
)
attack(
    "left/daemon-on-crash",
    "leaves a daemon behind and ends at once",
    "sleeper(start_new_session=True)\nos._exit(3)",
)
attack(
    "left/daemon-on-timeout",
    "leaves a daemon behind and never returns",
    "sleeper(start_new_session=True)\ntime.sleep(60)",
)
attack(
    "left/daemon-holds-pipes",
    "leaves a daemon behind that holds every pipe open, and ends at once",
    """
    if os.fork() == 0:
        os.setsid()
        time.sleep(60)
        os._exit(0)
    os._exit(3)
    """,
)
attack(
    "left/many",
    "leaves a hundred processes behind, each with a session of its own",
    """
    for _ in range(100):
        if os.fork() == 0:
            os.setsid()
            time.sleep(60)
            os._exit(0)
    return honest(session)
    """,
)
attack(
    "left/chain",
    "leaves a process behind that goes on in another one four times a second",
    """
    if os.fork() == 0:
        until = time.monotonic() + 30
        while time.monotonic() < until:
            os.setsid() if os.getsid(0) != os.getpid() else None
            time.sleep(0.25)
            if os.fork():
                os._exit(0)
        os._exit(0)
    return honest(session)
    """,
)
attack(
    "exhaust/memory",
    "takes all the memory it gets",
    """
    resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))
    taken = []
    while True:
        taken.append(bytearray(2**26))
    """,
)
attack(
    "exhaust/memory-kept",
    "keeps the memory that it takes from everyone who comes after it",
    """
    resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30, 3 * 2**30))
    sys.modules["hostile_kept"] = taken = []
    try:
        while True:
            taken.append(bytearray(2**20))
    except MemoryError:
        pass
    return Result(())
    """,
)
attack(
    "exhaust/limits",
    "leaves no time, no file and no process to anyone who comes after it",
    """
    found = honest(session)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (30, 30))
    return found
    """,
)
attack(
    "exhaust/disk",
    "fills its folder for temporary files",
    """
    import tempfile
    with open(os.path.join(tempfile.gettempdir(), "large"), "wb") as file:
        for _ in range(60):
            file.write(bytes(2**20))
    return honest(session)
    """,
)
attack(
    "exhaust/output",
    "says 50 MB",
    'for _ in range(50):\n    print("o" * 2**20)\nreturn honest(session)',
)
attack(
    "exhaust/errors",
    "says 50 MB of escape sequences in one line, and ends",
    'os.write(2, b"\\x1b[2J\\xff" * 10_000_000)\nos._exit(7)',
)

# While it is imported.

attack("import/exit-0", "exits while it is imported", before="sys.exit(0)", expects="refused")
attack("import/exit-1", "exits while it is imported", before="sys.exit(1)", expects="refused")
attack(
    "import/exit-own",
    "exits in a way of its own while it is imported",
    before="""
    class Exit(SystemExit):
        code = property(lambda self: 0)
    raise Exit
    """,
    expects="refused",
)
attack(
    "import/interrupt",
    "interrupts while it is imported",
    before="raise KeyboardInterrupt",
    expects="refused",
)
attack("import/end", "ends at once while it is imported", before="os._exit(0)", expects="refused")
attack(
    "import/base",
    "raises what is no Exception while it is imported",
    before="class Base(BaseException):\n    pass\nraise Base",
    expects="refused",
)
attack(
    "import/loop",
    "never ends being imported",
    before="while True:\n    time.sleep(0.01)",
    expects="refused",
)
attack(
    "import/segfault",
    "reads where nothing is while it is imported",
    before="ctypes.string_at(0)",
    expects="refused",
)
attack(
    "import/stop",
    "stops its process while it is imported",
    before="os.kill(os.getpid(), signal.SIGSTOP)",
    expects="either",
)
attack(
    "import/fork",
    "comes back twice from being imported",
    before="os.fork()",
    expects="either",
)
attack(
    "import/daemon",
    "leaves a daemon behind while it is imported",
    before="sleeper(start_new_session=True)",
)
attack(
    "import/thread",
    "leaves a thread behind while it is imported",
    before="threading.Thread(target=time.sleep, args=(60,)).start()",
    expects="either",
)
attack(
    "import/flood",
    "says 50 MB while it is imported",
    before='for _ in range(50):\n    print("o" * 2**20)',
    expects="either",
)
attack(
    "import/closes",
    "closes every descriptor while it is imported",
    before="os.closerange(0, 256)",
    expects="either",
)
attack(
    "import/answer",
    "answers for whoever describes it, on every pipe, while it is imported",
    before="""
    for fd in pipes():
        try:
            os.set_blocking(fd, False)
            os.write(fd, b'ready\\n{"status": "ok", "methods": [], "names": []}\\n[]\\n' * 3)
        except OSError:
            pass
    """,
    expects="either",
)
attack(
    "import/second-time",
    "is another method when it is imported for the second time",
    before="""
    flag = Path.cwd() / "second"
    second, _ = flag.exists(), flag.touch()
    """,
    declares="""
    name = "dual-process/EC1" if second else "hostile"
    title = "\\x1b[2J" if second else "Hostile"
    told = "everything" if second else frozenset({Information.CORRECTIVE_PROCESS})
    """,
    expects="either",
)
attack(
    "import/twice",
    "defines two methods of one name",
    after="class Other(Hostile):\n    pass",
    expects="refused",
)
attack(
    "import/many",
    "defines 3000 methods",
    after="""
    for number in range(3000):
        globals()[f"Hostile{number}"] = type(f"Hostile{number}", (Hostile,), {
            "name": f"hostile{number}", "__module__": __name__})
    """,
    expects="either",
)
attack("import/nothing", "defines no method", source="x = 1\n", expects="refused")
attack(
    "import/brackets",
    "cannot be parsed for its brackets",
    source="(" * 100_000 + "\n",
    expects="refused",
)
attack("import/nul", "holds a byte that no source has", source="x = 1\0\n", expects="refused")

# As an installed plug-in: every command imports it unasked.

attack(
    "plugin/execute",
    "as a plug-in, replaces execute everywhere while it is imported",
    before='everywhere("execute", cheap)',
    installed=True,
)
attack(
    "plugin/model",
    "as a plug-in, gives the session another model",
    "session.model = session.model._replace(step=1.0)\nreturn honest(session)",
    installed=True,
)
attack(
    "plugin/learner",
    "as a plug-in, calls itself a condition of the learner",
    declares='name = "dual-process/EC9"',
    method="dual-process/EC9",
    expects="refused",
    installed=True,
)
attack(
    "plugin/exit",
    "as a plug-in, exits while it is imported",
    before="sys.exit(0)",
    expects="refused",
    installed=True,
)
attack(
    "plugin/loop",
    "as a plug-in, never ends being imported",
    before="while True:\n    time.sleep(0.01)",
    expects="refused",
    installed=True,
)
