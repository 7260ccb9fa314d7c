"""What was asked for and where it was run: what differs between two results folders as wholes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from coartic.analysis.study import Study

_WORDS = {"title", "description", "provenance"}  # of a task; they change no result


class Differing(NamedTuple):
    """Something that two folders have differently; empty where one has nothing."""

    what: str
    first: str
    second: str


def surroundings(first: Study, second: Study) -> tuple[list[Differing], list[str]]:
    """What differs between two folders, and the names of what does not."""
    a, b = _facts(first), _facts(second)
    rows = [Differing(name, a[name], b[name]) for name in a if a[name] != b[name]]
    same = [name for name in a if a[name] and a[name] == b[name]]
    tasks = differing_tasks(first, second)
    for what, kinds, texts in (
        ("task", "tasks", lambda study: _task_texts(study, tasks)),
        ("code of", "methods", codes),
        ("library", "libraries", lambda study: study.results.manifest.environment.packages),
    ):
        ours, theirs = texts(first), texts(second)
        shared = [name for name in ours if name in theirs]
        differing = [name for name in shared if ours[name] != theirs[name]]
        rows += [Differing(f"{what} {name}", ours[name], theirs[name]) for name in differing]
        here, there = (
            ", ".join(name for name in side if name not in shared) for side in (ours, theirs)
        )
        if here or there:
            rows.append(Differing(f"{kinds} of one folder only", here, there))
        if shared:
            count = f"{len(shared) - len(differing)} of {len(shared)} shared {kinds}"
            same.append(f"code of {count}" if what == "code of" else count)
    return rows, same


def differing_tasks(first: Study, second: Study) -> dict[str, list[str]]:
    """Tasks of one name, and the keys in which they differ."""
    here, there = _tasks(first), _tasks(second)
    found = {}
    for name in here.keys() & there.keys():
        keys = sorted(here[name].keys() | there[name].keys())
        differing = [key for key in keys if here[name].get(key) != there[name].get(key)]
        if differing:
            found[name] = differing
    return found


def _tasks(study: Study) -> dict[str, dict[str, Any]]:
    """What movement and scoring depend on in each task."""
    return {
        name: {key: value for key, value in task.items() if key not in _WORDS}
        for name, task in study.results.manifest.specification.tasks.items()
    }


def codes(study: Study) -> dict[str, str]:
    """Code of each method, by its name."""
    methods = study.results.manifest.specification.methods
    return {name: method.code for name, method in methods.items()}


def _facts(study: Study) -> dict[str, str]:
    manifest, runs = study.results.manifest, study.runs
    specification, environment = manifest.specification, manifest.environment
    commit = environment.commit
    facts = {
        **_named(specification, "suite", "seed", "runs", "trials"),
        "time limit (s)": manifest.limits.time_s,
        "trial budget": manifest.limits.trials,
        "rows of runs.parquet": len(runs),
        "coartic": environment.coartic,
        "code of the model": environment.model_code,
        "commit": commit and commit.id[:12] + "+" * commit.dirty,
        "commits of the runs": _list(
            text[:12] + "+" * text.endswith("+") for text in runs.commit.dropna()
        ),
        "library versions of the runs": _list(runs["packages"].dropna()),
        **_named(environment, "python", "platform", "processor", "cores"),
    }
    return {name: "" if value is None else str(value) for name, value in facts.items()}


def _task_texts(study: Study, differing: dict[str, list[str]]) -> dict[str, str]:
    """By task the keys, with their values, in which it differs from the other of its name."""
    return {
        name: ", ".join(f"{key} {task.get(key)}" for key in differing.get(name, ()))
        for name, task in _tasks(study).items()
    }


def _named(of: object, *names: str) -> dict[str, Any]:
    return {name: getattr(of, name) for name in names}


def _list(values: Iterable[Any]) -> str:
    return ", ".join(sorted(set(map(str, values))))
