"""Define the sections of the page: their tables, figures and sentences, and their limits."""

from __future__ import annotations

import math
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from jinja2 import Environment, StrictUndefined

from coartic.analysis.figures.drawings import (
    draw_gaps_by_family,
    draw_learning_curves,
    draw_postures,
    draw_ranking,
    draw_runtimes,
    draw_saved,
    draw_shared_goal,
    draw_tasks,
)
from coartic.analysis.figures.plot import DrawsFigure
from coartic.analysis.methods import (
    EC1,
    EC4,
    GROUPS,
    MARK,
    RANDOM_SEARCH,
    joined_label,
    title_of,
)
from coartic.analysis.standings import ranked_tasks, reference, runs_on, solved_tasks, standings
from coartic.analysis.study import Study
from coartic.analysis.tables import (
    Table,
    is_setting,
    list_contexts,
    list_differences,
    list_failed,
    list_family_gaps,
    list_methods,
    list_not_ranked,
    list_ranking,
    list_runtimes,
    list_signatures,
    list_tasks,
)
from coartic.analysis.words import (
    NO_BREAK,
    capital,
    commonest,
    interval,
    listed,
    marked,
    number,
    p_value,
)
from coartic.errors import CoarticError
from coartic.estimates import FEWEST, LEVEL
from coartic.internal.text import error_line, one_line
from coartic.learner.learning import TRIALS

Made = TypeVar("Made")
RUNS = 20
"""Number of runs of each experiment of the paper."""
TOO_FEW = f" (too few runs to test: make {FEWEST})"
_WITHOUT_ARTICLE = ("CMA-ES", "random search", "hill climbing", "posture planning")
"""Algorithms whose names have no article in a sentence."""
NEEDS_RUNS = f"An interval or a test needs {FEWEST} runs; figures show fewer runs as points."


@dataclass(frozen=True)
class Section:
    """A section of the page, left out if it has no tables and no figures."""

    id: str
    title: str
    tables: tuple[Table, ...]
    """Tables of the section, functions of a study."""
    figures: tuple[DrawsFigure, ...] = ()
    """Functions that draw the figures, or return None if the folder has no runs for one. The page
    folds all figures except the first."""
    sentence: str = ""
    """Jinja template of the finding in words, or empty. It can use

    - ``every``: the first table;
    - ``rows``: the first table with the ``title`` of each method, and with its ``subject``
      (:func:`subject_of`), without settings and ablations;
    - ``others``: a list of the other tables, likewise;
    - further names that :func:`.finding` defines.
    """
    note: str = ""
    """Explanation of figures and tables."""
    single: bool = True
    """True for sections about individual tasks. A study of many random tasks leaves them out."""
    folded: bool = False
    """True if the page folds the tables."""


SECTIONS = (
    Section(
        "ranking",
        "Ranking",
        (list_ranking, list_not_ranked, list_differences),
        (draw_ranking,),
        sentence="""\
{% if varied %}
{% for best in leading(rows)[:1] %}
{{ best.subject }} comes nearest to the {{ reference }}: its gap is \
{{ interval(best, "gap", scale=100, unit=" %") }}.
{%- for next in others[1].to_dict("records")[:1] %}
 Next is {{ next.subject.removesuffix(",") }}, \
{{ interval(next, "difference", scale=100) }} percentage points behind\
{{ ": %s chance (%s)" % ("beyond" if next.p_holm < LEVEL else "not beyond", p_value(next.p_holm)) \
if next.p_holm >= 0 else few(next) }}.
{%- endfor %}
{%- for row in rows[rows.method.isin(papers)].to_dict("records") if row.method != best.method %}
 {{ row.subject | capital }} leaves {{ interval(row, "gap", scale=100, unit=" %") }}.
{%- endfor %}

{% endfor %}
{% else %}
{% for use in uses %}
{% set of_use = rows[rows.information == use] %}
{% for row in leading(of_use) %}
{% set place = (of_use.gap < row.gap).sum() + 1 %}
{% set tied = (of_use.gap == row.gap).sum() > 1 %}
{% if loop.first %}
{{ use | capital }}, {{ row.subject }} leaves \
{{ "a" if loop.last or tied else "the smallest" }} gap to the {{ reference }}\
{{ " of" if loop.last or tied else "," }} \
{% else %}
{{ row.subject }} leaves {% endif %}
{{ interval(row, "gap", scale=100, unit=" %") }}\
{{ " (place %d of %d)" % (place, of_use | length) if place > loop.index }}\
{{ "." if loop.last else "; " }}
{%- endfor %}

{% endfor %}
{% endif %}
{% for against, group in others[1].groupby("against", sort=False) if not varied %}
{{ subjects[against] }} against {{ rivals }} methods, percentage points by which its gap is \
smaller on the tasks that it solved: \
{% for row in leading(group) %}
{{ row.title }} {{ interval(row, "difference", scale=100) }}\
{{ " (%s)" % p_value(row.p_holm) if row.p_holm >= 0 else few(row) }}\
{{ "." if loop.last else "; " }}
{%- endfor %}

{% endfor %}""",
        note="Methods are grouped by their use of the reward: its value after each trial, its "
        "formula, or nothing. The gap is from the mean reward to the {reference}, as a "
        "share of it. Share of the gain: 0 % is the corrective process alone with its "
        "best hands (with the task's initial hands where there are over 4096 hand sequences), "
        "100 % the {reference}; tasks on which both are equal have none. Intervals describe "
        "new runs on the same tasks. Better on, worse on: number of tasks on which the mean reward "
        "differs significantly from that of the paper's learner (EC1 with one arm, EC4 with two), "
        "by two-tailed tests, corrected for the tasks of the method. Empty: the runs are too few, "
        f"or too alike, to tell. {NEEDS_RUNS} Ranked are the methods that solved all tasks in as "
        "many trials as were asked for; planners count with any number. What an own method uses is "
        "as its author declares; own methods are bold.",
        single=False,
    ),
    Section(
        "coarticulation",
        "Coarticulation",
        (list_contexts, list_signatures),
        (draw_shared_goal, draw_postures, draw_saved),
        sentence="""\
{% set of_best = rows[rows.method == first] if varied else rows[:0] %}
{% for row in (of_best if of_best | length else rows).head(1).to_dict("records") %}
{{ row.subject }} hits {{ row.place }} {{ {
"different postures": "in postures that depend on the next goal",
"no more than random search": "in postures that differ no more than those of random search",
"no significant difference": "in postures without significant difference",
"different, negligible": "in postures with a negligible difference",
"the same posture": "in the same posture", "too few runs": "in too few runs to test (make 5)",
}.get(row.verdict, "in postures that differ, without random search to compare them with") }}: \
posture difference {{ row.distance | number(2) }} (length units and rad; {{ row.runs }} runs)\
{{ "; random search: %s" % number(row.control, 2) if row.control >= 0 }}\
{{ " (%s)" % p_value(row.p_random_search) if row.p_random_search >= 0 }}.
{% endfor %}
Methods at shared goals by verdict: {{ every.verdict | commonest(none) | listed }}.""",
        note="Postures are compared in length units and rad. Ticks are compared with those of the "
        "corrective process with the same hands. A first movement that gets slower while the whole "
        "task gets faster is sacrificed for it. Idle hand nearer: share of the path to its next "
        "goal that a hand covers while idle. Random search is the learner without its memory: the "
        "best of as many trials is selected. What exceeds it is more than one selection, but much"
        " of that can be gain (docs/findings.md has rows at equal gain). A row has the runs with "
        "one hand sequence (of at least a tenth of a method's runs); random search has the same "
        "hands, and all its runs count. The choice of hands, in rows without a sequence, is "
        "compared with random search that tries every sequence. p is one-tailed, and uncorrected "
        "unless it says so; empty: no such random search.",
        folded=True,
    ),
    Section(
        "cost",
        "Cost",
        (list_runtimes,),
        (draw_runtimes, draw_learning_curves),
        sentence="""\
{% for row in leading(rows.dropna(subset="trials_to_half").sort_values("reached", \
ascending=False)) %}
{{ row.subject }} reaches {{ (100 * row.reached) | number(0) }} %\
{{ " of the reward targets from the corrective process alone to the " ~ \
reference if loop.first }}, {{ "never half" if \
row.trials_to_half == infinite else "half of them after %s trials" % \
interval(row, "trials_to_half", 0) if row.trials_to_half else "half of them without a trial" }}\
{{ "." if loop.last else "; " }}
{%- endfor %}""",
        note="The empirical distribution (ECDF) of the costs of reaching reward targets. The "
        "figure shows methods that learn, random search and the best planner. The number of "
        "forward-kinematics evaluations is a cost that is the same on every machine. ∞: not "
        "reached within the budget of trials. Gain: improvement over the corrective process alone.",
        folded=True,
    ),
    Section(
        "random-tasks",
        "Random tasks",
        (list_family_gaps,),
        (draw_gaps_by_family,),
        sentence="""\
{% for row in leading(rows.dropna(subset="gap")) %}
{{ ("Mean gap to the %s over families with two arms: " % reference) if loop.first }}\
{{ row.title }} {{ interval(row, "gap", scale=100, unit=" %") }}{{ "." if loop.last else "; " }}
{%- endfor %}""",
        note="Intervals describe other tasks of the families.",
        single=False,
    ),
    Section(
        "tasks",
        "Tasks",
        (list_tasks,),
        (draw_tasks,),
        note="Initial, best hands: the corrective process alone, with the task's initial hands and "
        "with the best of all hand sequences. Best known: the optimum where the proven bound "
        "equals it. Proven bound: a reward that no solution can exceed.",
    ),
    Section(
        "methods",
        "All methods and runs",
        (list_methods,),
        note="Every method works on the same robot. Its movements are scored by one function, "
        "which no method can reach. Times are seconds of solving.",
        folded=True,
    ),
    Section(
        "failed",
        "Failed runs",
        (list_failed,),
        note="A failed run bars its method from means over tasks.",
        single=False,
        folded=True,
    ),
)


def shown(text: str) -> str:
    """Return text as one printable line, with no-break spaces before per cent signs and daggers."""
    return one_line(text).replace(" %", f"{NO_BREAK}%").replace(" †", f"{NO_BREAK}†")


def visible_sections(study: Study) -> list[Section]:
    """Return the sections of the page.

    If the study has no individual tasks (only many random ones), sections about them are left out.
    """
    return [section for section in SECTIONS if study.individual_tasks or not section.single]


def attempt(
    failures: dict[str, str], name: str, make: Callable[..., Made], *args: Any
) -> Made | None:
    """Return ``make(*args)``, a part of a report, or None if it raises an exception.

    The error, with file and line, is then added to ``failures`` by the ``name`` of the part, unless
    the part has an error already. A CoarticError is raised again.
    """
    try:
        return make(*args)
    except CoarticError:
        raise
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(frame.filename).name}, line {frame.lineno}"
        failures.setdefault(name, f"{error_line(error)} ({where})")
        return None


def finding(study: Study, section: Section) -> list[str]:
    """Return the finding of a section in words, as a list of lines.

    The template ``sentence`` is filled in from the section's tables. The list is empty if the
    section has no sentence, or its first table has no rows.
    """
    if not section.sentence or not len(frame := section.tables[0](study)):
        return []
    methods = study.methods
    built_in = methods.index[methods.built_in.astype(bool)]
    subjects = methods.apply(subject_of, axis=1)

    def few(row: Mapping[str, Any]) -> str:
        """Return the words that a stochastic method has too few runs to test, or none."""
        labels = {str(row["method"]), str(row["against"])}
        drawn = [
            runs_on(study, label, solved_tasks(study, str(row["against"]))) for label in labels
        ]
        counts = [
            len(of_task)
            for runs in drawn
            for _, of_task in runs[runs.label.map(methods.stochastic).astype(bool)].groupby("task")
        ]
        return TOO_FEW if counts and min(counts) < FEWEST else ""

    def named(table: Table) -> pd.DataFrame:
        all_rows = table(study)
        rows: pd.DataFrame = all_rows[~is_setting(study, all_rows)]
        titles, subject = rows.method.map(methods.title), rows.method.map(subjects)
        return rows.assign(title=titles, subject=subject, own=~rows.method.isin(built_in))

    rows, *others = map(named, section.tables)
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "commonest": commonest, "listed": listed}
    environment.filters["capital"] = capital
    environment.globals |= {
        "interval": interval, "number": number, "p_value": p_value, "leading": leading, "few": few,
        "infinite": math.inf,
        "uses": GROUPS, "first": next(iter(standings(study).index), ""),
        "subjects": subjects,
        "reference": reference(study, ranked_tasks(study)),
        "LEVEL": LEVEL, "varied": study.varied[0] and not study.against,
        "papers": methods.index[methods.is_learner & (methods.setting == "")],
        "rivals": "other" if study.against else "built-in",
    }  # fmt: skip
    text = environment.from_string(section.sentence).render(rows=rows, every=frame, others=others)
    return [capital(shown(line.strip())) for line in text.split("\n") if line.strip()]


def subject_of(method: Mapping[str, Any]) -> str:
    """Return the name of a method as the subject of a sentence.

    A method from a file has a free title, which gets quotation marks. Other names get an article,
    except names of activities, such as random search, and CMA-ES. A name that contains a comma,
    such as ``CMA-ES, hands goal by goal``, ends in one.

    Parameters
    ----------
    method : mapping
        Row of :attr:`.Study.methods`.
    """
    title = str(method["title"])
    if not method["built_in"]:
        plain_title = title.removesuffix(MARK)
        return f"“{plain_title}”{title[len(plain_title) :]}"
    article = "" if method["algorithm"] in _WITHOUT_ARTICLE else "the "
    comma = "," if "," in title.partition("(")[0] else ""
    return f"{article}{title}{comma}"


def leading(rows: pd.DataFrame) -> list[dict[Any, Any]]:
    """Return the rows of a table that a finding mentions, as dicts.

    These are the rows of the methods in the first two rows, of the paper's learner, of random
    search, and of methods from files.
    """
    always = [joined_label(EC1, EC4), EC1, EC4, RANDOM_SEARCH]
    is_shown = rows.method.isin([*rows.method[:2], *always]) | rows.own
    return rows[is_shown].to_dict("records")


@lru_cache(maxsize=4)
def limits(study: Study) -> dict[str, Any]:
    """Return facts that limit the conclusions from a study's runs, by name.

    A value is 0, False or empty if the limit does not apply.

    - ``runs``, ``failed``: numbers of runs and of failed runs; ``reasons``: the most frequent ones;
    - ``reconstructed``: titles of the individual tasks that are reconstructed;
    - ``unproven``, ``unknown``, ``own``: titles of the individual tasks whose best reward is not
      proven, is unknown, or is known only from this folder;
    - ``trials``: numbers of trials of the learner that differ from the paper's;
    - ``few``: smallest number of runs of the learner on a task, if it is below the paper's;
    - ``seed``, ``processor``, ``cores``;
    - ``side_by_side``: True if runs were made at the same time;
    - ``dirty``: True if the code had changes that are not committed;
    - ``late``: all :attr:`.Study.marks`;
    - ``imports``: packages that methods import, by title of the method.
    """
    runs, made_with = study.runs, study.made_with
    failed = runs[runs.status != "ok"]
    algorithm, papers = study.methods.algorithm, study.methods.is_learner
    trials = {int(n) for n in runs[runs.label.map(algorithm) == "learner"].trials.dropna()}
    fewest = min(
        (len(cell) for (_, label), cell in study.cells.items() if papers[label]), default=RUNS
    )
    tasks, optima = list(study.individual_tasks.values()), defaultdict[str, list[str]](list)
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
        "late": [*chain.from_iterable(study.marks.values())],
        "cores": made_with["cores"],
        "imports": {
            title_of(study.declared[name]): listed(used) for name, used in study.imports.items()
        },
    }


def notes_of(study: Study, columns: Iterable[str]) -> list[str]:
    """Return the sentences that follow a table with these columns (:func:`limits`).

    - With ``gap`` or ``optimum``: which best known rewards are not proven.
    - With ``gap``: which best known rewards are known only from this folder.
    """
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
