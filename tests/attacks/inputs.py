"""Bad inputs: command lines, task files, suite files, parameters, files, surroundings.

Each is answered by a sentence and the exit code, within :data:`SECONDS`, and leaves the folder
as it was. :func:`attack` tries them all on any checkout, in one process that forks for each::

    python -m tests.attacks.inputs [CHECKOUT]

This file is run by itself in the surroundings of that checkout, so it imports nothing but the
standard library before it knows whose ``coartic`` it gets.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import resource
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NoReturn

SECONDS = 5.0
"""CPU time within which an input is answered."""
_HANGS_S = 60  # by the clock on the wall, whatever else the machine does
_MEMORY = 3 * 2**30  # bytes beyond what is loaded
_OTHER_WORDS = "an answer without"
_LONGEST = 30_000  # characters of an answer: `list` has 21 000
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Case:
    """A bad input."""

    id: str
    argv: tuple[str, ...]
    words: str = ""
    """Part of the answer."""
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    prepare: Callable[[], object] | None = None
    """Called in the folder of the case."""
    env: Mapping[str, str] = field(default_factory=dict)
    code: int = 2
    shell: str | None = None
    """In a process of its own, by a shell: what follows the command, such as ``>&-``."""


@dataclass(frozen=True)
class Outcome:
    """How a bad input was answered."""

    id: str
    problems: tuple[str, ...]
    """What is wrong with the answer; none where it is as it should be."""
    answer: str
    seconds: float
    """CPU time."""


GOOD = """
name = "mine"
goals = [[5.0, 1.0], [5.0, 2.0]]
initial_hands = "RR"

[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
"""


def _task(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


TASKS: dict[str, tuple[str, str]] = {
    "nan": (_task("[5.0, 2.0]", "[nan, 2.0]"), "goals[1][0] is nan; it must be a finite number"),
    "infinite": (_task("base = [0.0,", "base = [inf,"), "start.base[0] is inf"),
    "no goal": (
        _task("[[5.0, 1.0], [5.0, 2.0]]", "[]"),
        "goals is empty; a task needs at least one goal",
    ),
    "zero radius": ("radius = 0.0" + GOOD, "radius is 0.0; it must be greater than 0"),
    "negative radius": ("radius = -0.1" + GOOD, "radius is -0.1; it must be greater than 0"),
    "unknown hand": (
        'hands = ["middle"]' + GOOD,
        "hands[0] is 'middle'; it must be 'left' or 'right'",
    ),
    "no hand": ("hands = []" + GOOD, "hands has too few entries"),
    "hand twice": ('hands = ["left", "left"]' + GOOD, "hands names the same entry twice"),
    "unknown letter": (
        _task('"RR"', '"RX"'),
        "initial_hands is 'RX'; it must be a sequence of L",
    ),
    "too few letters": (_task('"RR"', '"R"'), "initial_hands 'R' names 1 hands for 2 goals"),
    "absent hand": (
        'hands = ["left"]' + GOOD,
        "initial_hands 'RR' uses the right hand, which is not among hands",
    ),
    "out of reach": (
        'locked_base = ["x", "y"]' + _task("[[5.0, 1.0], [5.0, 2.0]]", "[[4.0, 1.0], [9.0, 2.0]]"),
        "goals[1] (9, 2) is out of reach with the base locked in x and y",
    ),
    "out of reach on a rail": (
        'locked_base = ["y"]' + _task("[5.0, 2.0]", "[5.0, 4.2]"),
        "goals[1] (5, 4.2) is out of reach with the base locked in y",
    ),
    "out of reach of the named hand": (
        'locked_base = ["x", "y"]' + _task('"RR"', '"LL"').replace("5.0, 1.0", "4.2, 0.1"),
        "goals[0] (4.2, 0.1) is out of reach with the base locked in x and y for the left hand",
    ),
    "unknown coordinate": (
        'locked_base = ["z"]' + GOOD,
        "locked_base[0] is 'z'; it must be 'x' or 'y'",
    ),
    "unknown key": ("gaols = 1" + GOOD, "gaols is an unknown key; did you mean 'goals'?"),
    "unknown nested key": (
        GOOD + "middle = [0.0]\n",
        "start.middle is an unknown key",
    ),
    "missing key": (_task('initial_hands = "RR"', ""), "initial_hands is missing"),
    "missing table": (GOOD.split("[start]")[0], "start is missing"),
    "text for a number": (_task("[5.0, 2.0]", '["5", 2.0]'), "goals[1][0] is '5' (str)"),
    "truth for a number": (_task("[5.0, 2.0]", "[true, 2.0]"), "goals[1][0] is True (bool)"),
    "number for a text": (
        _task('name = "mine"', "name = 3"),
        "name is 3 (int); it must be a text",
    ),
    "number for a list": (_task("[[5.0, 1.0], [5.0, 2.0]]", "7"), "goals is 7 (int)"),
    "three coordinates": (
        _task("[5.0, 2.0]", "[5.0, 2.0, 1.0]"),
        "goals[1] has 3 entries; it takes 2",
    ),
    "one coordinate": (_task("[5.0, 2.0]", "[5.0]"), "goals[1][1] is missing"),
    "wrong joint count": (
        _task("right = [0.0, 0.0, 0.0, 0.0]", "right = [0.0]"),
        "start.right has 1 joint angles; the right arm has 4 joints",
    ),
    "name with spaces": (_task('"mine"', '"my task"'), "name is 'my task'; use letters"),
    "bad robot": (GOOD + "[robot]\nleft_links = [1.0, -1.0]\n", "robot.left_links[1] is -1.0"),
    "robot without links": (GOOD + "[robot]\nleft_links = []\n", "robot.left_links has too few"),
    "unknown robot key": (GOOD + "[robot]\nlinks = [1.0]\n", "robot.links is an unknown key"),
    "start is no table": (
        GOOD.split("[start]")[0] + "start = 1\n",
        "start is 1; it must be a table",
    ),
    "bad provenance": (
        GOOD + '[provenance]\ngoals = { status = "guessed", source = "me" }\n',
        "provenance.goals.status is 'guessed'; it must be 'printed', 'inferred' or 'chosen'",
    ),
    "provenance of nothing": (
        GOOD + '[provenance]\ngaols = { status = "chosen", source = "me" }\n',
        "provenance.gaols is not a key of a task; did you mean 'goals'?",
    ),
    "not TOML": ("name = ", "is not valid TOML"),
    "nested deep": ("a = " + "[" * 5000, "is not valid TOML"),
    "huge integer": ("a = " + "9" * 5000, "is not valid TOML"),
    "large integer": (_task("[5.0, 2.0]", f"[{'9' * 300}, 2.0]"), "(300 characters)"),
    "far goal": (_task("[5.0, 2.0]", "[1e7, 2.0]"), "goals[1][0] is 10000000.0; its size must"),
    "far base": (_task("base = [0.0,", "base = [-2e4,"), "start.base[0] is -20000.0; its size"),
    "wound up": (_task("right = [0.0,", "right = [1e20,"), "start.right[0] is 1e+20; its size"),
    "huge radius": ("radius = 1e308" + GOOD, "radius is 1e+308; its size must be at most 10000"),
    "huge link": (GOOD + "[robot]\nleft_links = [1e9]\n", "robot.left_links[0] is 1000000000.0"),
    "too many goals": (
        _task("[[5.0, 1.0], [5.0, 2.0]]", "[" + "[5.0, 1.0]," * 101 + "]"),
        "goals has 101 entries; it takes 100",
    ),
    "key below its table": (GOOD + "radius = 0.1\n", "'radius' belongs above the line [start]"),
}


FIELDS = "\n".join(f"k{i} = 1" for i in range(20_000))
TASKS |= {
    "title in two lines": ('title = "a\\nb"' + GOOD, "title should be one line of printable text"),
    "title with an escape": ('title = "\\u001b[31mred"' + GOOD, "without \\x1b"),
    "title with a bell": ('title = "\\u0007"' + GOOD, "without \\x07"),
    "title with a NUL": ('title = "\\u0000"' + GOOD, "without \\x00"),
    "title that turns the direction": ('title = "a\\u202eb"' + GOOD, "without \\u202e"),
    "title of no width": ('title = "\\u200b"' + GOOD, "without \\u200b"),
    "title too long": (f'title = "{"x" * 501}"' + GOOD, "title has 501 characters; it takes 500"),
    "number for a title": ("title = 3" + GOOD, "title is 3 (int); it must be a text"),
    "description in two lines": (
        'description = """a\nb"""' + GOOD,
        "description should be one line of printable text, without \\n",
    ),
    "description too long": (f'description = "{"x" * 9000}"' + GOOD, "description has 9000"),
    "source with an escape": (
        GOOD + '[provenance]\ngoals = { status = "chosen", source = "\\u001b]0;x\\u0007" }\n',
        "provenance.goals.source should be one line",
    ),
    "source too long": (
        GOOD + f'[provenance]\ngoals = {{ status = "chosen", source = "{"x" * 501}" }}\n',
        "provenance.goals.source has 501 characters",
    ),
    "source missing": (
        GOOD + '[provenance]\ngoals = { status = "chosen" }\n',
        "provenance.goals.source is missing",
    ),
    "provenance is no table": ("provenance = 3" + GOOD, "provenance is 3; it must be a table"),
    "name is empty": (_task('"mine"', '""'), "name is ''; use letters"),
    "name of a folder above": (_task('"mine"', '"../mine"'), "name is '../mine'; use letters"),
    "name that is hidden": (_task('"mine"', '".mine"'), "name is '.mine'; use letters"),
    "name like an option": (_task('"mine"', '"-mine"'), "name is '-mine'; use letters"),
    "name too long": (_task('"mine"', f'"{"m" * 65}"'), "name has 65 characters; it takes 64"),
    "name ends its line": (_task('"mine"', '"mine\\n"'), "name is 'mine\\n'; use letters"),
    "name in Greek": (_task('"mine"', '"\\u03b1"'), "name is 'α'; use letters"),
    "name with an escape": (_task('"mine"', '"\\u001b[2J"'), "name is '\\x1b[2J'; use letters"),
    "date for a number": (_task("[5.0, 2.0]", "[2020-01-01, 2.0]"), "(date); it must be a number"),
    "time for a radius": ("radius = 2020-01-01T00:00:00Z" + GOOD, "(datetime); it must be"),
    "list for a radius": ("radius = [0.1]" + GOOD, "radius is [0.1] (list); it must be a number"),
    "negative infinity": ("radius = -inf" + GOOD, "radius is -inf"),
    "huge hexadecimal": (f"radius = 0x{'f' * 9000}" + GOOD, "a number of more than 4300 digits"),
    "huge hexadecimal within": (
        _task("[[5.0, 1.0], [5.0, 2.0]]", f"{{ x = [0x{'f' * 9000}] }}"),
        "goals is a number of more than 4300 digits (dict); it must be a list",
    ),
    "goals by the thousand": (
        _task("[[5.0, 1.0], [5.0, 2.0]]", "[" + "[5.0,1.0]," * 20_000 + "]"),
        "entries; it takes 100",
    ),
    "bad goals by the thousand": (
        _task("[[5.0, 1.0], [5.0, 2.0]]", "[" + '"a",' * 20_000 + "]"),
        "more problems",
    ),
    "hands by the thousand": ("hands = [" + '"left",' * 20_000 + "]" + GOOD, "hands has"),
    "bad hands by the thousand": ("hands = [" + "1," * 20_000 + "]" + GOOD, "hands[0] is 1"),
    "joints by the thousand": (
        _task("right = [0.0,", "right = [" + "0.0," * 20_000),
        "entries; it takes 100",
    ),
    "links by the thousand": (
        GOOD + "[robot]\nleft_links = [" + "1.0," * 20_000 + "]\n",
        "robot.left_links has",
    ),
    "three locked coordinates": ('locked_base = ["x", "y", "x"]' + GOOD, "it takes 2"),
    "letters by the thousand": (_task('"RR"', f'"{"R" * 20_000}"'), "names 20000 hands"),
    "letters with an escape": (_task('"RR"', '"R\\u001b"'), "initial_hands is 'R\\x1b'"),
    "list for letters": (_task('"RR"', '["R", "R"]'), "(list); it must be a text"),
    "unknown keys by the thousand": (FIELDS + GOOD, "has 19980 more problems"),
    "unknown key with an escape": ('"\\u001b[2J" = 1' + GOOD, "\\x1b[2J is an unknown key"),
    "unknown key in two lines": ('"a\\nerror: b" = 1' + GOOD, "a | error: b is an unknown key"),
    "unknown key, long": (f"{'k' * 900_000} = 1" + GOOD, "(900000 characters) is an unknown key"),
    "unknown key, empty": ('"" = 1' + GOOD, "is an unknown key"),
    "key twice": ('name = "other"' + GOOD, "is not valid TOML: Cannot overwrite a value"),
    "table twice": (GOOD + "[start]\nbase = [0.0, 0.0]\n", "is not valid TOML"),
    "key of many parts": ("a" + ".a" * 20_000 + " = 1" + GOOD, "more than 32 dotted parts"),
    "quoted key of many parts": ('"a"' + "." + "'a'." * 20_000 + "a = 1" + GOOD, "dotted parts"),
    "table of many parts": (GOOD + "[" + "a." * 20_000 + "a]\n", "dotted parts"),
    "start is a list of tables": (GOOD.replace("[start]", "[[start]]"), "it must be a table"),
    "empty": ("", "name is missing"),
    "a comment alone": ("# nothing\n", "goals is missing"),
    "JSON": ('{"name": "mine"}', "is not valid TOML"),
    "YAML": ("name: mine\n", "is not valid TOML"),
    "ends in the middle": (GOOD[:-10], "is not valid TOML"),
    "surrogate": ('title = "\\ud800"' + GOOD, "is not valid TOML"),
    "one link too long to reach back": (
        'locked_base = ["x", "y"]'
        + _task("[[5.0, 1.0], [5.0, 2.0]]", "[[3.0, 1.0], [3.0, 1.5]]")
        + "[robot]\nright_links = [19.0, 1.0, 1.0, 1.0]\n",
        "goals[0] (3, 1) is out of reach with the base locked in x and y for the right hand",
    ),
}

HEAD = 'title = "x"\ndescription = "x"\nruns = 1\ntrials = 5\n'
CELLS = '[[cells]]\ntasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n'
GRID = "[" + ", ".join(map(str, range(1, 1001))) + "]"


def _head(old: str, new: str) -> str:
    assert old in HEAD
    return HEAD.replace(old, new) + CELLS


def _cells(old: str, new: str) -> str:
    assert old in CELLS
    return HEAD + CELLS.replace(old, new)


def _block(text: str) -> str:
    return HEAD + CELLS + text + "\n"


def _move(goal: str, by: str) -> str:
    return _block(f"move = {{ goal = {goal}, by = {by} }}")


SUITES: dict[str, tuple[str, str]] = {
    "a million million runs": (_head("runs = 1", "runs = 1_000_000_000_000"), "1000000000000"),
    "runs beyond every integer": (_head("runs = 1", f"runs = 1{'0' * 400}"), "runs "),
    "runs in hexadecimal": (_head("runs = 1", f"runs = 0x{'f' * 9000}"), "runs "),
    "no run": (_head("runs = 1", "runs = 0"), "runs is 0; it must be greater than 0"),
    "negative runs": (_head("runs = 1", "runs = -1"), "it must be greater than 0"),
    "half a run": (_head("runs = 1", "runs = 1.5"), "runs is "),
    "runs as text": (_head("runs = 1", 'runs = "5"'), "runs is "),
    "truth for runs": (_head("runs = 1", "runs = true"), "runs is "),
    "date for runs": (_head("runs = 1", "runs = 2020-01-01"), "runs is "),
    "runs missing": (_head("runs = 1\n", ""), "runs is missing"),
    "too many runs in all": (
        _head("runs = 1", "runs = 1_000_000") + CELLS * 2 + "grid = { noise_sd = [1, 2] }\n",
        "3_000_000 runs are planned",
    ),
    "a million million trials": (_head("trials = 5", "trials = 1_000_000_000_000"), "trials "),
    "no trial": (_head("trials = 5", "trials = 0"), "it must be greater than 0"),
    "trials as text": (_head("trials = 5", 'trials = "x"'), "trials is "),
    "truth for trials": (_head("trials = 5", "trials = true"), "trials is "),
    "no time": (_head("trials = 5", "time_limit_s = 0"), "time_limit_s is "),
    "negative time": (_head("trials = 5", "time_limit_s = -1"), "time_limit_s is "),
    "time is no number": (_head("trials = 5", "time_limit_s = nan"), "time_limit_s "),
    "time without end": (_head("trials = 5", "time_limit_s = inf"), "time_limit_s "),
    "time beyond clocks": (_head("trials = 5", "time_limit_s = 1e300"), "time_limit_s "),
    "time as text": (_head("trials = 5", 'time_limit_s = "600"'), "time_limit_s "),
    "truth for time": (_head("trials = 5", "time_limit_s = true"), "time_limit_s "),
    "title missing": (_head('title = "x"\n', ""), "title is missing"),
    "title is a number": (_head('title = "x"', "title = 3"), "title is "),
    "title with an escape": (_head('title = "x"', 'title = "\\u001b[2J"'), "without \\x1b"),
    "title in two lines": (_head('title = "x"', 'title = "a\\nb"'), "title should be one line"),
    "title with a NUL": (_head('title = "x"', 'title = "\\u0000"'), "title should be one line"),
    "title too long": (
        _head('title = "x"', f'title = "{"x" * 501}"'),
        "title has 501 characters; it takes 500",
    ),
    "title turned round": (_head('title = "x"', 'title = "\\u202ex"'), "without \\u202e"),
    "description in two lines": (
        _head('description = "x"', 'description = """a\nb"""'),
        "description should be one line",
    ),
    "description too long": (
        _head('description = "x"', f'description = "{"x" * 20_000}"'),
        "description has 20000 characters; it takes 500",
    ),
    "name with spaces": ('name = "a b"\n' + HEAD + CELLS, "name is 'a b'; use letters"),
    "name of a folder above": ('name = "../x"\n' + HEAD + CELLS, "name is '../x'; use letters"),
    "name with an escape": ('name = "\\u001b[2J"\n' + HEAD + CELLS, "use letters, digits"),
    "name with Markdown": ('name = "**x**|`y`"\n' + HEAD + CELLS, "use letters, digits"),
    "name is empty": ('name = ""\n' + HEAD + CELLS, "name is ''; use letters"),
    "name is hidden": ('name = ".x"\n' + HEAD + CELLS, "name is '.x'; use letters"),
    "name too long": (
        f'name = "{"x" * 65}"\n' + HEAD + CELLS,
        "name has 65 characters; it takes 64",
    ),
    "name is a number": ("name = 3\n" + HEAD + CELLS, "name is "),
    "no cells": (HEAD, "cells is missing"),
    "empty cells": (HEAD + "cells = []\n", "cells has too few entries"),
    "cells without content": (HEAD + "[[cells]]\n", "cells[0].tasks is missing"),
    "cells by the thousand": (HEAD + "[[cells]]\n" * 20_000, "more problems"),
    "cells is a table": (_cells("[[cells]]", "[cells]"), "cells is "),
    "cells is a number": (HEAD + "cells = 3\n", "cells is "),
    "unknown key": ("rums = 3\n" + HEAD + CELLS, "rums is an unknown key"),
    "unknown key of cells": (_block("run = 3"), "cells[0].run is an unknown key"),
    "unknown key with an escape": ('"\\u001b" = 3\n' + HEAD + CELLS, "\\x1b is an unknown key"),
    "unknown keys by the thousand": (FIELDS + "\n" + HEAD + CELLS, "has 19980 more problems"),
    "key twice": (HEAD + HEAD + CELLS, "is not valid TOML: Cannot overwrite a value"),
    "key of many parts": ("a" + ".a" * 20_000 + " = 1\n" + HEAD, "more than 32 dotted parts"),
    "nested deep": ("a = " + "[" * 5000, "is not valid TOML"),
    "empty": ("", "title is missing"),
    "not TOML": ("title = ", "is not valid TOML"),
    "no tasks": (_cells('["ascending"]', "[]"), "cells[0].tasks has too few entries"),
    "tasks is a text": (_cells('["ascending"]', '"ascending"'), "cells[0].tasks is "),
    "task is a number": (_cells('["ascending"]', "[3]"), "cells[0].tasks[0] is "),
    "unknown task": (_cells('["ascending"]', '["ascendin"]'), "did you mean 'ascending'?"),
    "unknown task beside all": (_cells('["ascending"]', '["*", "nope"]'), "unknown task 'nope'"),
    "task file that is missing": (
        _cells('["ascending"]', '["no.toml"]'),
        "no.toml: cannot be rea",
    ),
    "task file that no file can be": (_cells('["ascending"]', '["\\u0000.toml"]'), "\\x00.toml"),
    "task with an escape": (_cells('["ascending"]', '["\\u001b[2J"]'), "unknown task"),
    "task is the suite": (_cells('["ascending"]', '["bad.toml"]'), "bad.toml: "),
    "tasks by the thousand": (
        _cells('["ascending"]', "[" + '"a",' * 20_000 + "]"),
        "cells[0].tasks",
    ),
    "no methods": (
        _cells('["dual-process/EC1"]', "[]"),
        "cells[0].methods has too few entries",
    ),
    "methods is a text": (
        _cells('["dual-process/EC1"]', '"dual-process/EC1"'),
        "cells[0].methods",
    ),
    "unknown method": (_cells("dual-process/EC1", "dual-proces/EC1"), "did you mean 'dual-proces"),
    "unknown method beside all": (_cells('["dual-process/EC1"]', '["*", "x"]'), "unknown method"),
    "method that does not apply": (_cells("dual-process/EC1", "dual-process/EC3"), "no left hand"),
    "unknown parameter": (_block("parameters = { noise = 1.0 }"), "noise is an unknown key"),
    "parameter of another method": (
        _block("parameters = { most_nodes = 1 }"),
        "most_nodes is an unknown key",
    ),
    "parameter out of range": (_block("parameters = { epsilon = 1.5 }"), "epsilon is "),
    "parameter is negative": (_block("parameters = { noise_sd = -1 }"), "noise_sd is "),
    "parameter is far too large": (_block("parameters = { noise_sd = 1e9 }"), "noise_sd is "),
    "parameter is no number": (_block("parameters = { noise_sd = nan }"), "a finite number"),
    "parameter without end": (_block("parameters = { noise_sd = inf }"), "a finite number"),
    "parameter is a text": (_block('parameters = { noise_sd = "0.1" }'), "noise_sd is "),
    "parameter is a truth": (_block("parameters = { noise_sd = true }"), "noise_sd is "),
    "parameter is a date": (_block("parameters = { noise_sd = 2020-01-01 }"), "a finite number"),
    "parameter is a list": (_block("parameters = { noise_sd = [0.1] }"), "a finite number"),
    "parameter is a table": (_block("parameters = { noise_sd = { x = 1 } }"), "a finite number"),
    "parameter with an escape": (_block('parameters = { noise_sd = "\\u001b" }'), "printable"),
    "parameter in two lines": (_block('parameters = { noise_sd = "a\\nb" }'), "printable char"),
    "parameter too long": (_block(f'parameters = {{ noise_sd = "{"x" * 101}" }}'), "up to 100"),
    "parameter beyond integers": (_block("parameters = { trials = 9007199254740993 }"), "2^53"),
    "parameter in hexadecimal": (_block(f"parameters = {{ trials = 0x{'f' * 9000} }}"), "2^53"),
    "parameter with too many trials": (
        _block("parameters = { trials = 1_000_000_000 }"),
        "trials",
    ),
    "grid with too many trials": (
        _block("grid = { trials = [1, 1_000_000_000] }"),
        "trials a run",
    ),
    "parameter with no trials": (_block("parameters = { trials = 0 }"), "trials is "),
    "parameter with half a trial": (
        _block("parameters = { trials = 1.5 }"),
        "trials is ",
    ),
    "parameter name with an escape": (
        _block('parameters = { "\\u001b" = 1 }'),
        " is an unknown key",
    ),
    "parameters is a list": (_block("parameters = [1]"), "cells[0].parameters is "),
    "parameters by the hundred": (
        _block("[cells.parameters]\n" + "\n".join(f"p{i} = 1" for i in range(100))),
        "cells[0].parameters has",
    ),
    "parameter in grid, too": (
        _block("parameters = { noise_sd = 0.1 }\ngrid = { noise_sd = [0.2] }"),
        "'noise_sd' stands among the parameters and in the grid",
    ),
    "grid without values": (_block("grid = { noise_sd = [] }"), "cells[0].grid.noise_sd"),
    "grid is a number": (_block("grid = 3"), "cells[0].grid is "),
    "grid of a number": (_block("grid = { noise_sd = 0.1 }"), "cells[0].grid.noise_sd"),
    "grid of lists": (_block("grid = { noise_sd = [[0.1]] }"), "a finite number"),
    "grid of no numbers": (_block("grid = { noise_sd = [nan, nan] }"), "a finite number"),
    "grid of bad values": (_block("grid = { noise_sd = [0.1, -1.0] }"), "noise_sd is "),
    "grid of an unknown parameter": (_block("grid = { nois = [0.1] }"), "nois is an unknown key"),
    "grid with a value twice": (_block("grid = { noise_sd = [0.1, 0.10] }"), "same value twice"),
    "grid with a number twice": (_block("grid = { noise_sd = [1, 1.0] }"), "same value twice"),
    "grid of a million cells": (
        _block(f"grid = {{ noise_sd = {GRID}, trials = {GRID} }}"),
        "asks for 1_000_000 cells (tasks x moves x methods x grid); at most 10_000",
    ),
    "grid of 10^50 cells": (
        _block("[cells.grid]\n" + "\n".join(f"p{i} = [0,1,2,3,4,5,6,7,8,9]" for i in range(50))),
        "cells (tasks x moves x methods x grid); at most 10_000",
    ),
    "grid of values by the thousand": (
        _block("grid = { noise_sd = [" + ", ".join(map(str, range(20_000))) + "] }"),
        "cells[0].grid.noise_sd has",
    ),
    "grid of a thousand dimensions": (
        _block("[cells.grid]\n" + "\n".join(f"p{i} = [0, 1]" for i in range(1000))),
        "cells[0].grid has",
    ),
    "cells of many blocks": (
        HEAD + (CELLS + "grid = { trials = " + GRID + " }\n") * 11,
        "asks for 11_000 cells",
    ),
    "cells of all methods": (
        _cells('["dual-process/EC1"]', '["*"]') + f"grid = {{ trials = {GRID} }}\n",
        "cells (tasks x moves x methods x grid)",
    ),
    "the same runs under two names": (
        HEAD + CELLS + "parameters = { noise_sd = 1 }\n" + CELLS + "grid = { noise_sd = [1.0] }\n",
        "are the same runs",
    ),
    "the same runs in two orders": (
        HEAD
        + (CELLS + "parameters = { noise_sd = 0.1, epsilon = 0.1 }\n")
        + (CELLS + "parameters = { epsilon = 0.1, noise_sd = 0.1 }\n"),
        "are the same runs",
    ),
    "the same runs by the suite's trials": (
        HEAD + CELLS + CELLS + "parameters = { trials = 5 }\n",
        "are the same runs",
    ),
    "move is a list": (_block("move = [1, 2]"), "cells[0].move is "),
    "move without a goal": (_block("move = { by = [[0, 1]] }"), "cells[0].move.goal is missing"),
    "move without places": (_block("move = { goal = 1 }"), "cells[0].move.by is missing"),
    "move of goal 0": (_move("0", "[[0, 1]]"), "cells[0].move.goal is "),
    "move of goal 4": (_move("4", "[[0, 1]]"), "task 'ascending' has no goal 4 to move"),
    "move of goal true": (_move("true", "[[0, 1]]"), "cells[0].move.goal is "),
    "move of goal 1.5": (_move("1.5", "[[0, 1]]"), "cells[0].move.goal is "),
    "move by nothing": (_move("1", "[]"), "cells[0].move.by has too few entries"),
    "move by one number": (_move("1", "[[0]]"), "cells[0].move.by[0][1] is missing"),
    "move by three numbers": (
        _move("1", "[[0, 1, 2]]"),
        "cells[0].move.by[0] has 3 entries; it takes 2",
    ),
    "move by a text": (_move("1", '[["0", 1]]'), "cells[0].move.by[0][0] is "),
    "move by a truth": (_move("1", "[[true, 1]]"), "cells[0].move.by[0][0] is "),
    "move by no number": (_move("1", "[[nan, 0]]"), "cells[0].move.by[0][0] is "),
    "move without end": (_move("1", "[[0, inf]]"), "cells[0].move.by[0][1] is "),
    "move far": (_move("1", "[[1e300, 0]]"), "cells[0].move.by[0][0] is "),
    "move out of the world": (_move("1", "[[1e4, 0]]"), "goals[0][0] is 10006.0; its size must"),
    "move twice alike": (_move("2", "[[0, 0.5], [0, 0.5]]"), "moved to the same place twice"),
    "move twice nearly alike": (
        _move("2", "[[0, 0], [0, 1e-17]]"),
        "moved to the same place twic",
    ),
    "move by minus nothing": (
        _move("2", "[[0, 0.0], [0, -0.0]]"),
        "moved to the same place twice",
    ),
    "move to places by the thousand": (
        _move("2", "[" + ",".join(f"[0,{i}]" for i in range(20_000)) + "]"),
        "cells[0].move.by has",
    ),
    "move with an unknown key": (
        _block("move = { goal = 1, by = [[0, 1]], of = 3 }"),
        "cells[0].move.of is an unknown key",
    ),
}


def _pipe(name: str) -> Callable[[], object]:
    return lambda: os.mkfifo(name)


def _link(target: str, name: str) -> Callable[[], object]:
    return lambda: os.symlink(target, name)


def _sparse(name: str) -> Callable[[], object]:
    def make() -> None:
        with open(name, "wb") as file:
            file.truncate(2**30)

    return make


def _socket(name: str) -> Callable[[], object]:
    def make() -> None:
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(name)

    return make


def _locked(name: str) -> Callable[[], object]:
    def make() -> None:
        Path(name).write_text("x")
        Path(name).chmod(0)

    return make


# What may stand where a file is expected: its content, or how it is made; part of the answer.
FILES: dict[str, tuple[bytes | Callable[[str], Callable[[], object]] | None, str]] = {
    "missing": (None, "cannot be read: No such file or directory"),
    "a folder": (lambda name: lambda: os.mkdir(name), "cannot be read: Is a directory"),
    "a pipe": (_pipe, "is not a regular file"),
    "a socket": (_socket, "cannot be read"),
    "endless": (lambda name: _link("/dev/zero", name), "is not a regular file"),
    "a device": (lambda name: _link("/dev/null", name), "is not a regular file"),
    "a link to itself": (lambda name: _link(name, name), "cannot be read"),
    "a link to nothing": (lambda name: _link("nothing", name), "cannot be read"),
    "a gigabyte": (_sparse, "is longer than 1_000_000 bytes"),
    "a little too long": (b"#" * 1_000_001, "is longer than 1_000_000 bytes"),
    "binary": (b"\xff\xfe\x00", "is not a text file in UTF-8"),
    "UTF-16": (GOOD.encode("utf-16"), "is not a text file in UTF-8"),
    "Latin-1": (b'title = "\xe9"\n' + GOOD.encode("latin-1"), "is not a text file in UTF-8"),
    "cut in a character": (b'title = "\xc3', "is not a text file in UTF-8"),
    "NULs": (b"\0" * 1000, "error: "),
    "a program": (Path(sys.executable).read_bytes()[:5000], "error: "),
}
if os.geteuid():
    FILES["not to be read"] = (_locked, "cannot be read: Permission denied")

METHODS = """
from coartic.method import Method


class Mine(Method):
    name = "mine"
    title = "Mine"
    citation = "None"
    told = frozenset()

    def solve(self, session):
        raise ValueError
"""


def run(suite: str, *arguments: str) -> tuple[str, ...]:
    """A suite's command, small where it is accepted."""
    return ("run", suite, "--out", "out", "--jobs", "1", *arguments)


PAPER = run("paper", "--tasks", "ascending", "--runs", "1", "--trials", "1")
LONG = "x" * 5_000
COMMANDS: dict[str, tuple[tuple[str, ...], str]] = {
    "unknown command": (("fly",), "No such command 'fly'"),
    "command in capitals": (("RUN",), "No such command 'RUN'"),
    "empty command": (("",), "No such command ''"),
    "command with an escape": (("\x1b[2Jfly",), "No such command"),
    "command in markup": (("[/red]",), "No such command '[/red]'"),
    "long command": ((LONG,), "No such command"),
    "unknown option": (("--nope",), "No such option: --nope"),
    "no command": ((), "Usage"),
    "run alone": (("run",), "Missing argument"),
    "run without --out": (("run", "paper"), "Missing option '--out'"),
    "unknown suite": (run("papr"), "did you mean 'paper'?"),
    "empty suite": (run(""), "unknown suite ''"),
    "suite in capitals": (run("PAPER"), "unknown suite 'PAPER'"),
    "suite is a folder": (run("."), "unknown suite '.'"),
    "suite of a folder above": (run("../paper"), "unknown suite '../paper'"),
    "suite is everything": (run("*"), "unknown suite '*'"),
    "suite with an escape": (run("\x1b[31mpaper"), "unknown suite '\\x1b[31mpaper'"),
    "suite with a bell": (run("\x07"), "unknown suite '\\x07'"),
    "suite in two lines": (run("a\nb"), "unknown suite 'a\\nb'"),
    "suite in markup": (run("[bold]x[/bold]"), "unknown suite '[bold]x[/bold]'"),
    "suite that is no text": (run("\udcff"), "argument '\\udcff' is not text"),
    "suite turned round": (run("\u202erepap"), "unknown suite '\\u202erepap'"),
    "long suite": (run(LONG), "unknown suite"),
    "file with an escape": (run("\x1b[2J.toml"), "\\x1b[2J.toml: cannot be read"),
    "file in two lines": (run("a\nb.toml"), "a | b.toml: cannot be read"),
    "file with a long name": (run(LONG[:300] + ".toml"), "File name too long"),
    "file that is no text": (run("\udcff.toml"), "argument '\\udcff.toml' is not text"),
    "two suites": (run("paper", "quick"), "unexpected extra argument(s) (quick)"),
    "--out is empty": (("run", "paper", "--out", ""), "--out is empty"),
    "--out is blank": (("run", "paper", "--out", " "), "--out is empty"),
    "report of nothing": (("report", ""), "the name of a folder is empty"),
    "report into nothing": (("report", ".", "--out", " "), "the name of a folder is empty"),
    "analysis of nothing": (("analyse", ""), "the name of a folder is empty"),
    "comparison with nothing": (("compare", ".", ""), "the name of a folder is empty"),
    "works behind nothing": (("cite", ""), "the name of a folder is empty"),
    "--out below a device": ((*PAPER, "--out", "/dev/null/x"), "cannot write"),
    "--out is a device": ((*PAPER, "--out", "/dev/null"), "cannot write /dev/null"),
    "--out is a long name": ((*PAPER, "--out", "x" * 300), "File name too long"),
    "--out in /proc": ((*PAPER, "--out", "/proc/x"), "cannot write"),
    "--out is no text": ((*PAPER, "--out", "\udcff"), "argument '\\udcff' is not text"),
    "--out without a value": (("run", "paper", "--out"), "requires an argument"),
    "--runs 0": (run("paper", "--runs", "0"), "Invalid value for '--runs'"),
    "--runs -1": (run("paper", "--runs", "-1"), "Invalid value for '--runs'"),
    "--runs 1.5": (run("paper", "--runs", "1.5"), "Invalid value for '--runs'"),
    "--runs 10^12": (run("paper", "--runs", "1000000000000"), "Invalid value for '--runs'"),
    "--runs 10^5000": (run("paper", "--runs", "1" + "0" * 5000), "Invalid value for '--runs'"),
    "--runs many": (run("paper", "--runs", "many"), "Invalid value for '--runs'"),
    "--runs nan": (run("paper", "--runs", "nan"), "Invalid value for '--runs'"),
    "--runs of nothing": (run("paper", "--runs", ""), "Invalid value for '--runs'"),
    "--runs of a whole comparison": (
        run("comparison", "--runs", "1000000"),
        "runs are planned (168 cells, 1_000_000 runs of each",
    ),
    "--trials 0": (run("paper", "--trials", "0"), "Invalid value for '--trials'"),
    "--trials many": (run("paper", "--trials", "many"), "Invalid value for '--trials'"),
    "--trials 10^12": (run("paper", "--trials", "1" + "0" * 12), "Invalid value for '--trials'"),
    "--jobs 0": (run("paper", "--jobs", "0"), "--jobs 0"),
    "--jobs -2": (run("paper", "--jobs", "-2"), "Invalid value for '--jobs'"),
    "--jobs 99999": (run("paper", "--jobs", "99999"), "Invalid value for '--jobs'"),
    "--jobs all": (run("paper", "--jobs", "all"), "Invalid value for '--jobs'"),
    "--seed -1": (run("paper", "--seed", "-1"), "Invalid value for '--seed'"),
    "--seed 1.5": (run("paper", "--seed", "1.5"), "Invalid value for '--seed'"),
    "--seed 10^30": ((*PAPER, "--seed", "1" + "0" * 30), "Invalid value for '--seed'"),
    "--time-limit 0": (run("paper", "--time-limit", "0"), "--time-limit 0"),
    "--time-limit -1": (run("paper", "--time-limit", "-1"), "--time-limit -1"),
    "--time-limit nan": (run("paper", "--time-limit", "nan"), "--time-limit nan"),
    "--time-limit inf": (run("paper", "--time-limit", "inf"), "--time-limit inf"),
    "--time-limit 1e300": ((*PAPER, "--time-limit", "1e300"), "at most 1_000_000"),
    "--time-limit x": (run("paper", "--time-limit", "x"), "Invalid value for '--time-limit'"),
    "--trial-budget 0": (run("paper", "--trial-budget", "0"), "Invalid value"),
    "--trial-budget 10^30": ((*PAPER, "--trial-budget", "1" + "0" * 30), "Invalid value"),
    "--retry-failed yes": (run("paper", "--retry-failed=yes"), "does not take a value"),
    "--tasks unknown": (run("paper", "--tasks", "nope"), "unknown task 'nope'"),
    "--tasks empty": (run("paper", "--tasks", ""), "has an empty name"),
    "--tasks with a comma": (run("paper", "--tasks", "ascending,"), "has an empty name"),
    "--tasks with two commas": (run("paper", "--tasks", "a,,b"), "has an empty name"),
    "--tasks with an escape": (run("paper", "--tasks", "\x1b[2J"), "unknown task '\\x1b[2J'"),
    "--tasks everything": (run("paper", "--tasks", "*"), "unknown task '*'"),
    "--tasks long": (run("paper", "--tasks", LONG), "unknown task"),
    "--methods unknown": (run("paper", "--methods", "EC9"), "unknown method 'EC9'"),
    "--methods empty": (run("paper", "--methods", ""), "has an empty name"),
    "--methods in small letters": (run("paper", "--methods", "ec1"), "unknown method 'ec1'"),
    "--methods with an escape": (run("paper", "--methods", "\x1b[2J"), "unknown method"),
    "--methods that do not apply": (
        run("paper", "--tasks", "ascending", "--methods", "EC4"),
        "no method to run on what was asked for: suite 'paper' has ascending x",
    ),
    "list of something": (("list", "tasks"), "unexpected extra argument(s) (tasks)"),
    "list --method-file missing": (("list", "--method-file", "no.py"), "no.py: cannot be read"),
    "check nothing": (("check", "nothing"), "unknown method 'nothing'"),
    "check of the empty": (("check", ""), "unknown method ''"),
    "check with an escape": (("check", "\x1b[2J"), "unknown method '\\x1b[2J'"),
    "show a missing run": (("show", "abc"), "no run 'abc' below results"),
    "show everything": (("show", "*"), "'*' is no run id"),
    "show the empty": (("show", ""), "is no run id"),
    "show a folder above": (("show", "../abc"), "is no run id"),
    "show with an escape": (("show", "\x1b[2J"), "is no run id"),
    "show below a missing folder": (("show", "abc", "--in", "no"), "no run 'abc' below no"),
    "show below a device": (("show", "abc", "--in", "/dev/null"), "no run 'abc' below /dev/null"),
    "reproduce a missing run": (("reproduce", "abc"), "no run 'abc' below results"),
    "reproduce everything": (("reproduce", "[a-z]"), "is no run id"),
    "animate a missing run": (("animate", "abc", "--out", "x.gif"), "no run 'abc' below results"),
    "animate into a picture": (("animate", "abc", "--out", "x.bmp"), "must end in .gif"),
    "animate at no speed": (("animate", "abc", "--out", "x.gif", "--speed", "0"), "'--speed'"),
    "animate at any speed": (("animate", "abc", "--out", "x.gif", "--speed", "x"), "'--speed'"),
    "animate in one pixel": (("animate", "abc", "--out", "x.gif", "--width", "1"), "'--width'"),
    "animate beside itself": (
        ("animate", "abc", "abd", "--out", "x.gif", "--initial"),
        "give one run id",
    ),
    "analyse nothing": (("analyse",), "Missing argument"),
    "analyse a missing folder": (("analyse", "no"), "does not exist"),
    "analyse an empty folder": (("analyse", "."), "not a results folder"),
    "analyse a device": (("analyse", "/dev/null"), "not a results folder"),
    "report a missing folder": (("report", "no"), "does not exist"),
    "report a folder with an escape": (("report", "\x1b[2J"), "does not exist"),
    "compare one folder": (("compare", "a"), "Missing argument"),
    "compare missing folders": (("compare", "a", "b"), "does not exist"),
    "compare into a text": (("compare", "a", "b", "--out", "x.txt"), "must end in .md"),
    "compare into no table": (("compare", "a", "b", "--csv", "x.md"), "must end in .csv"),
    "cite a missing folder": (("cite", "no"), "does not exist"),
    "cite in another format": (("cite", "--format", "ris"), "the one format is bibtex"),
    "trace nothing": (("trace",), "Missing argument"),
    "trace a missing report": (("trace", "coarticX", "--in", "no"), "error: "),
    "draw nowhere": (("draw",), "Missing option '--out'"),
    "draw into a bitmap": (("draw", "--out", "x.bmp"), "the name must end in .png"),
    "draw into the empty": (("draw", "--out", ""), "the name must end in .png"),
    "draw below a device": (
        ("draw", "--out", "/dev/null/x.png", "--tasks", "ascending"),
        "cannot write /dev/null/x.png",
    ),
    "draw an unknown task": (("draw", "--out", "x.png", "--tasks", "nope"), "unknown task 'nope'"),
    "draw no task": (("draw", "--out", "x.png", "--tasks", ""), "has an empty name"),
}


def _make_cases() -> list[Case]:
    def case(kind: str, name: str, argv: tuple[str, ...], words: str, **more: object) -> None:
        found.append(Case(f"{kind}: {name}", argv, words, **more))  # type: ignore[arg-type]

    draw = ("draw", "--out", "x.svg", "--task-file", "bad.toml")
    own = ("--task-file", "bad.toml")
    found: list[Case] = []
    for name, (argv, words) in COMMANDS.items():
        case("command", name, argv, words)
    for name, (text, words) in TASKS.items():
        case("task", name, draw, words, files={"bad.toml": text})
    for name, (text, words) in SUITES.items():
        case("suite", name, run("bad.toml"), words, files={"bad.toml": text})
    for name, (content, words) in FILES.items():
        for kind, argv, file in (
            ("task file", draw, "bad.toml"),
            ("suite file", run("bad.toml"), "bad.toml"),
            ("method file", ("list", "--method-file", "bad.py"), "bad.py"),
        ):
            if isinstance(content, bytes):
                case(kind, name, argv, words, files={file: content})
            else:
                case(kind, name, argv, words, prepare=content and content(file))
    case("task", "run", (*PAPER, *own), "goals is missing", files={"bad.toml": ""})
    case("task", "twice", (*PAPER, *own, *own), "given twice", files={"bad.toml": GOOD})
    for name, radius in (("below accuracy", "0.005"), ("the smallest", "5e-324")):
        small = {"bad.toml": f"radius = {radius}" + GOOD}
        words = (
            f"task 'mine': model.correction_tolerance 0.01 is not below the goals' radius {radius}"
        )
        case("task", f"radius {name}", (*PAPER[:4], *own), words, files=small)
    both = {"bad.toml": GOOD, "other.toml": GOOD}
    case("task", "name twice", (*PAPER, *own, "--task-file", "other.toml"), "taken", files=both)
    shipped = GOOD.replace('"mine"', '"ascending"')
    case("task", "name of ours", (*PAPER, *own), "by a shipped task", files={"bad.toml": shipped})
    left = 'hands = ["left"]' + GOOD.replace('"RR"', '"LL"')
    case("task", "no method", (*PAPER[:4], *own), "no method to run", files={"bad.toml": left})
    moved = {
        "bad.toml": _move("2", "[[0, 1]]"),
        "own.toml": GOOD.replace('"mine"', '"ascending.goal2_0_1"'),
    }
    command = (*run("bad.toml"), "--task-file", "own.toml")
    case("suite", "task of a moved goal's name", command, "two different tasks", files=moved)
    named = {"bad.toml": _cells('"ascending"]', '"ascending", "own.toml"]'), "own.toml": shipped}
    case("suite", "task of a shipped name", run("bad.toml"), "two different tasks", files=named)
    spaces = {"my suite.toml": HEAD + CELLS}
    case("suite", "file name with spaces", run("my suite.toml"), "use letters", files=spaces)
    for name, source, words in (
        ("empty", "", "defines no subclass"),
        ("syntax", "def x(:\n", "cannot be run: SyntaxError"),
        ("raises", "raise RuntimeError('no')\n", "cannot be run: RuntimeError: no"),
        ("taken", METHODS.replace('"mine"', '"dual-process/EC1"'), "is reserved"),
        ("no title", METHODS.replace('    title = "Mine"\n', ""), "does not declare 'title'"),
        ("name is a number", METHODS.replace('"mine"', "3"), "name is 3 (int); it must be a text"),
    ):
        listing = ("list", "--method-file", "bad.py")
        case("method", name, listing, words, files={"bad.py": source})
    occupied = {"out": "a file"}
    case("files", "--out is a file", PAPER, "cannot write out", files=occupied)
    case("files", "--out is a link to itself", PAPER, "cannot write out",
         prepare=_link("out", "out"))  # fmt: skip
    case("files", "picture is a folder", ("draw", "--out", "x.png", "--tasks", "ascending"),
         "cannot write x.png",
         prepare=lambda: os.mkdir("x.png"))  # fmt: skip
    case("files", "results are a file", ("analyse", "out"), "not a results", files=occupied)
    case("files", "results without a manifest", ("report", "out"), "not a results folder",
         prepare=lambda: os.mkdir("out"))  # fmt: skip
    for columns in ("x", "0", "-5", "1" + "0" * 30):
        width = {"COLUMNS": columns}
        case("surroundings", f"COLUMNS={columns}", ("list",), "Tasks", env=width, code=0)
    window = {"MPLBACKEND": "nonsense"}
    nope = COMMANDS["draw an unknown task"]
    case("surroundings", "MPLBACKEND", *nope, env=window, shell="")
    for name in ("analysis", "baselines", "benchmarks"):  # a user's own; ours are within coartic
        case("surroundings", f"module {name}", ("list",), "Tasks", code=0,
             files={f"{name}.py": "raise ImportError\n"})  # fmt: skip
    full = "No space left on device"
    case("surroundings", "output is full", ("--version",), full, shell="> /dev/full", code=1)
    case("surroundings", "output is closed", ("--version",), "", shell=">&-", code=0)
    case("surroundings", "errors are closed", ("--version",), "coartic ", shell="2>&-", code=0)
    return found


CASES = _make_cases()
assert len({case.id for case in CASES}) == len(CASES)


def attack(root: Path, cases: Sequence[str] = (), *, words: bool = True) -> list[Outcome]:
    """Try every case (or those named) on the checkout at ``root``, in a process of its own.

    ``words=False`` lets any sentence pass: other versions say it otherwise.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kept = {key: os.environ[key] for key in ("PATH", "LANG", "TMPDIR") if key in os.environ}
        env = kept | {"HOME": name, "PYTHONPATH": str(root), "COLUMNS": "250", "NO_COLOR": "1"}
        (folder / "cases.json").write_text(json.dumps(list(cases)), encoding="utf-8")
        with (folder / "failed.txt").open("w+") as failed:
            if _is_loaded(root):
                _import_all()  # not in the fork, which would take it along
                code = _forked(folder, env, failed.fileno())
            else:
                command = [sys.executable, "-P", __file__, "--here"]
                code = subprocess.run(command, cwd=folder, env=env, stderr=failed).returncode
            if code:
                failed.seek(0)
                raise RuntimeError(f"the attack on {root} itself failed: {failed.read()[-2000:]}")
        outcomes = json.loads((folder / "outcomes.json").read_text(encoding="utf-8"))
    for outcome in outcomes:
        outcome["problems"] = tuple(
            text for text in outcome["problems"] if words or not text.startswith(_OTHER_WORDS)
        )
    return [Outcome(**outcome) for outcome in outcomes]


def _is_loaded(root: Path) -> bool:
    """Whether this process has imported that checkout: a fork of it need not do so again."""
    found = getattr(sys.modules.get("coartic.cli"), "__file__", None)
    return found is not None and Path(found).is_relative_to(root / "coartic")


def _forked(folder: Path, env: Mapping[str, str], stderr: int) -> int:
    """Exit code of :func:`_here` in a fork of this process, which is as if it had just begun,
    whatever runs tests in this one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads, which a fork does not have
        child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    try:
        os.dup2(stderr, 2)
        sys.stdin = os.fdopen(0, closefd=False)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
        warnings.resetwarnings()
        for category in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
            warnings.simplefilter("ignore", category)
        os.environ.clear()
        os.environ.update(env)
        os.chdir(folder)
        _here()
        os._exit(0)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
    os._exit(1)


# What follows runs in the surroundings of the checkout that is attacked.

_COMMANDS_IMPORT = (
    *(
        "coartic.cli",
        "coartic.benchmarks.suites",
        "coartic.benchmarks.harness",
        "coartic.benchmarks.executors",
    ),
    *(
        "coartic.benchmarks.tables",
        "coartic.benchmarks.reproduce",
        "coartic.benchmarks.conformance",
    ),
    *(
        "coartic.analysis.comparisons.paper",
        "coartic.analysis.comparisons.methods",
        "coartic.analysis.results.folder",
        "coartic.analysis.figures.tasks",
    ),
    *(
        "coartic.analysis.claims",
        "coartic.analysis.citations",
        "coartic.analysis.figures.animation",
        "coartic.analysis.comparisons.versions",
    ),
    *("coartic.analysis.study", "coartic.analysis.report.build", "coartic.analysis.report.trace"),
)


def _import_all() -> None:
    for module in _COMMANDS_IMPORT:
        with contextlib.suppress(ImportError):  # of another version
            importlib.import_module(module)


def _here() -> None:
    _import_all()
    line: Any = importlib.import_module("coartic.cli")
    if hasattr(line, "app"):  # put together once, not for every case
        from typer.main import get_command

        line.app = get_command(line.app)
    gc.collect()
    gc.freeze()  # or every fork copies what it looks through
    here = Path.cwd()
    wanted = json.loads((here / "cases.json").read_text(encoding="utf-8"))
    tried = {here / f"case-{n}": c for n, c in enumerate(CASES) if not wanted or c.id in wanted}
    for folder, case in tried.items():
        _prepare(case, folder / "here")
    before = {folder: _snapshot(folder) for folder in tried}
    answers = _answers(tried, here / "answers.txt")
    outcomes = []
    for folder, case in tried.items():
        code, seconds, text = answers[folder]
        after = _snapshot(folder)
        paths = sorted(before[folder].keys() | after.keys())
        changed = [path for path in paths if before[folder].get(path) != after.get(path)]
        problems = list(_problems(case, code, text, seconds))
        problems += [f"{', '.join(changed[:3])} changed"] if changed else []
        outcomes.append(asdict(Outcome(case.id, tuple(problems), text[:_LONGEST], seconds)))
    (here / "outcomes.json").write_text(json.dumps(outcomes), encoding="utf-8")


def _prepare(case: Case, folder: Path) -> None:
    folder.mkdir(parents=True)
    os.chdir(folder)
    for name, content in case.files.items():
        Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    if case.prepare is not None:
        case.prepare()


def _answers(cases: Mapping[Path, Case], log: Path) -> dict[Path, tuple[int, float, str]]:
    """Exit code, CPU time and output of every case, by its folder.

    One child tries case after case. After one that was not answered as expected, and what it may
    have left running, another child goes on.
    """
    found: dict[Path, tuple[int, float, str]] = {}
    log.touch()
    while left := {folder: case for folder, case in cases.items() if folder not in found}:
        child = os.fork()
        if not child:
            _become(left, log)
        _, status, used = os.wait4(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        codes = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
        if len(codes) == len(found):  # the first case left was the child's end
            seconds = used.ru_utime + used.ru_stime
            codes.append((os.waitstatus_to_exitcode(status), seconds))
            log.write_text("".join(f"{json.dumps(entry)}\n" for entry in codes), encoding="utf-8")
        for folder, (code, seconds) in zip(left, codes[len(found) :], strict=False):
            said = (folder / "said.txt").read_text(encoding="utf-8", errors="backslashreplace")
            found[folder] = (code, seconds, said)
    return found


def _become(cases: Mapping[Path, Case], log: Path) -> NoReturn:
    """What a child does: case after case, exit code and CPU time into the log."""
    os.setpgid(0, 0)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + _MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for folder, case in cases.items():
        output = os.open(folder / "said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for target in (1, 2):
            os.dup2(output, target)
        os.close(output)
        os.chdir(folder / "here")
        signal.alarm(_HANGS_S)
        before = sum(os.times()[:4])
        code = _command(case)
        seconds = sum(os.times()[:4]) - before
        signal.alarm(0)
        with log.open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps((code, seconds))}\n")
        if code != case.code:
            break
    os._exit(0)


def _command(case: Case) -> int:
    """Exit code of a case's command."""
    if case.shell is not None:
        words = shlex.join([sys.executable, "-m", "coartic", *case.argv])
        command = ["bash", "-o", "pipefail", "-c", f"{words} {case.shell}"]
        return subprocess.run(command, env=os.environ | case.env).returncode
    kept = dict(os.environ)
    os.environ.update(case.env)
    sys.argv = ["coartic", *case.argv]
    code: object = 0
    try:
        importlib.import_module("coartic.cli").main()
    except SystemExit as stop:
        code = stop.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    finally:
        os.environ.clear()
        os.environ.update(kept)
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    return code if isinstance(code, int) else 1


def _snapshot(folder: Path) -> dict[str, tuple[int, int, int]]:
    found = {}
    for path in folder.rglob("*"):
        if path.name != "said.txt":
            status = path.lstat()
            entry = (status.st_mode, status.st_size, status.st_mtime_ns)
            found[str(path.relative_to(folder))] = entry
    return found


def _problems(case: Case, code: int, answer: str, seconds: float) -> Iterator[str]:
    if code == -signal.SIGALRM:
        yield f"no answer within {_HANGS_S} s"
    elif code != case.code:
        yield f"exit code {code}, not {case.code}"
    if "Traceback" in answer:
        yield f"a traceback: {answer.strip().splitlines()[-1][:80]}"
    lines = [line.strip() for line in answer.splitlines()]
    if case.code and not any(
        line.startswith(("error: ", "Usage: ", "╭─ Error ")) for line in lines
    ):
        yield "no sentence"
    if case.words not in " ".join(answer.replace("│", " ").split()):
        yield f"{_OTHER_WORDS} {case.words!r}"
    if odd := {c for c in answer if not c.isprintable() and c != "\n"}:
        yield f"control characters: {', '.join(map(ascii, sorted(odd)))}"
    if len(answer) > _LONGEST:
        yield f"{len(answer)} characters"
    if seconds > SECONDS:
        yield f"{seconds:.0f} s of CPU time"


def main() -> None:
    """Attack a checkout, this one by default, and print what was not answered as it should be."""
    root = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT
    outcomes = attack(root, words=root == ROOT)
    bad = [outcome for outcome in outcomes if outcome.problems]
    for outcome in bad:
        print(f"{outcome.id}: {'; '.join(outcome.problems)}")
    print(f"{len(outcomes) - len(bad)} of {len(outcomes)} bad inputs answered in {root}.")
    sys.exit(bool(bad))


if __name__ == "__main__":
    _here() if sys.argv[1:2] == ["--here"] else main()
