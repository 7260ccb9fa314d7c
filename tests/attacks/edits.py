"""Edits of a finished results folder: one figure here, one row there, a key of the manifest.

Every command that reads the folder has to refuse it, and to name the file or the run. What
there is to edit is read from the folder itself, so that every column and key has its turn.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from tests.support.packs import pack_of, packs_of, read_pack, records_of, write_pack

from .checkout import Driver, Ended, read_json, run

Edit = Callable[[Path], None]
TABLES = ("runs", "solutions", "paths", "learning", "sequences")
SUITE = """
title = "Small"
description = "One method of each kind."
runs = 2
trials = 40

[[cells]]
tasks = ["ascending"]
methods = ["dual-process/EC1", "nullspace-qp/none", "corrective-alone/given"]

[[cells]]
tasks = ["ascending"]
methods = ["optimum/branch-and-bound"]
parameters = { nodes = 40, graphs = 1, chains = 5 }

[[cells]]
tasks = ["two-armed-2"]
methods = ["dual-process/EC4", "random-search/climbing"]
"""
OTHER_WORDS = {
    "left": "right", "right": "left", "LRLR": "RRRR", "ok": "crashed", "planned": "learned",
    "learned": "corrective", "corrective": "learned", "path": "planned",
}  # fmt: skip


def other(value: Any) -> Any:
    """Another value of the same kind, one that could have been."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return math.nextafter(value, math.inf)
        case str():
            return OTHER_WORDS.get(value, value[:-1] + ("0" if value[-1:] != "0" else "1"))
        case list():
            return value[:-1] if value else [0]
        case dict():
            return {**value, "more": 1}
        case _:
            return 1


# Tables.


def rows_of(folder: Path, name: str) -> list[dict[str, Any]]:
    """The rows of a table."""
    rows: list[dict[str, Any]] = pq.read_table(folder / f"{name}.parquet").to_pylist()
    return rows


def change_rows(
    name: str, change: Callable[[list[dict[str, Any]]], list[dict[str, Any]] | None], folder: Path
) -> None:
    """Rewrite a table with its rows changed, and nothing else."""
    path = folder / f"{name}.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    rows = change(rows) or rows
    pq.write_table(pa.Table.from_pylist(rows, schema=table.schema), path)


def change_table(name: str, change: Callable[[pa.Table], pa.Table], folder: Path) -> None:
    """Rewrite a table as another one."""
    path = folder / f"{name}.parquet"
    pq.write_table(change(pq.read_table(path)), path)


def _set(
    column: str,
    value: Any,
    rows: list[dict[str, Any]],
    where: Callable[[dict[str, Any]], bool] = lambda row: True,
) -> None:
    """One value of one row changed: ``value`` is the new one, or a function of the old one."""
    row = next((row for row in rows if row[column] is not None and where(row)), rows[0])
    row[column] = value(row[column]) if callable(value) else value


def _empty(column: str, rows: list[dict[str, Any]]) -> None:
    """A value where there was none."""
    row = next(row for row in rows if row[column] is None)
    row[column] = next((r[column] for r in rows if r[column] is not None), 1)


def _swap(first: int, second: int, rows: list[dict[str, Any]]) -> None:
    rows[first], rows[second] = rows[second], rows[first]


def _exchange(column: str, first: int, second: int, rows: list[dict[str, Any]]) -> None:
    rows[first][column], rows[second][column] = rows[second][column], rows[first][column]


def _as_text(column: str, table: pa.Table) -> pa.Table:
    index = table.schema.get_field_index(column)
    return table.set_column(index, column, table.column(column).cast(pa.string()))


def _as_float(column: str, table: pa.Table) -> pa.Table:
    index = table.schema.get_field_index(column)
    return table.set_column(index, column, table.column(column).cast(pa.float64()))


def table_edits(folder: Path) -> Iterator[tuple[str, Edit]]:
    """Every column of every table, and its rows and columns as a whole."""
    for name in TABLES:
        schema = pq.read_schema(folder / f"{name}.parquet")
        rows = rows_of(folder, name)
        for column in schema.names:
            filled = {row[column] is not None for row in rows}
            first = "x" if pa.types.is_string(schema.field(column).type) else 1
            another = other if True in filled else first
            yield f"{name}/{column}", partial(change_rows, name, partial(_set, column, another))
            if filled == {True, False}:
                yield (
                    f"{name}/{column} filled",
                    partial(change_rows, name, partial(_empty, column)),
                )
            if True in filled:
                yield (
                    f"{name}/{column} emptied",
                    partial(change_rows, name, partial(_set, column, None)),
                )
        number = next(f.name for f in reversed(list(schema)) if pa.types.is_integer(f.type))
        middle = len(rows) // 2
        for what, change in {
            "row dropped": lambda rows, m=middle: rows[:m] + rows[m + 1 :],
            "first row dropped": lambda rows: rows[1:],
            "row doubled": lambda rows, m=middle: [*rows[:m], rows[m], *rows[m:]],
            "rows swapped": partial(_swap, 0, len(rows) - 1),
            "rows reversed": lambda rows: rows[::-1],
            "one empty row": lambda rows: [dict.fromkeys(rows[0])],
        }.items():
            yield f"{name}/{what}", partial(change_rows, name, change)
        for what, remake in {
            "another column": lambda t: t.append_column("note", pa.array(["x"] * len(t))),
            "column dropped": lambda t: t.drop_columns(t.column_names[-1:]),
            "columns swapped": lambda t: t.select(t.column_names[::-1]),
            "number as text": partial(_as_text, number),
            "number as float": partial(_as_float, number),
            "no rows": lambda t: t.slice(0, 0),
        }.items():
            yield f"{name}/{what}", partial(change_table, name, remake)
        for what, harm in HARM.items():
            yield f"{name}/{what}", partial(_harm, f"{name}.parquet", harm)
        yield (
            f"{name}/of another table",
            partial(_copy, name, "paths" if name != "paths" else "runs"),
        )

    def one(what: str, name: str, *arguments: Any, **options: Any) -> tuple[str, Edit]:
        return f"{name}/{what}", partial(change_rows, name, partial(_set, *arguments, **options))

    def of_learner(row: dict[str, Any]) -> bool:
        return bool(row["method"].startswith("dual-process/"))

    yield one("better reward", "runs", "reward", lambda old: old + 30, where=of_learner)
    yield one("worse initial reward", "runs", "initial_reward", lambda old: old - 30)
    yield one("seed of another", "runs", "seed", 7)
    yield one("solved run as crashed", "runs", "status", "crashed")
    yield one("told nothing", "runs", "told", "")
    yield one("no trials", "runs", "trials", 0, where=of_learner)
    yield one("faster", "runs", "wall_s", 1e-6)
    yield one("NaN", "runs", "cpu_s", math.nan)
    yield one("infinite", "runs", "wall_s", math.inf)
    yield one("clean commit", "runs", "commit", lambda old: old.rstrip("+") + "+")
    yield one("bound moved to the reward", "runs", "proven_bound", lambda old: old - 1)
    yield (
        "runs/rewards of two runs exchanged",
        partial(change_rows, "runs", partial(_exchange, "reward", 0, 1)),
    )
    yield (
        "runs/names of two methods exchanged",
        partial(change_rows, "runs", partial(_exchange, "method", 0, 2)),
    )
    joint = "right_2"
    for what, by in {"an ulp": other, "1e-3": lambda old: old + 1e-3, "NaN": math.nan}.items():
        yield one(f"joint by {what}", "solutions", joint, by)
        yield one(f"waypoint by {what}", "paths", joint, by)
    yield (
        "solutions/ticks moved between movements",
        partial(change_rows, "solutions", _ticks_moved),
    )
    yield one("a better trial", "learning", "reward", lambda old: old + 300)
    yield (
        "learning/trials exchanged",
        partial(change_rows, "learning", partial(_exchange, "reward", 3, 4)),
    )
    yield one("better", "sequences", "reward", lambda old: old + 30)


def _ticks_moved(rows: list[dict[str, Any]]) -> None:
    rows[0]["ticks"] += 1
    rows[1]["ticks"] -= 1


def _copy(to: str, source: str, folder: Path) -> None:
    shutil.copy(folder / f"{source}.parquet", folder / f"{to}.parquet")


# Any file.


def _flip(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


HARM: dict[str, Callable[[bytes], bytes | None]] = {
    "bit flipped": _flip,
    "truncated": lambda data: data[:-7],
    "empty": lambda data: b"",
    "not itself": lambda data: b"run_id,reward\n1,2\n",
    "deleted": lambda data: None,
}


def _harm(name: str, harm: Callable[[bytes], bytes | None], folder: Path) -> None:
    path = folder / name
    data = harm(path.read_bytes())
    path.unlink()
    if data is not None:
        path.write_bytes(data)


# The manifest.

Where = tuple[str | int, ...]


def _leaves(content: Any, where: Where = ()) -> Iterator[tuple[Where, Any]]:
    yield where, content
    if isinstance(content, dict | list):
        items = content.items() if isinstance(content, dict) else enumerate(content)
        for key, value in items:
            yield from _leaves(value, (*where, key))


def change_manifest(change: Callable[[dict[str, Any]], None], folder: Path) -> None:
    """Rewrite the manifest with something changed."""
    path = folder / "manifest.json"
    content = read_json(path)
    change(content)
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def at(where: Where, change: Callable[[Any], Any], content: Any) -> None:
    """Change what is at one place of nested data."""
    for key in where[:-1]:
        content = content[key]
    content[where[-1]] = change(content[where[-1]])


def _without(where: Where, content: Any) -> None:
    for key in where[:-1]:
        content = content[key]
    del content[where[-1]]


def _renamed(kind: str, content: Any) -> None:
    table = content["specification"][kind]
    first = next(iter(table))
    content["specification"][kind] = {
        (f"{key}-x" if key == first else key): value for key, value in table.items()
    }


def manifest_edits(folder: Path) -> Iterator[tuple[str, Edit]]:
    """One place of every kind in the manifest changed, one of every kind missing, and more."""
    manifest = read_json(folder / "manifest.json")
    # Where a cell gives a parameter, the default says nothing of its runs.
    given = {name for cell in manifest["specification"]["cells"] for name in cell["parameters"]}
    seen = {f"specification/methods/*/defaults/{name}" for name in given}
    for where, value in _leaves(manifest):
        # Tasks, methods, packages and lists have many entries of one kind: one is enough.
        steps = ["*" if isinstance(key, int) else key for key in where]
        for named in ("tasks", "methods", "packages"):
            if named in steps[:-1]:
                steps[steps.index(named) + 1] = "*"
        kind = "/".join(map(str, steps))
        if not where or kind in seen:
            continue
        seen.add(kind)
        if not (isinstance(value, dict) and steps[-1] == "*"):
            yield f"manifest/{kind}", partial(change_manifest, partial(at, where, other))
        if len(where) <= 2:
            yield f"manifest/{kind} gone", partial(change_manifest, partial(_without, where))
            yield (
                f"manifest/{kind} as text",
                partial(change_manifest, partial(at, where, lambda old: "x")),
            )

    def one(what: str, *where: str | int, change: Callable[[Any], Any]) -> tuple[str, Edit]:
        full = ("specification", *where)
        return f"manifest/{what}", partial(change_manifest, partial(at, full, change))

    yield one("goal moved by 1e-6", "tasks", "ascending", "goals", 1, 0, change=lambda x: x + 1e-6)
    yield one("radius grown", "tasks", "ascending", "radius", change=lambda x: x + 0.05)
    yield one("locked", "tasks", "ascending", "locked_base", change=lambda x: ["y"])
    yield one("cells reversed", "cells", change=lambda x: x[::-1])
    yield one("cell doubled", "cells", change=lambda x: [*x, x[0]])
    yield one("cell dropped", "cells", change=lambda x: x[1:])
    yield one("a run more", "runs", change=lambda x: x + 1)
    yield one("a run less", "runs", change=lambda x: x - 1)
    yield one("code", "methods", "dual-process/EC1", "code", change=lambda x: "0" * len(x))
    yield one("variant", "cells", 0, "variant", change=lambda x: "noise_sd=0.1")
    yield one("parameters", "cells", 0, "parameters", change=lambda x: {"noise_sd": 0.1})
    yield one("told all", "methods", "dual-process/EC1", "told", change=lambda x: [*x, "goals"])
    yield one("seed of another", "seed", change=lambda x: x + 1)
    yield "manifest/task renamed", partial(change_manifest, partial(_renamed, "tasks"))
    yield "manifest/method renamed", partial(change_manifest, partial(_renamed, "methods"))
    for what, harm in HARM.items():
        if what != "bit flipped":
            yield f"manifest/{what}", partial(_harm, "manifest.json", harm)


# Records.


def learner_first(folder: Path) -> list[str]:
    """Ids of the runs of a folder, those of learners before the others."""
    records = records_of(folder)
    return sorted(records, key=lambda run: not method_of(records[run]).startswith("dual-process"))


def method_of(record: dict[str, Any]) -> str:
    """Id of the method of a record."""
    return str(record["specification"]["method"])


def record_edits(folder: Path) -> Iterator[tuple[str, Edit]]:
    """One record harmed, or in the wrong place."""
    first, second = learner_first(folder)[:2]
    pack = pack_of(folder, first)
    path = str(pack.relative_to(folder))
    others = [other for other in packs_of(folder) if other != pack]
    for what, harm in HARM.items():
        yield f"records/{what}", partial(_harm, path, harm)
    for what, harm in {
        "figure changed": lambda data: data.replace(b'"reward":-3', b'"reward":-2', 1),
        "head gone": lambda data: data.partition(b"\n")[2],
        "lines as of Windows": lambda data: data.replace(b"\n", b"\r\n"),
        "not JSON": lambda data: b"%s %s nothing\n" % (first.encode(), b"0" * 64),
        "checksum of nothing": lambda data: re.sub(
            rb" [0-9a-f]{64} ", b" %b " % (b"0" * 64), data
        ),
    }.items():
        yield f"records/{what}", partial(_harm, path, harm)
    yield "packs/a line more", partial(_harm, path, lambda data: data + b"{}\n")
    yield (
        "records/under a name that is none",
        lambda f: (f / path).rename(f / "records" / "1.pack"),
    )
    yield "records/under another's name", partial(_renamed_line, first, second)
    yield "records/names exchanged", partial(_exchanged_names, first, second)
    yield "records/a folder", partial(_folder_instead, path)
    if others:
        yield "records/a link to another", partial(_link_instead, path, others[0].name)
    yield "records/all gone", lambda f: shutil.rmtree(f / "records")


def _renamed_line(first: str, second: str, folder: Path) -> None:
    for path in packs_of(folder):
        path.write_bytes(path.read_bytes().replace(f"{first} ".encode(), f"{second} ".encode()))


def _exchanged_names(first: str, second: str, folder: Path) -> None:
    for old, new in ((first, "?"), (second, first), ("?", second)):
        _renamed_line(old, new, folder)


def _folder_instead(path: str, folder: Path) -> None:
    (folder / path).unlink()
    (folder / path).mkdir()


def _link_instead(path: str, other: str, folder: Path) -> None:
    (folder / path).unlink()
    (folder / path).symlink_to(other)


# More than one file at once.


def dropped_everywhere(run_id: str, folder: Path) -> None:
    """A run that nobody should see, left out of every table, the manifest and the records."""
    for name in TABLES[:-1]:
        change_rows(name, lambda rows: [r for r in rows if r["run_id"] != run_id], folder)

    path = pack_of(folder, run_id)
    write_pack(path, {other: kept for other, kept in read_pack(path).items() if other != run_id})


def consistent_edits(folder: Path) -> Iterator[tuple[str, Edit]]:
    """Edits that agree in all tables, so that only the records can tell."""
    run_ids = [r["run_id"] for r in rows_of(folder, "runs") if r["method"] == "dual-process/EC1"]
    first = run_ids[0]

    def better(folder: Path) -> None:
        def reward(rows: list[dict[str, Any]]) -> None:
            for row in rows:
                if row["run_id"] == first:
                    row["reward"] += 10

        def ticks(rows: list[dict[str, Any]]) -> None:
            next(row for row in rows if row["run_id"] == first)["ticks"] -= 10

        def learnt(rows: list[dict[str, Any]]) -> None:
            best = max(row["reward"] for row in rows if row["run_id"] == first)
            for row in rows:
                if row["run_id"] == first and row["reward"] == best:
                    row["reward"] += 10

        change_rows("runs", reward, folder)
        change_rows("solutions", ticks, folder)
        change_rows("learning", learnt, folder)

    def curve(folder: Path) -> None:
        def steeper(rows: list[dict[str, Any]]) -> None:
            own = [row for row in rows if row["run_id"] == first]
            for row in own[1:-1]:
                row["reward"] -= 1

        change_rows("learning", steeper, folder)

    yield "together/a better run in all tables", better
    yield "together/a run left out everywhere", partial(dropped_everywhere, run_ids[-1])
    yield "together/another learning curve", curve


UNSEEN = re.compile(
    r"sealed/manifest/(environment.*|records.*|limits/time_s|specification/(suite|methods/\*/(title|citation|defaults/trials)))"
)
"""Edits of a manifest whose seal was made anew, of words and surroundings that nothing else in a
folder repeats, and of the hash of the records, which who reads them needs not."""


def _sealed(edit: Edit, folder: Path) -> None:
    """An edit of the manifest by somebody who knows how it is sealed."""
    edit(folder)
    path = folder / "manifest.json"
    content = read_json(path)
    content.pop("seal", None)
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    content["seal"] = hashlib.sha256(text.encode()).hexdigest()
    path.write_text(json.dumps(content), encoding="utf-8")


def sealed_edits(folder: Path) -> Iterator[tuple[str, Edit]]:
    """The edits of the manifest, and a run left out everywhere, each with a seal that fits."""
    harms = {f"manifest/{what}" for what in HARM}
    for name, edit in (*manifest_edits(folder), *consistent_edits(folder)):
        if name not in harms and "/seal" not in name and not UNSEEN.fullmatch(f"sealed/{name}"):
            yield f"sealed/{name}", partial(_sealed, edit)


def edits(folder: Path) -> dict[str, Edit]:
    """Every edit of a folder that was made from :data:`SUITE`, by id."""
    return {
        name: edit
        for kind in (table_edits, manifest_edits, record_edits, consistent_edits, sealed_edits)
        for name, edit in kind(folder)
    }


def finished(root: Path, folder: Path) -> Path:
    """A finished results folder. Raises RuntimeError where the suite does not even run."""
    (folder / "small.toml").write_text(SUITE)
    ended = run(root, ["run", "small.toml", "--out", "whole"], folder, limit=300)
    if ended.code != 0:
        raise RuntimeError(f"the suite does not even run by itself: {ended.text[-2000:]}")
    return folder / "whole"


Command = Callable[..., Ended]


def accepted(command: Command, whole: Path, edited: Path, name: str) -> list[str]:
    """The first command that does not refuse an edited folder and name what is wrong with it.

    Empty where every command that reads it does.
    """
    asked: list[tuple[str | Path, ...]] = [
        ("compare", whole, edited),
        ("cite", edited),
        ("analyse", edited),
    ]
    if name.startswith("records/"):
        asked.append(("show", learner_first(whole)[0], "--in", edited))
    for words in asked:
        ended = command(*words)
        if not ended.refused:
            return [f"{words[0]} ends with {ended.code}, {ended.last_line!r}"]
        if not ended.names and words[0] != "show":
            return [f"{words[0]} does not say what is wrong: {ended.last_line!r}"]
    return []


def outcomes(root: Path, folder: Path, chosen: str) -> Iterator[tuple[str, list[str] | str]]:
    """Every edit, and which commands accept it."""
    whole = finished(root, folder)
    driver = Driver(root, folder)
    for name, edit in edits(whole).items():
        if not name.startswith(chosen):
            continue
        edited = folder / "edited"
        shutil.rmtree(edited, ignore_errors=True)
        shutil.copytree(whole, edited)
        try:
            edit(edited)
        except Exception as error:
            yield name, [f"cannot be made: {error!r}"]
            continue
        yield name, accepted(driver.run, whole, edited, name)
    driver.close()
