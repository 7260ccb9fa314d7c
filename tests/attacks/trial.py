"""A hostile method let loose on a checkout, and what came of it."""

from __future__ import annotations

import multiprocessing
import os
import re
import shutil
import sys
import traceback
import unicodedata
import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import execute, load_task
from coartic.benchmarks import sandbox
from coartic.benchmarks.run import run_suite
from coartic.benchmarks.specification import RunSpec, Setting
from coartic.rows import movements_from
from tests.support.nursery import Nursery
from tests.support.suites import InProcess

from .checkout import (
    Driver,
    Ended,
    adopt_orphans,
    in_process,
    left_behind,
    ours,
    read_json,
    run,
    size_of,
)
from .methods import ATTACKS, Attack, Expectation

HERE = Path(__file__).parents[2]
TASK = "ascending"
BUILT_IN = ("dual-process/EC1", "corrective-alone/given", "random-search/climbing")
LIMIT_S = 90.0  # of a whole suite, for every hostile method in it
RUN_LIMIT_S = 4.0
LARGEST_FOLDER = 20_000_000
LONGEST_TEXT = 2000
ENDING = ("neighbour/answers-twice", "exhaust/errors")
"""Attacks that end their process: together with others, one run of each is enough."""
CODES: dict[Expectation, tuple[int, ...]] = {
    "recorded": (0, 1),
    "refused": (2,),
    "either": (0, 1, 2),
    "seen": (0, 1, 2),
    "ended": (0, 1, 2, 130, -2, -9, -15),
}
"""Exit codes of the command, by what is expected."""
_SUITE = """
title = "Small"
description = "Built-in methods beside another one."
runs = 2
trials = 30
"""
_CELLS = """
[[cells]]
tasks = ["%s"]
methods = [%s]
"""
_RESULTS = ["task", "method", "run", "seed", "status", "reason", "hands", "reward", "trials"]
_RESULTS += [
    "replay_reward",
    "initial_reward",
    "best_trial",
    "movement_ticks",
    "parameters",
    "run_id",
]


def _cells(*methods: str) -> str:
    return _CELLS % (TASK, ", ".join(f'"{name}"' for name in methods))


def clean_run(root: Path, folder: Path) -> Path:
    """A results folder of the built-in methods alone. Raises RuntimeError where that fails."""
    folder.mkdir(parents=True)
    (folder / "clean.toml").write_text(_SUITE + _cells(*BUILT_IN))
    ended = run(root, ["run", "clean.toml", "--out", "out", "--jobs", "1"], folder, limit=300)
    if ended.code != 0:
        raise RuntimeError(f"the suite does not even run by itself: {ended.text[-2000:]}")
    return folder / "out"


@cache
def _driver(root: Path) -> Driver:
    return Driver(root, Path.cwd())


def hold(attack: Attack, root: Path, clean: Path, folder: Path) -> list[str]:
    """Run a suite with the attack in it; what did not hold, each as a short sentence."""
    folder.mkdir(parents=True)
    try:
        return let_loose([attack], root, clean, folder)
    except Exception:
        return [f"cannot be judged: {traceback.format_exc(limit=-2)[-400:]!r}"]
    finally:
        left_behind(0.0)
        shutil.rmtree(folder, ignore_errors=True)


def let_loose(attacks: Sequence[Attack], root: Path, clean: Path, folder: Path) -> list[str]:
    """As :func:`hold`, in a folder that is there and stays; several attacks share a suite.

    Several have to have the same expectation, and attack the checkout that this file is of.
    """
    attack = attacks[0]
    hostile = [_named(*a) for a in enumerate(attacks)] if len(attacks) > 1 else [attack]
    parts = [_cells(*(a.method for a in hostile)), _cells(*BUILT_IN)]
    (folder / "suite.toml").write_text(
        _SUITE + "".join(reversed(parts) if attack.after_others else parts)
    )
    command = ["run", "suite.toml", "--out", "out", "--jobs", "1"]
    command += ["--time-limit", f"{RUN_LIMIT_S:g}"]
    paths = [_install(a, folder / "plugins") for a in hostile if a.installed]
    if sources := [a.source for a in hostile if not a.installed]:
        (folder / "hostile.py").write_text("\n".join(sources), encoding="utf-8")
        command += ["--method-file", "hostile.py"]
    perform = run if len(attacks) == 1 else _run_forked
    ended = perform(root, command, folder, limit=LIMIT_S * len(attacks), paths=paths)
    found = _manners(attack, ended, folder)
    out = folder / "out"
    if attack.expects == "ended" and ended.code not in (0, 1):
        (folder / "again.toml").write_text(_SUITE + _cells(*BUILT_IN))
        again = run(root, ["run", "again.toml", *command[2:6]], folder, limit=LIMIT_S)
        if again.code != 0:
            found.append(f"the suite does not go on: {again.last_line}")
    if not (out / "manifest.json").exists():
        return found + ["no tables"] * (ended.code in (0, 1))
    words = ["compare", clean, out]
    read = Ended(*in_process(words)) if root == HERE else _driver(root).run(*words)
    if read.code != 0:
        if not (attack.expects == "seen" and read.refused and read.names):
            found.append(f"the folder is not read: {read.last_line}")
        return found
    return found + _forged(hostile, clean, out)


@cache
def _nursery() -> Nursery:
    found = Nursery()
    ours.add(found.pid)
    return found


def _run_forked(
    root: Path, arguments: Sequence[str], folder: Path, *, limit: float, paths: Sequence[Path] = ()
) -> Ended:
    """As :func:`run`, in a fork of this process, which has imported everything.

    The hostile methods share one sandbox after another, apart from this project's methods: that
    each has one of its own is for tests/test_sandbox.py.
    """
    assert root == HERE
    assert not paths
    said = folder / "said-forked.txt"
    nursery = _nursery()

    def command() -> None:
        os.setsid()
        os.chdir(folder)
        for variable, name in (("HOME", "home"), ("TMPDIR", "tmp")):
            (folder / name).mkdir(exist_ok=True)
            os.environ[variable] = str(folder / name)
        sandbox._RETRIES = 0
        sandbox.subprocess = nursery  # type: ignore[assignment]
        own_job = Setting.job

        def job(setting: Setting, specs: Sequence[RunSpec]) -> dict[str, Any]:
            found = own_job(setting, specs)
            return {**found, "owner": found["owner"] and "hostile"}

        Setting.job = job  # type: ignore[method-assign]
        code, text = in_process(arguments)
        said.write_text(text, encoding="utf-8", errors="backslashreplace")
        sandbox.close_all()
        sys.exit(code)

    child = multiprocessing.get_context("fork").Process(target=command)
    child.start()
    child.join(limit)
    code = child.exitcode
    child.kill()
    return Ended(code, said.read_text(encoding="utf-8") if said.exists() else "")


def _named(number: int, attack: Attack) -> Attack:
    """The same under a name of its own, as a method and as a class."""
    name = f"hostile/{attack.id.replace('/', '-')}"
    source = attack.source.replace('    name = "hostile"\n', f'    name = "{name}"\n', 1)
    source = re.sub(r"\bHostile\b", f"Hostile{number}", source)
    if attack.id in ENDING:
        source = source.replace("stochastic = True", "stochastic = False")
    return replace(attack, method=name, source=source)


def _manners(attack: Attack, ended: Ended, folder: Path) -> list[str]:
    """How the command ended, what it said, and what is left behind."""
    found = []
    remained = left_behind()
    if remained:
        found.append(f"left {len(remained)} processes: {remained[0]}")
    if ended.code is None:
        found.append("never ended")
    elif ended.code not in CODES[attack.expects]:
        found.append(f"exit code {ended.code} where it should be {attack.expects}")
    if "Traceback" in ended.text:
        found.append(f"a traceback: {ended.last_line}")
    if any(_hidden(c) for c in ended.text):
        found.append("control characters on the terminal")
    if ended.code == 2 and not ended.refused:
        found.append("exit code 2 without a sentence")
    size = size_of(folder / "out") + size_of(folder / "tmp")
    size += sum(path.stat().st_size for path in folder.glob("said-*.txt"))
    if size > LARGEST_FOLDER and attack.id != "exhaust/disk":
        found.append(f"left {size / 1e6:.0f} MB")
    return found


def _install(attack: Attack, site: Path) -> Path:
    """The attack as a package with an entry point, in a folder for the Python path."""
    about = site / "hostile_plugin-1.0.dist-info"
    about.mkdir(parents=True)
    (site / "hostile_plugin.py").write_text(attack.source)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: hostile-plugin\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[coartic.methods]\nhostile = hostile_plugin:Hostile\n"
    )
    return site


def _forged(attacks: Sequence[Attack], clean: Path, out: Path) -> list[str]:
    """What the tables say and should not."""
    found = []
    runs, due = (_table(folder, "runs") for folder in (out, clean))
    built_in = runs.method.isin(BUILT_IN)
    theirs, ours = runs[~built_in], runs[built_in]
    if not _same(ours[_RESULTS], due[_RESULTS]):
        found.append("the results of other methods differ")
    else:
        for name in ("solutions", "learning"):
            table, clean_table = (_table(folder, name) for folder in (out, clean))
            table = table[table.run_id.isin(ours.run_id)]
            if not _same(table, clean_table):
                found.append(f"the {name} of other methods differ")
    manifest = read_json(out / "manifest.json")["specification"]
    if manifest["tasks"] != read_json(clean / "manifest.json")["specification"]["tasks"]:
        found.append("the task is another one")
    lost = {a.method for a in attacks if a.expects == "recorded"} - set(theirs.method)
    if lost:
        found.append(f"not in the tables: {', '.join(lost)}")
    reserved = theirs.method.str.startswith(("optimum/", "dual-process/"))
    if reserved.any():
        found.append(f"it is called {theirs.method[reserved].iloc[0]}")
    if (theirs.proven_bound.notna() & (theirs.status == "ok")).any():
        found.append(f"its word is a proven bound: {theirs.proven_bound.dropna().iloc[0]}")
    texts = [str(value) for name in theirs for value in theirs[name] if name != "parameters"]
    texts += [str(text) for item in manifest["methods"].values() for text in item.values()]
    longest = max(map(len, texts), default=0)
    if longest > LONGEST_TEXT:
        found.append(f"keeps a text of {longest} characters")
    texts.append((out / "comparison.md").read_text())
    if any(_hidden(c) for text in texts for c in text[:100_000]):
        found.append("control characters in what is kept")
    return found + _scores(theirs, out)


def _scores(runs: pd.DataFrame, out: Path) -> list[str]:
    """Whether stored solutions, executed here, give what the tables say of them."""
    solutions, paths = (
        pd.read_parquet(out / f"{name}.parquet") for name in ("solutions", "paths")
    )
    task = load_task(TASK)
    for row in runs[runs.status == "ok"].itertuples():
        rows, waypoints = (table[table.run_id == row.run_id] for table in (solutions, paths))
        try:
            made = execute(task, movements_from(task, rows, waypoints))
        except Exception as error:
            return [f"its solution of {row.reward} cannot be executed: {error}"]
        ticks = [movement.ticks for movement in made.movements]
        if (made.reward, made.hands) != (row.reward, row.hands):
            return [f"it scored {row.reward} {row.hands}, worth {made.reward} {made.hands}"]
        if ticks != rows.sort_values("order").ticks.tolist():
            return ["its movements took other times than stored"]
    return []


def _table(folder: Path, name: str) -> pd.DataFrame:
    table = pd.read_parquet(folder / f"{name}.parquet", dtype_backend="numpy_nullable")
    return table.astype({"run_id": "string"})


def _same(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    """Whether two tables hold the same, whatever the numbers of their rows."""
    return a.reset_index(drop=True).equals(b.reset_index(drop=True))


def _hidden(c: str) -> bool:
    return c not in "\n\t" and unicodedata.category(c) in ("Cc", "Cf", "Cs")


def in_a_fork(attacks: Sequence[str], folder: Path) -> list[str]:
    """These attacks of :data:`ATTACKS` on this checkout in one suite; what did not hold.

    In a fork of this process: it adopts orphans, and ends with what it has adopted.
    """
    context = multiprocessing.get_context("fork")
    found, said = context.Pipe(duplex=False)

    def trial() -> None:
        warnings.simplefilter("ignore")  # whatever runs tests has made of them
        adopt_orphans()
        (folder / "clean.toml").write_text(_SUITE + _cells(*BUILT_IN))
        run_suite(folder / "clean.toml", folder / "clean", executor=InProcess())
        chosen = [ATTACKS[name] for name in attacks]
        said.send(let_loose(chosen, HERE, folder / "clean", folder))

    child = context.Process(target=trial)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads, which a fork does not have
        child.start()
    said.close()
    try:
        return list(found.recv())
    finally:
        child.join()
