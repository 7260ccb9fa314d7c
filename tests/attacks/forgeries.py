"""Forged records: something changed, the checksum made anew, and the tables made again from them.

The forger's second step is the suite's own command, which finds every run there and rewrites
the tables. It held where a command refuses the folder, or where the forged run was performed
again, so that the folder says what it said before.
"""

from __future__ import annotations

import copy
import math
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from tests.support.packs import pack_of, read_pack, records_of, write_pack

from .checkout import Driver
from .edits import SUITE, Command, accepted, at, finished, method_of, other

Record = dict[str, Any]
LEARNER, PATHS = "dual-process/EC1", "nullspace-qp/none"
GIVEN, OPTIMUM = "corrective-alone/given", "optimum/branch-and-bound"
MAY_DIFFER = {"wall_s", "cpu_s", "build_s", "solve_s", "warm", "together", "process_peak_mb"}
"""Columns in which a run that was performed again may differ from the first time."""


@dataclass(frozen=True)
class Forgery:
    """A record changed, and why nobody can see it, where that is so."""

    change: Callable[[Record], None]
    method: str
    """The method whose first run is forged."""
    unseen_by_design: str = ""


FORGERIES: dict[str, Forgery] = {}
PERFORM = "only performing the run again can tell (`coartic reproduce`)"
SURROUNDINGS = "nothing depends on it, and it is another one every time"


def forge(
    name: str, *changes: Callable[[Record], None], method: str = LEARNER, unseen: str = ""
) -> None:
    """Add a forgery, made of changes."""
    assert name not in FORGERIES, name

    def change(record: Record) -> None:
        for step in changes:
            step(record)

    FORGERIES[name] = Forgery(change, method, unseen)


def put(*where: str | int, to: Any = None, by: float = 0) -> Callable[[Record], None]:
    """Something at one place: another value, or a number changed by so much."""

    def changed(old: Any) -> Any:
        return old + by if by else to(old) if callable(to) else copy.deepcopy(to)

    return partial(at, where, changed)


def gone(*where: str | int) -> Callable[[Record], None]:
    """A key left out."""

    def leave_out(record: Record) -> None:
        content: Any = record
        for key in where[:-1]:
            content = content[key]
        del content[where[-1]]

    return leave_out


def _best(record: Record) -> int:
    return int(max(reward for reward in record["rewards"] if reward is not None))


def _learnt(by: int) -> Callable[[Record], None]:
    """The best trial, and what was said of it, better by so much."""

    def change(record: Record) -> None:
        best, reward = record["rewards"].index(_best(record)), _best(record) + by
        record["rewards"][best] = reward

    return change


BETTER = (put("solution", "reward", by=10), put("solution", "ticks_by_goal", 0, by=-10))
forge("reward better", put("solution", "reward", by=10))
forge("reward and ticks better", *BETTER)
forge(
    "reward, ticks and movements better", *BETTER, put("solution", "movements", 0, "ticks", by=-10)
)
forge(
    "reward, ticks, movements and curve better",
    *BETTER,
    put("solution", "movements", 0, "ticks", by=-10),
    _learnt(10),
)
forge(
    "reward worse", put("solution", "reward", by=-10), put("solution", "ticks_by_goal", 0, by=10)
)
forge(
    "ticks moved to another goal",
    put("solution", "ticks_by_goal", to=lambda t: [t[0] - 1, t[1] + 1, *t[2:]]),
)
forge("movement's ticks", put("solution", "movements", 0, "ticks", by=1))
forge("hands", put("solution", "hands", to="LRL"))
forge(
    "hands of score and movement",
    put("solution", "hands", to=lambda hands: "L" + hands[1:]),
    put("solution", "movements", 0, "hand", to="left"),
)
forge("corrections", put("solution", "corrections", to=0), method=GIVEN)
forge("other arm's travel", put("solution", "other_arm_travel", by=0.5))
for _name, _value in {
    "text": "-300", "float": -300.5, "true": True, "NaN": math.nan, "huge": -(10**30),
    "list": [-300], "positive": 300, "none": None,
}.items():  # fmt: skip
    forge(f"reward is {_name}", put("solution", "reward", to=_value))
forge("ticks are text", put("solution", "ticks_by_goal", to=["141", "60", "118"]))
forge("hands are a list", put("solution", "hands", to=["R", "R", "R"]))
forge("score has more", put("solution", to=lambda score: {**score, "stars": 5}))
forge("score lacks hands", gone("solution", "hands"))

forge("replay better", put("replay", "reward", by=20))
forge("replay's hands", put("replay", "hands", to="LLL"))
forge("initial reward worse", put("initial", "reward", by=-30))
forge(
    "initial reward worse, in the curve too",
    put("initial", "reward", by=-30),
    put("rewards", 0, by=-30),
)
forge("initial hands", put("initial", "hands", to="LLL"))
forge("replay gone", put("replay", to=None), unseen=PERFORM)
forge("initial gone", put("initial", to=None))
forge("replay's movement", put("replay", "movements", 0, "target", 7, by=0.1))
forge("initial's movement", put("initial", "movements", 0, "target", 7, by=0.1))
forge("initial is the solution", lambda record: record.update(initial=record["solution"]))
forge(
    "replay is the solution",
    lambda record: record.update(replay=record["solution"]),
    unseen=PERFORM,
)
forge("replay is text", put("replay", "reward", to="x"))
forge("replay is none", put("replay", "reward", to=None))

forge("a better trial", put("rewards", 5, by=300))
forge("a trial more", put("rewards", to=lambda r: [*r, r[-1]]))
forge(
    "more trials than were asked for",
    put("rewards", to=lambda r: r + r),
    put("meter", "trials", to=80),
)
forge("a trial less", put("rewards", to=lambda r: r[:-1]))
forge("no trials", put("rewards", to=[]))
forge("first trial", put("rewards", 0, by=-7))
forge("a trial of text", put("rewards", 3, to="-320"))
forge("a trial of a fraction", put("rewards", 3, to=-320.5))
forge("a trial that is NaN", put("rewards", 3, to=math.nan))
forge("a trial too large", put("rewards", 3, to=-(10**30)))
forge("a positive trial", put("rewards", 3, to=5))
forge("a trial that is a list", put("rewards", 3, to=[-320]))
forge("rewards are text", put("rewards", to="none"))
forge("a worse trial", put("rewards", 7, by=-40), unseen=PERFORM)

JOINT = ("solution", "movements", 1, "target", 7)  # right_2
forge("solution by 1e-3", put(*JOINT, by=1e-3), unseen=PERFORM)
forge("solution by 0.1", put(*JOINT, by=0.1))
forge("solution by an ulp", put(*JOINT, to=other), unseen=PERFORM)
forge("joint is NaN", put(*JOINT, to=math.nan))
forge("joint is infinite", put(*JOINT, to=math.inf))
forge("joint is huge", put(*JOINT, to=1e300))
forge("joint so far that executing it takes years", put(*JOINT, to=1e13))
forge("joint is text", put(*JOINT, to="0.1"))
forge("joint is missing", gone(*JOINT))
forge("a joint more", put("solution", "movements", 1, "target", to=lambda q: [*q, 0.0]))
forge("movement dropped", put("solution", "movements", to=lambda s: s[:-1]))
forge("movement doubled", put("solution", "movements", to=lambda s: [s[0], *s]))
forge("movements reversed", put("solution", "movements", to=lambda s: s[::-1]))
forge("no movements", put("solution", "movements", to=[]))
forge("goal that is not there", put("solution", "movements", 0, "goal", to=99))
forge("goal is text", put("solution", "movements", 0, "goal", to="1"))
forge("hand that is not there", put("solution", "movements", 0, "hand", to="third"))
forge("kind unknown", put("solution", "movements", 0, "kind", to="teleport"))
forge(
    "kind another",
    put(
        "solution",
        "movements",
        0,
        "kind",
        to=lambda k: "planned" if k == "corrective" else "corrective",
    ),
    method=GIVEN,
)
forge("movement's ticks negative", put("solution", "movements", 0, "ticks", to=-5))
forge("movement's ticks huge", put("solution", "movements", 0, "ticks", to=10**30))
forge("solution is a text", put("solution", to="straight ahead"))
forge("movement is a list", put("solution", "movements", 0, to=[1, 2]))
forge("waypoint moved", put("solution", "movements", 0, "waypoints", 3, 7, by=0.05), method=PATHS)
forge(
    "last waypoint moved",
    put("solution", "movements", 0, "waypoints", -1, 7, by=0.05),
    method=PATHS,
)
forge("waypoints gone", put("solution", "movements", 0, "waypoints", to=[]), method=PATHS)
forge("waypoint is none", put("solution", "movements", 0, "waypoints", 3, to=None), method=PATHS)
forge(
    "waypoints where there are none",
    put("solution", "movements", 0, to=lambda m: {**m, "waypoints": []}),
)

forge("status unknown", put("status", to="perfect"))
forge("status is a number", put("status", to=7))
forge("status is none", put("status", to=None))
forge("ok without score", put("solution", to=None))
forge("crashed with a score", put("status", to="crashed"), put("reason", to="x"))
forge(
    "crashed without a reason",
    put("status", to="crashed"),
    put("solution", to=None),
)
forge(
    "a bad run hidden as a timeout",
    put("status", to="timeout"),
    put("reason", to="time limit of 600 s exceeded"),
    put("solution", to=None),
    put("details", to={}),
    put("rewards", to=[]),
    put("meter", to=None),
    put("used", to=[]),
    unseen=PERFORM,
)
forge("a reason though it is ok", put("reason", to="all went well"))
forge(
    "reason with an escape sequence",
    put("reason", to="\x1b[2J"),
    put("status", to="crashed"),
    put("solution", to=None),
)
forge(
    "reason of a megabyte",
    put("reason", to="r" * 2**20),
    put("status", to="crashed"),
    put("solution", to=None),
)
forge("reason is a number", put("reason", to=7))

forge("details are a list", put("details", to=[1]))
forge("details are text", put("details", to="x"))
forge("details of a megabyte", put("details", to=lambda d: {**d, "more": "d" * 2**20}))
forge("a bound of the learner's", put("bound", to=-100))
forge("a bound of another's", put("bound", to=-319), method=GIVEN)
forge("bound below the reward", put("bound", to=-1000), method=OPTIMUM)
forge("bound one below the reward", put("bound", by=-1), method=OPTIMUM)
forge("bound is text", put("bound", to="tight"), method=OPTIMUM)
forge("bound is a fraction", put("bound", to=-291.5), method=OPTIMUM)
forge("bound is true", put("bound", to=True), method=OPTIMUM)
forge("bound is huge", put("bound", to=10**30), method=OPTIMUM)
forge("a weaker bound", put("bound", by=20), method=OPTIMUM, unseen=PERFORM)

forge("told nothing", put("told", to=[]))
forge("told all", put("told", to=lambda told: sorted([*told, "goals", "Jacobian"])))
forge("told what does not exist", put("told", to=["everything"]))
forge("used what it was not told", put("used", to=["kinematic model"]))
forge("secondary", put("secondary", to=["<b>grace</b>"]))
forge("fewer trials on the meter", put("meter", "trials", by=-1))
forge("negative meter", put("meter", "jacobians", to=-5))
forge("meter is text", put("meter", "jacobians", to="few"))
forge("meter is a fraction", put("meter", "jacobians", to=0.5))
forge("meter is huge", put("meter", "jacobians", to=10**30))
forge("no meter though it is ok", put("meter", to=None))
forge("a counter is missing", gone("meter", "jacobians"))
forge("fewer Jacobians", put("meter", "jacobians", by=-1), unseen=PERFORM)

SPECIFICATION = "specification"
forge("seed", put(SPECIFICATION, "seed", by=1))
forge("noise", put(SPECIFICATION, "parameters", "noise_sd", to=0.1))
forge("trials asked for", put(SPECIFICATION, "parameters", "trials", by=1))
forge("parameter more", put(SPECIFICATION, "parameters", to=lambda p: {**p, "luck": 1}))
forge("goal moved", put(SPECIFICATION, "task", "goals", 1, 0, by=1e-3))
forge("radius", put(SPECIFICATION, "task", "radius", to=1.0))
forge("task renamed", put(SPECIFICATION, "task", "name", to="other"))
forge("model", put(SPECIFICATION, "model", "step", to=1.0))
forge("method", put(SPECIFICATION, "method", to="dual-process/EC2"))
forge("budget", put(SPECIFICATION, "trial_budget", to=5))
forge("specification of another format", put(SPECIFICATION, "format", to=99))
forge("specification gone", put(SPECIFICATION, to=None))
forge("code", put("code", to="0" * 12))
forge("run id", put("run_id", to="0" * 16 + "-" + "0" * 12))
forge("run number", put("run", to=5))
forge("run number is text", put("run", to="0"))
forge("origin", put("origin", to="/elsewhere/method.py"))

forge("time negative", put("timing", "wall_s", to=-1.0))
forge("time is NaN", put("timing", "wall_s", to=math.nan))
forge("time is text", put("timing", "wall_s", to="short"))
forge("times gone", gone("timing", "wall_s"))
forge("together is 0", put("timing", "together", to=0))
forge("warm is text", put("timing", "warm", to="lukewarm"))
forge(
    "faster",
    put("timing", "wall_s", to=1e-9),
    put("timing", "cpu_s", to=1e-9),
    unseen=SURROUNDINGS,
)
forge("less memory", put("timing", "process_peak_mb", to=1.0), unseen=SURROUNDINGS)
forge(
    "commit",
    put("environment", "commit", to={"id": "0" * 40, "dirty": False}),
    unseen=SURROUNDINGS,
)
forge("Python", put("environment", "python", to="3.99.0"), unseen=SURROUNDINGS)
forge("commit is text", put("environment", "commit", to="0" * 40))
forge("packages are a list", put("environment", "packages", to=[1]))
forge("environment is none", put("environment", to=None))

forge("a key more", lambda record: record.update(stars=5))
for _key in ("solution", "replay", "rewards", "details", "meter", "timing", "environment", "told"):
    forge(f"no {_key}", gone(_key))


def runs_by_method(folder: Path) -> dict[str, list[str]]:
    """Ids of the runs, by method, in the order of run numbers."""
    found: dict[str, list[tuple[int, str]]] = {}
    for run_id, record in records_of(folder).items():
        found.setdefault(method_of(record), []).append((record["run"], run_id))
    return {method: [run_id for _, run_id in sorted(runs)] for method, runs in found.items()}


def forge_in(folder: Path, forgery: Forgery) -> str:
    """Forge a record of a folder. Raises LookupError or TypeError where it has no such key."""
    run_id = runs_by_method(folder)[forgery.method][0]
    path = pack_of(folder, run_id)
    records = read_pack(path)
    forgery.change(records[run_id])
    write_pack(path, records)
    return run_id


def solution_of_another(record: Record, source: Record) -> None:
    """The solution of one method under the name of another, with all that goes with it."""
    record["solution"] = copy.deepcopy(source["solution"])
    record["rewards"][3] = record["solution"]["reward"]
    record["meter"]["movement_ticks"] = -sum(record["rewards"])


def says(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """What the tables of a folder say, but for times and memory."""
    return {
        name: [
            {k: v for k, v in row.items() if k not in MAY_DIFFER}
            for row in pq.read_table(folder / f"{name}.parquet").to_pylist()
        ]
        for name in ("runs", "solutions", "paths", "learning")
    }


def got_through(
    command: Command, whole: Path, forged: Path, suite: Path, run_id: str
) -> list[str]:
    """What came of a forged record after the suite's own command; empty where it held."""
    before = records_of(forged)[run_id]
    ended = command("run", suite, "--out", forged, "--jobs", "1")
    if "Traceback" in ended.text or ended.code not in (0, 1, 2):
        return [f"run ends with {ended.code}, {ended.last_line!r}"]
    if ended.code == 2:
        return [] if ended.refused and ended.names else [f"run says {ended.last_line!r}"]
    found = accepted(command, whole, forged, "")
    if found and records_of(forged).get(run_id, before) != before and says(forged) == says(whole):
        return []  # performed again
    return found


def outcomes(root: Path, folder: Path, chosen: str) -> Iterator[tuple[str, list[str] | str]]:
    """Every forgery, and which commands accept it after the tables were made again."""
    whole = finished(root, folder)
    suite = folder / "small.toml"
    suite.write_text(SUITE)
    driver = Driver(root, folder)
    records, runs = records_of(whole), runs_by_method(whole)
    stolen = Forgery(
        lambda record: solution_of_another(record, records[runs[OPTIMUM][0]]), LEARNER, PERFORM
    )
    for name, forgery in {**FORGERIES, "solution of another": stolen}.items():
        if not name.startswith(chosen):
            continue
        forged = folder / "forged"
        shutil.rmtree(forged, ignore_errors=True)
        shutil.copytree(whole, forged)
        try:
            run_id = forge_in(forged, forgery)
        except (LookupError, TypeError, AttributeError) as error:
            yield name, f"not applicable here: {error!r}"
            continue
        found = got_through(driver.run, whole, forged, suite, run_id)
        if found and forgery.unseen_by_design:
            again = driver.run("reproduce", run_id, "--in", forged)
            sees = "sees it" if again.code == 1 else "does not see it"
            yield name, f"unseen by design ({forgery.unseen_by_design}); `reproduce` {sees}"
        else:
            yield name, found
    driver.close()
