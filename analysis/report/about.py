"""Findings of a folder, and the limits of conclusions from its runs."""

from __future__ import annotations

import math
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from jinja2 import Environment, StrictUndefined

from coartic.analysis.method_frame import GROUPS, joined_label
from coartic.analysis.methods import EC1, EC4, RANDOM_SEARCH, title_of
from coartic.analysis.sections import SECTIONS, Section
from coartic.analysis.standings import ranked_tasks, reference, standings
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.table import is_setting
from coartic.analysis.words import (
    NO_BREAK,
    commonest,
    interval,
    listed,
    marked,
    number,
    p_value,
)
from coartic.errors import CoarticError
from coartic.estimates import LEVEL
from coartic.internal.text import error_line, one_line
from coartic.learner.learning import TRIALS

Made = TypeVar("Made")
RUNS = 20
"""Number of runs of every experiment of the paper."""


def shown(text: str) -> str:
    """Return text as one printable line with no-break spaces for spaces before per cent signs and
    daggers."""
    return one_line(text).replace(" %", f"{NO_BREAK}%").replace(" †", f"{NO_BREAK}†")


def visible_sections(study: Study) -> list[Section]:
    """Return the sections of the page, without sections about single tasks if the tasks are many
    random ones (:func:`.one_by_one` is empty)."""
    return [section for section in SECTIONS if one_by_one(study) or not section.single]


def attempt(
    failures: dict[str, str], name: str, make: Callable[..., Made], *args: Any
) -> Made | None:
    """Return ``make(*args)``, a part of a report, or None if it raises an exception.

    The error, with file and line, is then added to ``failures`` by the ``name`` of the part, unless
    there is one already. A CoarticError passes through.
    """
    try:
        return make(*args)
    except CoarticError:
        raise
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        failures.setdefault(name, f"{error_line(error)} ({where})")
        return None


def finding(study: Study, section: Section) -> list[str]:
    """Return the finding of a section in words, a list of lines: its template ``sentence``, filled
    in from its tables; an empty list if it has no sentence, or its first table no rows."""
    if not section.sentence or not len(frame := section.tables[0](study)):
        return []
    rows, *others = (
        each.assign(title=each.method.map(each.attrs["titles"]))[~is_setting(each)]
        for each in (table(study) for table in section.tables)
    )
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "commonest": commonest, "listed": listed}
    environment.globals |= {
        "interval": interval, "number": number, "p_value": p_value, "leading": leading,
        "infinite": math.inf,
        "uses": GROUPS, "first": next(iter(standings(study).index), ""),
        "titles": frame.attrs["titles"],
        "reference": reference(study, ranked_tasks(study)),
        "LEVEL": LEVEL, "varied": study.varied[0] and not study.against,
        "papers": study.methods.index[study.methods.is_learner & (study.methods.setting == "")],
        "rivals": "other" if study.against else "built-in",
    }  # fmt: skip
    text = environment.from_string(section.sentence).render(rows=rows, every=frame, others=others)
    return [shown(line.strip()) for line in text.split("\n") if line.strip()]


def leading(rows: pd.DataFrame) -> list[dict[Any, Any]]:
    """Return rows of a table, each as a dict: the rows of the first two rows' methods, of the
    paper's learner, of random search and of methods from files."""
    always = [joined_label(EC1, EC4), EC1, EC4, RANDOM_SEARCH, *rows.attrs.get("own", [])]
    return rows[rows.method.isin([*rows.method[:2], *always])].to_dict("records")


@cached
def limits(study: Study) -> dict[str, Any]:
    """Return facts that limit conclusions from a study's runs, by name: numbers of ``runs`` and of
    ``failed`` runs, and the commonest ``reasons``; titles of the tasks of :func:`.one_by_one` that
    are ``reconstructed``, and whose best reward is ``unproven``, ``unknown`` or known from this
    folder alone (``own``); numbers of ``trials`` of the learner other than the paper's; ``few``,
    the fewest runs of the learner on a task, if fewer than the paper's; ``seed``; ``processor`` and
    ``cores``; True for runs ``side_by_side`` and code that is ``dirty``; ``earlier``, methods with
    runs by coartic 4.0.0; ``late``, all :attr:`.Study.marks`; ``imports`` by method. 0, False or
    empty where a limit does not apply."""
    runs, made_with = study.runs, study.made_with
    failed = runs[runs.status != "ok"]
    algorithm, papers = study.methods.algorithm, study.methods.is_learner
    trials = {int(n) for n in runs[runs.label.map(algorithm) == "learner"].trials.dropna()}
    fewest = min((len(of) for (_, label), of in study.cells.items() if papers[label]), default=RUNS)
    tasks, optima = list(one_by_one(study).values()), defaultdict[str, list[str]](list)
    for task in tasks:
        best = study.optima.get(task.name)
        unproven = "" if best is None or best.proven else "unproven"
        kind = "unknown" if best is None else "own" if best.only_here else unproven
        optima[kind].append(marked(task))
    reasons = failed.reason.fillna("")
    others = len(failed) - sum(reasons.value_counts()[:3])
    return {
        "runs": len(runs),
        "failed": len(failed),
        "reasons": commonest(reasons) + [f"{others} for other reasons"] * bool(others),
        "reconstructed": [task.label for task in tasks if task.reconstructed],
        "trials": sorted(trials - {TRIALS}),
        "few": fewest if fewest < RUNS else 0,
        "seed": study.plan[0].seed,
        **{kind: optima[kind] for kind in ("unproven", "own", "unknown")},
        "side_by_side": bool(runs.together.max() > 1),
        "dirty": bool(runs.commit.dropna().astype(str).str.endswith("+").any()),
        "processor": made_with["processor"],
        "earlier": sorted(
            {
                f"{title_of(m.name)} {m.version}"
                for m in study.declared.values()
                if m.code != m.version
            }
        ),
        "late": [*chain.from_iterable(study.marks.values())],
        "cores": made_with["cores"],
        "imports": {
            title_of(study.declared[name]): listed(used) for name, used in study.imports.items()
        },
    }


def notes_of(study: Study, columns: Iterable[str]) -> list[str]:
    """Return sentences for below a table with these columns: which best known rewards are not
    proven (with column ``gap`` or ``optimum``), and which are known from this folder alone (with
    ``gap``; :func:`limits`)."""
    unproven, own, columns = limits(study)["unproven"], limits(study)["own"], set(columns)
    notes = []
    if unproven and columns & {"gap", "optimum"}:
        notes.append(
            f"The best known rewards of {listed(unproven)} are not proven to be the optimum."
        )
    if own and "gap" in columns:
        notes.append(
            f"Of {listed(own)} the best of this folder is all that is known: gaps are to it."
        )
    return notes
