"""Sections of the page in their order, and tables and figures of the report by id."""

from __future__ import annotations

from dataclasses import dataclass

from coartic.analysis.figures.plot import DrawsFigure
from coartic.analysis.sections import (
    coarticulation,
    costs,
    learning,
    methods,
    random_tasks,
    ranking,
    tasks,
)
from coartic.analysis.table import Table
from coartic.analysis.words import id_of


@dataclass(frozen=True)
class Section:
    """A section of the page, left out if the folder has neither its tables nor its figures."""

    id: str
    title: str
    tables: tuple[Table, ...]
    """Tables of the section, functions of a study."""
    figures: tuple[DrawsFigure, ...] = ()
    """Functions that draw the figures, or return None if the folder has no runs for one. The page
    folds all figures except the first."""
    sentence: str = ""
    """Jinja template of the finding in words, or empty. Its names are ``every``, the first table;
    ``rows``, this table with the ``title`` of each method, without settings and ablations;
    ``others``, the other tables with titles, without settings and ablations (further names:
    :func:`.finding`)."""
    note: str = ""
    """Explanation of figures and tables."""
    single: bool = True
    """True for sections about single tasks, left out for many random tasks."""
    folded: bool = False
    """True if the page folds the tables."""


SECTIONS = (
    Section(
        "ranking",
        "Ranking",
        (ranking.list_ranking, ranking.list_not_ranked, ranking.list_differences),
        (ranking.draw_ranking,),
        sentence="""\
{% if varied %}
{% for best in leading(rows)[:1] %}
{{ best.title }} comes nearest to the {{ reference }}: its gap is \
{{ interval(best, "gap", scale=100, unit=" %") }}.
{%- for next in others[1].to_dict("records")[:1] %}
 Next is {{ next.title }}, {{ interval(next, "difference", scale=100) }} percentage points behind\
{{ ": %s chance (%s)" % ("beyond" if next.p_holm < LEVEL else "not beyond", p_value(next.p_holm)) \
if next.p_holm >= 0 else ", too few runs to test" }}.
{%- endfor %}
{%- for row in rows[rows.method.isin(papers)].to_dict("records") if row.method != best.method %}
 {{ row.title }} leaves {{ interval(row, "gap", scale=100, unit=" %") }}.
{%- endfor %}

{% endfor %}
{% else %}
{% for use in uses %}
{% set of_use = rows[rows.information == use] %}
{% for row in leading(of_use) %}
{% set place = (of_use.gap < row.gap).sum() + 1 %}
{% set tied = (of_use.gap == row.gap).sum() > 1 %}
{% if loop.first %}
{{ use | capitalize }}, {{ row.title }} leaves \
{{ "a" if loop.last or tied else "the smallest" }} gap to the {{ reference }}\
{{ " of" if loop.last or tied else "," }} \
{% else %}
{{ row.title }} leaves {% endif %}
{{ interval(row, "gap", scale=100, unit=" %") }}\
{{ " (place %d of %d)" % (place, of_use | length) if place > loop.index }}\
{{ "." if loop.last else "; " }}
{%- endfor %}

{% endfor %}
{% endif %}
{% for against, group in others[1].groupby("against", sort=False) if not varied %}
{{ titles[against] }} against {{ rivals }} methods, percentage points by which its gap is \
smaller on the tasks that it solved: \
{% for row in leading(group) %}
{{ row.title }} {{ interval(row, "difference", scale=100) }}\
{{ " (%s)" % p_value(row.p_holm) if row.p_holm >= 0 }}{{ "." if loop.last else "; " }}
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
        "or too alike, to tell. Ranked are the methods that solved all tasks in as many trials as "
        "were asked for; planners count with any number. What an own method uses is as its "
        "author declares; own methods are bold.",
        single=False,
    ),
    Section(
        "coarticulation",
        "Coarticulation",
        (coarticulation.list_contexts, coarticulation.list_signatures),
        (coarticulation.draw_postures, coarticulation.draw_saved),
        sentence="""\
{% set of_best = rows[rows.method == first] if varied else rows[:0] %}
{% for row in (of_best if of_best | length else rows).head(1).to_dict("records") %}
{{ row.title }} hits {{ row.place }} {{ {
"different postures": "in postures that depend on the next goal",
"no more than random search": "in postures that differ no more than those of random search",
"no significant difference": "in postures without significant difference",
"different, negligible": "in postures with a negligible difference",
"the same posture": "in the same posture", "too few runs": "in too few runs to tell",
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
        (costs.list_runtimes, learning.list_learning),
        (costs.draw_runtimes, learning.draw_learning_curves),
        sentence="""\
{% for row in leading(rows.dropna(subset="trials_to_half").sort_values("reached", \
ascending=False)) %}
{{ row.title }} reaches {{ (100 * row.reached) | number(0) }} %\
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
        (random_tasks.list_family_gaps,),
        (random_tasks.draw_gaps_by_family,),
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
        (tasks.list_tasks,),
        (tasks.draw_tasks,),
        note="Initial, best hands: the corrective process alone, with the task's initial hands and "
        "with the best of all hand sequences. Best known: the optimum where the proven bound "
        "equals it. Proven bound: a reward that no solution can exceed.",
    ),
    Section(
        "methods",
        "All methods and runs",
        (methods.list_methods,),
        note="Every method works on the same robot. Its movements are scored by one function, "
        "which no method can reach. Times are seconds of solving.",
        folded=True,
    ),
    Section(
        "failed",
        "Failed runs",
        (methods.list_failed,),
        note="A failed run bars its method from means over tasks.",
        single=False,
        folded=True,
    ),
)
TABLES = {table.id: table for section in SECTIONS for table in section.tables}
TABLES["saved"] = coarticulation.list_saved
"""Tables by id; ``saved`` is a CSV file without a section."""
FIGURES = {id_of(draw): draw for section in SECTIONS for draw in section.figures}
"""Figures by id."""
