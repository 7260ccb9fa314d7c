"""Sections of the page in their order, and tables and figures of the report by id."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coartic.analysis.figures.plot import Plot
from coartic.analysis.sections import (
    coarticulation,
    costs,
    learning,
    methods,
    own,
    random_tasks,
    ranking,
    scores,
    tasks,
)
from coartic.analysis.study import Study
from coartic.analysis.table import Table
from coartic.analysis.words import id_of


@dataclass(frozen=True)
class Section:
    """A section of the page, left out if the folder has neither its table nor its figure."""

    id: str
    short: str
    """Name among the contents."""
    title: str
    table: Table
    caption: str
    """Caption of the table."""
    figure: Callable[[Study], Plot | None] | None = None
    """Function that draws the figure, or returns None if the folder has no runs for it."""
    sentence: Callable[[Study], str] | None = None
    """Function that returns the finding in words, also for too few runs, with the number of failed
    runs; empty without a finding. The first line is an answer for the first screen."""
    answer: str = ""
    """Word before the answer on the terminal; empty for sections without a short answer."""
    note: str = ""
    """Explanation of figure and table."""
    single: bool = True
    """True for sections about single tasks, left out for many random tasks."""
    folded: bool = False
    """True if the page folds the table."""


SECTIONS = (
    Section(
        "own",
        "Own methods",
        "How good are your own methods?",
        table=own.list_own,
        caption="Methods from files on each task (rewards in ticks)",
        sentence=own.own_in_words,
        answer="Own",
        note="Nearest: the built-in method with the smallest gap on the task. p is of the test "
        "that the mean reward differs from the learner's, corrected for the tasks of the method "
        "(Holm). A gap over several tasks is on those on which the method solved every run.",
        single=False,
        folded=True,
    ),
    Section(
        "coarticulation",
        "Coarticulation",
        "Does the next goal change the movement?",
        table=coarticulation.list_contexts,
        caption="Postures at a goal that two tasks share",
        figure=coarticulation.draw_postures,
        sentence=coarticulation.next_goal,
        answer="Coarticulation",
        note="Postures are compared in length units and rad. Random search is "
        "the learner without its memory: the best of as many trials is selected. All runs count.",
    ),
    Section(
        "nearest",
        "Ranking",
        "Who comes nearest?",
        table=ranking.list_ranking,
        caption="Gap of the mean reward, over all tasks and on each",
        figure=ranking.draw_ranking,
        sentence=ranking.nearest,
        answer="Nearest",
        note="Methods are grouped by their use of the reward: its value after each trial, its "
        "formula, or nothing. In the sentence the best method of each algorithm counts, with its "
        "default setting if it ran with it. Intervals describe "
        "new runs on the same tasks. Better on, worse on: number of tasks on which the mean reward "
        "differs significantly from that of the paper's learner (EC1 with one arm, EC4 with two), "
        "by two-tailed bootstrap tests, corrected for the tasks of the method (table "
        "against-learner). Empty: the runs are too few, or too alike, to tell.",
    ),
    Section(
        "scores",
        "Share of the gain",
        "How much of the possible gain?",
        table=scores.list_scores,
        caption="Share of the possible gain, over all tasks, by arms, and after 1000 trials",
        note="0 % is the corrective process alone with its best hands (with the task's initial "
        "hands where there are over 4096 hand sequences), 100 % the best known reward. A task on "
        "which both are equal has no share and is counted. The gap alone weighs tasks by how bad "
        "the corrective process is on them. Methods that make no trials have their result after "
        "any number of trials.",
        single=False,
        folded=True,
    ),
    Section(
        "runtimes",
        "Cost",
        "What does it cost?",
        table=costs.list_runtimes,
        caption="Cost of reaching shares of the targets",
        figure=costs.draw_runtimes,
        sentence=costs.what_it_costs,
        answer="Cost",
        note="The figure shows methods that learn, random search and the best planner. The number "
        "of forward-kinematics evaluations is a cost that is the same on every machine. ∞: "
        "not reached within the budget of trials.",
    ),
    Section(
        "learning",
        "Learning",
        "How fast is it learned?",
        table=learning.list_learning,
        caption="Best reward so far, mean over runs (ticks)",
        figure=learning.draw_learning_curves,
        sentence=learning.how_fast,
        note="Gain: improvement over the corrective process alone. ∞: never improved.",
        folded=True,
    ),
    Section(
        "signatures",
        "Signatures",
        "Which signatures of coarticulation does each method show?",
        table=coarticulation.list_signatures,
        caption="Signatures of coarticulation, means over runs, next to random search",
        figure=coarticulation.draw_coarticulation,
        sentence=coarticulation.joints_or_hand,
        note="Ticks are compared with those of the corrective process with the same hands. A first "
        "movement that gets slower while the whole task gets faster is sacrificed for it. Idle "
        "hand nearer: share of the path to its next goal that a hand covers while idle. A row has "
        "the runs with one hand sequence (of at least a tenth of a method's runs); random search, "
        "the learner without its memory, has the same hands and as many trials, and all its runs "
        "count. The choice of hands, in rows without a sequence, is compared with random search "
        "that tries every sequence. p is one-tailed, uncorrected; a dash: no such random search.",
        folded=True,
    ),
    Section(
        "families",
        "Random tasks",
        "What holds on random tasks?",
        table=random_tasks.list_family_gaps,
        caption="Gap to the best known reward, in per cent of it: mean over instances",
        figure=random_tasks.draw_gaps_by_family,
        sentence=random_tasks.on_random_tasks,
        answer="Random tasks",
        single=False,
    ),
    Section(
        "tasks",
        "Tasks",
        "What are the tasks?",
        table=tasks.list_tasks,
        caption="Tasks with their initial and best possible rewards (ticks)",
        figure=tasks.draw_tasks,
        sentence=tasks.how_long,
        note="Initial, best hands: the corrective process alone, with the task's initial hands and "
        "with the best of all hand sequences. Best known: the optimum where the proven bound "
        "equals it. Proven bound: a reward that no solution can exceed.",
    ),
    Section(
        "methods",
        "All methods",
        "What did every method do on every task?",
        table=methods.list_methods,
        caption="Reward, gap to the optimum, hands with their runs, and costs of a run (medians)",
        note="Every method works on the same robot. Its movements are scored by one function, "
        "which no method can reach. Times are seconds of solving.",
        folded=True,
    ),
)
TABLES = {each.table.id: each.table for each in SECTIONS}
TABLES["against-learner"] = ranking.list_against_learner
"""Tables by id; the last is a CSV file without a section."""
FIGURES = {id_of(each.figure): each.figure for each in SECTIONS if each.figure}
"""Figures by id."""
