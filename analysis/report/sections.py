"""Define the sections of the page: their tables, their figures and their findings in words.

The module also collects facts that limit the conclusions from a study (:func:`limits`).
"""

from __future__ import annotations

import math
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from jinja2 import Environment, StrictUndefined, Template

from coartic.analysis.figures.drawings import (
    draw_contrasts,
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
    KNOWN_METHODS,
    RANDOM_SEARCH,
    SEARCHES,
    subject_of,
    title_of,
)
from coartic.analysis.report.settings import TOO_FEW, answer_on_parameters
from coartic.analysis.standings import (
    has_few_runs,
    ranked_tasks,
    reference,
    solved_tasks,
    standings,
)
from coartic.analysis.study import Study, ending_of, shared_cells, when_of
from coartic.analysis.tables import (
    SOLUTIONS_ONLY,
    Table,
    answer_lines,
    is_setting,
    list_contexts,
    list_contrasts,
    list_differences,
    list_failed,
    list_family_gaps,
    list_methods,
    list_not_ranked,
    list_parameters,
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
from coartic.estimates import MIN_VALUES
from coartic.internal.text import error_line, one_line, pluralize
from coartic.internal.user_files import is_users
from coartic.method import TRIALS
from coartic.runs.plan import world_title
from coartic.runs.rows import LEARNER as ROW_OF_LEARNER

Made = TypeVar("Made")
RUNS = 20
"""Number of runs of each experiment of the paper."""
NEEDS_RUNS = f"An interval or a test needs {MIN_VALUES} runs; figures show fewer runs as points."


IN_NOISE = (
    "In a world with motor noise the reward of a run is minus the mean ticks of 100 fresh "
    "executions of what its method recommends. The same draws of the noise judge all methods and "
    "the corrective process. References are means of 1000 further executions: of a solution that "
    "comes with coartic, or of the best of this folder. A gap can be negative by "
    "chance. Signatures and pictures are of an "
    "execution without noise. Running times are not shown, because the reward of a single trial is "
    "partly luck."
)
"""Note on the page on what is different in a world with motor noise."""


@dataclass(frozen=True)
class Section:
    """A section of the page: its tables, its figures and its finding in words.

    The page leaves a section out if it has no error, no table with rows, and no figure.
    """

    id: str
    title: str
    tables: tuple[Table, ...]
    """Tables of the section."""
    figures: tuple[DrawsFigure, ...] = ()
    """Functions that draw the figures. A function returns None if the study has no runs for its
    figure. The page folds all figures except the first."""
    sentence: str = ""
    """Jinja template of the finding in words; empty if the section has no finding. The template can
    use

    - ``rows``: the first table of the section, without settings and ablations, with further
      columns: ``title`` and ``information`` of each method, its name as the ``subject`` of a
      sentence (:func:`.subject_of`), and ``own`` (True for a method from a file);
    - ``others``: a list of the other tables of the section except :func:`.list_parameters`, with
      the same further columns;
    - further names that :func:`.finding` defines.
    """
    note: str = ""
    """Text that explains the figures and tables of the section. ``{reference}`` stands for the name
    of the best known rewards (:func:`.reference`)."""
    single: bool = True
    """True for a section about individual tasks. The section is left out for a study without
    individual tasks (:attr:`.Study.individual_tasks`)."""
    unfolded: tuple[Table, ...] = ()
    """Tables whose numbers no figure shows. The page folds a table of ``unfolded`` only if it has
    more than ten rows, and folds all other tables. There are three exceptions:

    - If the section has figures, but none can be drawn, no table is folded.
    - The ranking is never folded.
    - The table of methods that are not ranked is always folded.
    """


SECTIONS = (
    Section(
        "ranking",
        "Ranking",
        (list_ranking, list_not_ranked, list_differences, list_parameters),
        (draw_ranking,),
        sentence="""\
{% for use in uses %}
{% set of_use = rows[rows.information == use] %}
{% for row in leading(of_use) %}
{% set place = (of_use.gap < row.gap).sum() + 1 %}
{% set gap = interval(row, "gap", scale=100, unit=" %") %}
{% if of_use | length == 1 %}
The only ranked method {{ use }} is {{ row.title }}; its gap to the {{ reference }} is {{ gap }}\
{% elif loop.first %}
Among ranked methods {{ use }}, the smallest gap to the {{ reference }} is {{ gap }} \
({{ row.title }})\
{% else %}
{{ ". Others: " if loop.index == 2 else "; " }}{{ row.title }} {{ gap }}\
{{ ", place %d of %d" % (place, of_use | length) if place > loop.index }}\
{% endif %}
{{ "." if loop.last }}
{%- endfor %}

{% endfor %}
{% for against, group in others[1].groupby("against", sort=False) %}
{{ "On the tasks that it solved, " if group.tasks.max() < tasks }}{{ subjects[against] }} is \
{% for row in leading(group) %}
{{ beside(row, loop.first) }}{{ " (%s)" % p_value(row.p_holm) if row.p_holm >= 0 else few(row) }}\
{{ "." if loop.last else ", " }}
{%- endfor %}
{%- set tests = (group.p_holm >= 0).sum() %}
{% if tests > 1 %}
 p is corrected over {{ tests }} comparisons, intervals are not.
{%- endif %}

{% endfor %}""",
        note="The gap is the ticks of the mean reward beyond the {reference}, in per cent of it. "
        "The share of the gain is 0 % for the corrective process alone with its best hands (with "
        "the task's initial hands if there are more than 4096 hand sequences), and 100 % for the "
        "{reference}; tasks on which less than 1 % can be gained have none. Intervals "
        "describe new runs on the same tasks. "
        "A place is a 95 % interval over resampled random tasks, or over resampled runs if there "
        "are no random tasks; neighbours are separated if the interval of their difference leaves "
        "out 0. "
        "Better and worse: the number of tasks on which the mean reward differs significantly from "
        "that of the paper's learner (EC1 with one arm, EC4 with two), by two-tailed tests, "
        "corrected over the tasks of the method; empty if the runs are too few, or too alike, for "
        f"a test. {NEEDS_RUNS} A method is ranked if it solved all tasks in as many trials as were "
        "asked for, or in any number if one method was asked for several; planners have no "
        "trials. The author of an own method declares how it uses the reward; own methods are "
        "bold.",
        unfolded=(list_differences,),
        single=False,
    ),
    Section(
        "coarticulation",
        "Coarticulation",
        (list_contexts, list_signatures),
        (draw_shared_goal, draw_saved, draw_postures),
        sentence="""\
{% set of_best = rows[rows.method == first] if varies else rows[:0] %}
{% for row in (of_best if of_best | length else rows).head(1).to_dict("records") %}
{{ row.subject }} hits {{ row.place }} {{ {
"different postures": "in postures that depend on the next goal",
"no more than random search": "in postures that differ, but no more than those of random search",
"no significant difference": "in postures that do not differ significantly",
"different, negligible": "in postures that hardly differ",
"the same posture": "in the same posture",
"too few runs": "in postures that cannot be compared, because the runs are too few",
}.get(row.verdict, "in postures that differ; no random search was run to compare them with") }}. \
The posture difference is {{ row.distance | number(2) }} (length units and rad; \
{{ row.runs }} runs){{ "; that of random search is %s" % number(row.control, 2) \
if row.control >= 0 }}{{ " (%s)" % p_value(row.p_random_search) if row.p_random_search >= 0 }}.
{%- if row.lean == row.lean %}
 The lean is {{ interval(row, "lean", 2) }}: the share of the way to the next posture that is \
already made there.
{%- if row.lean_base == row.lean_base and row.lean_joints == row.lean_joints %}
 The lean of the base alone is {{ interval(row, "lean_base", 2) }}, and that of the joints of the \
arm alone {{ interval(row, "lean_joints", 2) }}.
{%- endif %}
{%- endif %}
{% endfor %}""",
        note="Postures are compared in length units and rad; the leans of base and joints, each "
        "along its own way to the next posture, do not add up to that of both together. "
        "Ticks are compared with those of the "
        "corrective process with the same hands. If the first movement gets slower and the whole "
        "task faster, the first movement is sacrificed. Idle hand nearer: the share of the path to "
        "its next goal that a hand covers while it is idle. Random search is the learner without "
        "its memory: it selects the best of as many trials. What exceeds random search is more "
        "than one selection explains, but much of it can be gain (docs/findings.md compares at "
        "equal gain). A row has the runs with one hand sequence, if at least a tenth of a method's "
        "runs have it; random search has the same hands, and all its runs count. Rows without a "
        "sequence have the choice of hands, next to random search that tries every sequence. p is "
        "one-tailed, and not corrected unless the heading says so; it is empty if there is no such "
        "random search.",
    ),
    Section(
        "cost",
        "Cost",
        (list_runtimes,),
        (draw_runtimes, draw_learning_curves),
        sentence="""\
{% set by_trial = rows[rows.information == uses[0]].sort_values(["trials_to_half", "reached"], \
ascending=[true, false]) %}
{% for row in leading(by_trial) %}
{% if row.trials_to_half < infinite %}
{{ row.subject }} needs {{ interval(row, "trials_to_half", 0) }}\
{{ " trials for half of the gain" if loop.first }}\
{% else %}
{{ row.subject }} does not {{ "get there" if loop.index > 1 else "reach half of the gain" }} in \
{{ row.trials | number }}{{ " trials" if loop.first }}\
{% endif %}
{{ "." if loop.last else "; " }}
{%- endfor %}""",
        note="The gain is the improvement over the corrective process alone. Half of it is reached "
        "when half of the reward targets are, over runs and tasks; ∞ means that they are not "
        "reached. The figure is the empirical distribution (ECDF) of the costs of reaching the "
        "targets, for methods that learn, random search and the best planner. The number of "
        "forward-kinematics evaluations is the same on every machine.",
    ),
    Section(
        "random-tasks",
        "Random tasks",
        (list_family_gaps,),
        (draw_gaps_by_family,),
        sentence="""\
{% for row in leading(rows.dropna(subset="gap")) %}
{{ ("The mean gaps to the %s over families with two arms are: " % reference) if loop.first }}\
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
        note="Initial and best hands are the rewards of the corrective process alone, with the "
        "task's initial hands and with the best of all hand sequences. No solution can exceed the "
        "proven bound; if the best known reward equals it, it is the optimum.",
        unfolded=(list_tasks,),
    ),
    Section(
        "methods",
        "All methods and runs",
        (list_methods,),
        note="Every method works on the same robot, and one function scores the movements of all. "
        "Times are seconds of solving.",
    ),
    Section(
        "failed",
        "Failed runs",
        (list_failed,),
        note="A method with a failed run has no mean over tasks.",
        single=False,
        unfolded=(list_failed,),
    ),
)


QUESTIONS = Section(
    "questions",
    "Questions",
    (list_contrasts,),
    (draw_contrasts,),
    note="A cell is a sentence in one family and one world. A field has the number of tasks on the "
    "expected side of the bound, and the number of tasks; a star refers to a note in the table. "
    "The unit is the task, with the mean over "
    "its runs. Shown and opposite shown: p < 0.05 in an exact two-sided sign test over tasks, "
    "corrected by Holm over the cells of a sentence, and more than half of all tasks on this side. "
    "Of m sentences without an effect, 1 − 0.95^m show something by chance. The folder notes when "
    "a sentence was first asked: a reminder for honest people, no proof against others.",
    single=False,
)
"""The first section of the page, about all worlds of a folder, if its suite asks questions."""


def section_of_world(study: Study) -> Section:
    """Return the section of the page for a world that is not the first world of a folder.

    ``study`` is the study of this world.
    """
    note = (
        "Methods practised and were judged in this world, and are only compared with each other. "
        "Gaps are to the {reference} in this world, and the share of the gain is 0 % for the "
        "corrective process with its best hands in this world. "
    )
    return replace(
        SECTIONS[0],
        id=f"world{ending_of(study)}",
        title=capital(world_title(study.world)),
        tables=(*SECTIONS[0].tables, list_methods, list_failed),
        figures=(draw_ranking, draw_learning_curves),
        note=f"{note}{IN_NOISE} {NEEDS_RUNS}" if study.is_noisy else note,
    )


def shown(text: str) -> str:
    """Return text as one printable line, with no-break spaces before per cent signs and daggers."""
    return one_line(text).replace(" %", f"{NO_BREAK}%").replace(" †", f"{NO_BREAK}†")


def visible_sections(study: Study) -> list[Section]:
    """Return the sections of the page for a study.

    Sections about individual tasks (:attr:`Section.single`) are left out if the study has no
    individual tasks, and sections about solutions (:data:`.SOLUTIONS_ONLY`) after some trials.
    """
    return [
        section
        for section in SECTIONS
        if (study.individual_tasks or not section.single)
        and not (study.after and SOLUTIONS_ONLY & {table.id for table in section.tables})
    ]


def words_after(study: Study) -> list[str]:
    """Return sentences on a study after some trials: what its numbers are, and what it leaves out.

    The list is empty for a study of whole runs.
    """
    if study.after is None:
        return []
    return [
        f"Rewards are those {when_of(study).removeprefix(', ')} of each run, and those of methods "
        "without trials as they are. A run that is asked for so few trials can differ, because "
        "some methods plan with their number.",
        "Solutions are those of whole runs: section Coarticulation, the films and table saved are "
        "left out, and so are hands and costs of runs that made more trials.",
        *left_out(study),
    ]


def left_out(study: Study) -> list[str]:
    """Return sentences on the worlds, methods and questions that a study after trials lacks."""
    if (whole := study.whole) is None:
        return []
    sentences, here = [], {*study.worlds}
    if noisy := [world_title(world) for world in whole.worlds if world not in here]:
        sentences.append(
            f"{capital(listed(noisy))} {'are' if noisy[1:] else 'is'} left out: with motor noise "
            "the best trial so far says nothing of the answer."
        )
    quiet = [of for of in whole.worlds.values() if not of.is_noisy]
    missing = [of.runs[~of.runs.run_id.isin(study.stored.run_id)].ranked_as for of in quiet]
    titles = [of.methods.title[[*rows.unique()]] for of, rows in zip(quiet, missing, strict=True)]
    if others := [*dict.fromkeys(chain.from_iterable(titles))]:
        are = "are" if others[1:] else "is"
        sentences.append(f"{listed(others)} {are} left out: the answer is not the best trial.")
    answered = {record.contrast.name for record in study.asked}
    questions = [record.contrast for record in whole.asked]
    if open_ones := [asked.says.rstrip(".") for asked in questions if asked.name not in answered]:
        when = when_of(study).removeprefix(", ")
        sentences.append(f"Not answered {when}: {'; '.join(open_ones)}.")
    return sentences


def attempt(
    failures: dict[str, str], name: str, make: Callable[..., Made], *args: Any
) -> Made | None:
    """Call ``make(*args)``, and return its result, or None if it raises an exception.

    The result is a part of a report, and ``name`` is the name of this part. The exception, with its
    file and line, is stored in ``failures`` with the key ``name``, unless there is an entry with
    this key already. If a file of the user is involved, the line is the last one in such a file. A
    CoarticError is not caught.
    """
    try:
        return make(*args)
    except CoarticError:
        raise
    except Exception as error:
        places = [
            (str(frame.f_globals.get("__name__")), Path(frame.f_code.co_filename), line)
            for frame, line in traceback.walk_tb(error.__traceback__)
        ]
        users = [place for place in places if is_users(*place[:2])]
        _, path, line = (users or places)[-1]
        where = f"{path.name}, line {line}"
        failures.setdefault(name, f"{error_line(error)} ({where})")
        return None


def finding(study: Study, section: Section) -> list[str]:
    """Return the finding of a section in words, as a list of lines.

    The lines are made from the tables of the section by its template :attr:`Section.sentence`. For
    the ranking of a study that varies parameters (:func:`varies_parameters`), the lines are those
    of :func:`.answer_on_parameters` instead. The list is empty if the section has no template, or
    if its first table has no rows. If the first table is the ranking and has no rows, the only line
    says that no method is ranked.
    """
    if section is QUESTIONS:
        return [shown(line) for line in answer_lines(study.contrasts)]
    is_ranking = section.tables[0] is list_ranking
    if not section.sentence or not len(section.tables[0](study)):
        return ["No method is ranked."] if is_ranking else []
    if is_ranking and varies_parameters(study):
        return [shown(line) for line in answer_on_parameters(study)]
    methods = study.methods
    built_in = methods.index[methods.built_in.astype(bool)]
    subjects = methods.apply(subject_of, axis=1)

    def few(row: Mapping[str, Any]) -> str:
        """Return a remark if a stochastic method has too few runs for a test, otherwise ""."""
        labels = str(row["method"]), str(row["against"])
        return TOO_FEW if has_few_runs(study, labels, solved_tasks(study, labels[1])) else ""

    def named(table: Table) -> pd.DataFrame:
        all_rows = table(study)
        rows: pd.DataFrame = all_rows[~is_setting(study, all_rows)]
        of_method = {name: rows.method.map(methods[name]) for name in ("title", "information")}
        subject = rows.method.map(subjects)
        return rows.assign(**of_method, subject=subject, own=~rows.method.isin(built_in))

    rows, *others = map(named, [each for each in section.tables if each is not list_parameters])
    names = {
        "interval": interval, "number": number, "p_value": p_value, "few": few,
        "leading": _first_two if varies_parameters(study) else leading,
        "infinite": math.inf,
        "uses": GROUPS, "first": next(iter(standings(study).index), ""),
        "subjects": subjects,
        "reference": reference(study, ranked_tasks(study)), "varies": varies_parameters(study),
        "beside": _beside, "tasks": len(ranked_tasks(study)),
    }  # fmt: skip
    text = _template_of(section.sentence).render(rows=rows, others=others, **names)
    return [capital(shown(line.strip())) for line in text.split("\n") if line.strip()]


def varies_parameters(study: Study) -> bool:
    """Return True if a study varies parameters, and :attr:`.Study.against` is empty."""
    return not (study.varied.empty or study.against)


@lru_cache  # compiling takes longer than rendering
def _template_of(sentence: str) -> Template:
    """Return the compiled Jinja template of a :attr:`Section.sentence`."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "listed": listed, "capital": capital}
    return environment.from_string(sentence)


def _beside(row: Mapping[str, Any], is_first: bool) -> str:
    """Return in words by how much the reference method is ahead of or behind another method.

    ``row`` is a row of table ``differences`` with the additional column ``subject``: the name of
    the other method. An example of a result is ``5.0 [4.2, 5.9] points behind CMA-ES``. If several
    results are listed, only the first (``is_first``) names the unit.
    """
    other = str(row["subject"]).removesuffix(",")
    if row["difference"] == 0:
        return f"level with {other}"
    sign = 1 if row["difference"] > 0 else -1
    ends = [sign * float(row[f"difference_{end}"]) for end in ("low", "high")][::sign]
    distance = dict(zip(("d", "d_low", "d_high"), [abs(row["difference"]), *ends], strict=True))
    words = f"{interval(distance, 'd', scale=100)}{' points' if is_first else ''}"
    return f"{words} {'ahead of' if sign > 0 else 'behind'} {other}"


def _first_two(rows: pd.DataFrame) -> list[dict[Any, Any]]:
    """Return the first two rows of a table as dicts.

    This function replaces :func:`leading` in a study that varies parameters, where all rows are
    settings of the same method.
    """
    return rows[:2].to_dict("records")


def leading(rows: pd.DataFrame) -> list[dict[Any, Any]]:
    """Return the rows of a table that a finding mentions, as dicts, in the order of the table.

    These are all rows of the methods in the first two rows, of the paper's learner (EC1, EC4, or
    both together), of random search, and of methods from files.
    """
    always = [ROW_OF_LEARNER, EC1, EC4, RANDOM_SEARCH]
    is_shown = rows.method.isin([*rows.method[:2], *always]) | rows.own
    return rows[is_shown].to_dict("records")


@lru_cache(maxsize=4)
def limits(study: Study) -> dict[str, Any]:
    """Return a dict of facts that limit the conclusions from the runs of a study of one world.

    If a limit does not apply, its value is 0, False or empty. The keys are

    - ``runs``, ``failed``, ``reasons``: as in :func:`failures_in`;
    - ``searches``: a list with the id of a search for the optimum that can run in the study's
      world; empty if there is none;
    - ``reconstructed``: titles of the individual tasks of which a part is reconstructed;
    - ``unproven``: titles of the individual tasks whose best known reward is not proven to be the
      optimum, except the tasks in ``own``;
    - ``own``: titles of the individual tasks whose best known reward is known only from methods of
      this folder that are not searches for the optimum (:attr:`.BestKnown.only_here`);
    - ``unknown``: titles of the individual tasks without a best known reward;
    - ``trials``: numbers of trials in runs of the learner that differ from the paper's number;
    - ``few``: smallest number of runs of the paper's learner on a task, if it is below the paper's
      number of runs;
    - ``seed``: seed of the suite;
    - ``processor`` and ``cores``: processor of the machine of the last ``coartic run``, and its
      number of cores;
    - ``side_by_side``: True if one process made several runs side by side;
    - ``dirty``: True if runs were made by code with changes that were not committed;
    - ``late``: warnings about methods (:attr:`.Study.marks`);
    - ``imports``: a dict that maps the title of each method from a file to a string that lists the
      packages that the file imports.

    The dict is cached: do not change it.
    """
    runs, made_with = study.runs, study.made_with
    algorithm, papers = study.methods.algorithm, study.methods.is_learner
    trials = {int(n) for n in runs[runs.label.map(algorithm) == "learner"].trials.dropna()}
    fewest = min(
        (len(cell) for (_, label), cell in shared_cells(study).items() if papers[label]),
        default=RUNS,
    )
    tasks, optima = list(study.individual_tasks.values()), defaultdict[str, list[str]](list)
    for task in tasks:
        best = study.optima.get(task.name)
        unproven = "" if best is None or best.proven else "unproven"
        kind = "unknown" if best is None else "own" if best.only_here else unproven
        optima[kind].append(marked(task))
    model = next(iter(study.models.values()))
    searches = [name for name in SEARCHES if KNOWN_METHODS[name].refuses(model) is None]
    return {
        **failures_in(runs),
        "searches": searches[-1:] if study.is_noisy else searches[:1],
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


def failed_methods(study: Study) -> list[str]:
    """Return a sentence for each row of :func:`.standings` that is not ranked and has failed runs.

    Searches for the optimum, and runs on tasks without a best known reward, are not considered.
    """
    rows = standings(study).query("why != '' and failed > 0")
    where = f" in {world_title(study.world)}" if study.world else ""
    return [
        f"{row.failed} of {pluralize(row.runs, 'run')} failed ({row.title}){where}: "
        "it is not ranked."
        for _, row in rows.iterrows()
    ]


def failures_in(runs: pd.DataFrame) -> dict[str, Any]:
    """Return a dict with the numbers of ``runs`` and ``failed`` runs, and ``reasons`` of failures.

    The reasons are a list of strings: the three most frequent reasons with their numbers of runs,
    and the number of runs that failed for other reasons, if there are any.
    """
    failed = runs[runs.status != "ok"]
    reasons = failed.reason.fillna("")
    others = len(failed) - sum(reasons.value_counts()[:3])
    return {
        "runs": len(runs),
        "failed": len(failed),
        "reasons": commonest(reasons) + ([f"{others} for other reasons"] if others else []),
    }


def notes_of(study: Study, columns: Iterable[str]) -> list[str]:
    """Return the sentences on best known rewards that follow below a table.

    ``columns`` are the names of the columns of the table. The tasks are those of :func:`limits`.

    - If the table has column ``gap`` or ``optimum``, a sentence names the tasks whose best known
      rewards are not proven to be the optimum.
    - If the table has column ``gap``, a sentence names the tasks whose best known rewards are known
      only from this folder.

    A sentence without tasks is left out.
    """
    unproven, own, columns = limits(study)["unproven"], limits(study)["own"], set(columns)
    notes = []
    if unproven and columns & {"gap", "optimum"}:
        notes.append(
            f"The best known rewards of {listed(unproven)} are not proven to be the optimum."
        )
    if own and "gap" in columns:
        notes.append(
            f"For {listed(own)} only the best reward of this folder is known, and gaps are to it."
        )
    return notes
