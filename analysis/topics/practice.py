"""What agents that see some goals ahead gain by practice on other tasks, beside a planner."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
from scipy import stats

from coartic.analysis.claims.data import Data, MissingError, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import INITIAL
from coartic.analysis.optima import gap_share
from coartic.analysis.section import Section
from coartic.analysis.statistics.estimates import Estimate, mean, standard_deviation
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.words import capital, estimate, interval_in_words, number

AGENTS, PLANNER, UNPRACTISED = "agents", "planner", "corrective process"
WHOSE = {
    "practice/policy": AGENTS,
    random_tasks.RECEDING_HORIZON: PLANNER,
    INITIAL: UNPRACTISED,
}
EARLY, LATER, ALL_TRIALS = 20_480, 81_920, 327_680
"""Trials of practice after which agents are tested: a sixteenth, a quarter, all."""
AHEAD = (0, 1, 2, 3, 4)
KEYS = ["who", "practice", "ahead"]


@cached
def practice_values(study: Study) -> pd.DataFrame:
    """Gaps to the best known of each random task, per cent, a row for each solved cell.

    Columns ``who``, ``practice`` (trials, 0 without), ``ahead``, ``agent``, ``task``, ``goals``,
    ``gap``, ``cell``. Empty without agents.
    """
    references = sample(study).references
    cells, rows = random_tasks.solved_cells(study), []
    for method, who in WHOSE.items() if next(iter(WHOSE)) in cells else ():
        for cell, asked in cells.get(method, ()):
            if cell.task in references:
                at = asked.get("ahead", asked.get("horizon", 0))
                gap = 100 * gap_share(cell.rewards, references[cell.task].reward).mean()
                goals = len(study.tasks[cell.task].goals)
                key = who, asked.get("practice", 0), at, asked.get("agent", 0)
                rows.append([*key, cell.task, goals, float(gap), cell])
    return pd.DataFrame(rows, columns=[*KEYS, "agent", "task", "goals", "gap", "cell"])


def of(frame: pd.DataFrame, who: str, practice: int, ahead: int) -> pd.DataFrame:
    """Gaps by task and agent. Raises MissingError where there are none."""
    rows = frame[(frame[KEYS] == [who, practice, ahead]).all(axis=1)]
    if not len(rows):
        raise MissingError(f"no runs of {who} with {ahead} goals ahead")
    return rows.pivot_table("gap", "task", "agent").dropna()


def gain(frame: pd.DataFrame, who: str, practice: int, ahead: int) -> pd.DataFrame:
    """What the last goal in view gains a movement that has it, per cent of a shortest movement.

    Of G movements G - ``ahead`` have it: those with a shorter view do not count.
    """
    goals = frame.groupby("task").goals.first()
    gained = of(frame, who, practice, ahead - 1) - of(frame, who, practice, ahead)
    return gained.mul(goals / (goals - ahead), axis=0).dropna()


def behind_planner(frame: pd.DataFrame, ahead: int) -> pd.DataFrame:
    """Gaps of agents after all practice less those of the planner that sees as much."""
    planner = of(frame, PLANNER, 0, ahead)[0]
    return of(frame, AGENTS, ALL_TRIALS, ahead).sub(planner, axis=0).dropna()


def why_silent(frame: pd.DataFrame) -> str:
    """Why nothing follows from the agents, as a sentence; empty where they have learned.

    They have where without a goal ahead they come near enough to the planner that sees as little,
    with one they are better than that, and each is better than the corrective process.
    """
    behind = mean(behind_planner(frame, 0).mean(axis=1))
    one = of(frame, AGENTS, ALL_TRIALS, 0) - of(frame, AGENTS, ALL_TRIALS, 1)
    gained = mean(one.mean(axis=1).dropna())
    before = of(frame, UNPRACTISED, 0, 0)[0].mean()
    worst = max(of(frame, AGENTS, ALL_TRIALS, h).mean().max() for h in AHEAD)
    if not behind.high < MARGINS["unlearned"]:
        return f"Without a goal ahead agents end {estimate(behind, 1)} % behind the planner."
    if not gained.low > 0:
        return f"With a goal ahead agents gain {estimate(gained, 1)} %."
    if not worst < before:
        return f"An agent ends {number(worst, 1)} % from the best, {number(before, 1)} % before."
    return ""


@table("who, practice, h, tasks, gap[], best_agent, worst_agent, gain[]")
def practice(study: Study) -> Rows:
    """Gaps by goals ahead and practice, of agents and planner, as shares: means over tasks.

    ``best_agent``, ``worst_agent``: means of single agents. ``gain``: of the last goal in view.
    """
    frame = practice_values(study)
    groups: Any = frame.groupby(KEYS, sort=False)
    for (who, trials, ahead), rows in groups:
        by_agent = of(frame, who, trials, ahead) / 100
        h = "all" if ahead == rows.goals.min() - 1 else str(ahead)
        row: Row = {"who": who, "practice": trials, "h": h, "tasks": len(by_agent)}
        row |= random_tasks.mean_of("gap", by_agent.mean(axis=1))
        if who == AGENTS:
            row |= {"best_agent": by_agent.mean().min(), "worst_agent": by_agent.mean().max()}
        if ahead in AHEAD[1:]:
            gained = gain(frame, who, trials, ahead).mean(axis=1) / 100
            row |= random_tasks.mean_of("gain", gained)
        name = f"{who} {trials} h={h}" if who == AGENTS else f"{who} h={h}"
        yield name, row | runs_of(*rows.cell)


@figure(
    "practice",
    "What practice on other tasks gains, by goals ahead",
    f"Gap to the best known solution, mean over random tasks with its {style.COVERAGE} interval "
    "(bootstrap over tasks). a: agents that see 0 to 4 goals ahead, by trials of practice; 0 is "
    "the corrective process. b: by goals ahead, agents after all practice (dots: single ones) "
    "beside the planner.",
)
def draw_practice(study: Study) -> Parts:
    """Learning curves, and the curves by goals ahead."""
    data = practice(study)
    agents, planner = (data[data.who == who] for who in (AGENTS, PLANNER))
    if not len(agents):
        raise missing(study, "no agents that have practised")
    drawing, (left, right) = style.panels((1, 2), (style.TWO, 2.8), sharey=True)
    counts, views = [0, *sorted(agents.practice.unique())], [*map(str, AHEAD), "all"]
    line: Any = {"scale": 100, "bars": 0.9}
    for color, ahead in zip(style.PALETTE, AHEAD, strict=False):
        rows = agents[agents.h == str(ahead)].sort_values("practice")
        rows = pd.concat([data[data.who == UNPRACTISED], rows])
        places = [counts.index(n) + 0.06 * ahead for n in rows.practice]
        style.means_at(left, places, rows, "gap", color=color, label=str(ahead), **line)
        single = of(practice_values(study), AGENTS, counts[-1], ahead).mean()
        right.plot([ahead + 0.15] * len(single), single, ".", color=style.BLUE, markersize=3)
    last = agents[agents.practice == counts[-1]]
    for rows, color, name in ((last, style.BLUE, "agents"), (planner, style.VERMILLION, "planner")):
        places = list(map(views.index, rows.h))
        style.means_at(right, places, rows, "gap", color=color, label=name, **line)
    left.set_xticks(range(len(counts)), [f"{n:,}".replace(",", " ") for n in counts])
    left.set_xlabel("trials of practice")
    left.set_ylabel("gap (%)")
    left.set_ylim(bottom=0)
    left.legend(title="goals ahead", loc="lower left", ncols=2)
    right.set_xticks(range(len(views)), views)
    right.set_xlabel("goals ahead")
    right.legend(loc="lower left")
    style.letters((left, right))
    each = (f"{row}: {gap:.1%}" for row, gap in zip(data.index, data.gap, strict=True))
    return drawing, data, f"Gaps by practice and goals ahead. {'; '.join(each)}.", ()


def finding_of_practice(study: Study) -> str:
    """Gaps without and with a goal ahead after all practice, and what further goals gain."""
    data = practice(study)
    try:
        silent = why_silent(practice_values(study))
    except MissingError:
        return ""
    if silent:
        return f"Nothing follows, since the agents have not learned. {silent}"
    none, one, two, four = (
        data.loc[f"{AGENTS} {ALL_TRIALS} h={h}"].to_dict() for h in (0, 1, 2, 4)
    )
    words = [
        interval_in_words(row, name, " %", scale=100)
        for row, name in ((none, "gap"), (one, "gap"), (two, "gain"), (four, "gain"))
    ]
    return (
        f"On {none['tasks']} tasks that they have not met, agents that have practised end "
        f"{words[0]} from the best known reward without a goal ahead and {words[1]} with one. The "
        f"second goal ahead gains {words[2]} a movement that has it, the fourth {words[3]}."
    )


def over_agents(values: pd.Series) -> Estimate:
    """One-tailed t-test that the mean over agents is above 0."""
    error = standard_deviation(values.to_numpy()) / math.sqrt(len(values))
    p = float(stats.t.sf(values.mean() / error, len(values) - 1)) if error else math.nan
    return Estimate(float(values.mean()), p=p, n=(len(values),))


Sides = list[tuple[str, pd.DataFrame, float, int]]
"""Of each part a sentence with a place for a mean, values by task and agent, a bound, and 1 where
their mean should be above it, -1 below."""


def of_agents(frame: pd.DataFrame, first: tuple[int, int], second: tuple[int, int]) -> pd.DataFrame:
    """Gaps of agents less those of others, each by trials of practice and goals ahead, points."""
    return (of(frame, AGENTS, *first) - of(frame, AGENTS, *second)).dropna()


def gains_more(frame: pd.DataFrame) -> Sides:
    """Practice with two goals ahead against none."""
    two, none = (of_agents(frame, (EARLY, h), (ALL_TRIALS, h)) for h in (2, 0))
    words = "practice gains {} points more with two goals ahead than with none"
    return [(words, (two - none).dropna(), 0.0, 1)]


def gains_longer(frame: pd.DataFrame) -> Sides:
    """The last three quarters with four goals ahead against none."""
    four, none = (of_agents(frame, (LATER, h), (ALL_TRIALS, h)) for h in (4, 0))
    words = "the last three quarters gain {} points more with four goals ahead than with none"
    return [(words, (four - none).dropna(), 0.0, 1)]


def lengthens(frame: pd.DataFrame) -> Sides:
    """Goals beyond the first ahead, after practice against early on."""
    after, before = (of_agents(frame, (trials, 1), (trials, 4)) for trials in (ALL_TRIALS, EARLY))
    words = "the second to fourth goals ahead gain {} points more after practice"
    return [(words, (after - before).dropna(), 0.0, 1)]


def first_most(frame: pd.DataFrame) -> Sides:
    """Goals beyond the first ahead after practice, and the first against them."""
    first, further = (
        of_agents(frame, (ALL_TRIALS, fewer), (ALL_TRIALS, more))
        for fewer, more in ((0, 1), (1, 4))
    )
    return [
        ("the second to fourth goals ahead gain {} points together", further, 0.0, 1),
        ("the first {} more", (first - further).dropna(), 0.0, 1),
    ]


def stays_behind(frame: pd.DataFrame) -> Sides:
    """Agents against the planner that sees as much, with two goals or more."""
    words = {
        2: "with two goals ahead agents are {} points behind",
        3: "with three {}",
        4: "four {}",
    }
    return [(words[h], behind_planner(frame, h), MARGINS["gain"], 1) for h in words]


def judge_parts(data: Data, *, parts: Any) -> Finding:
    """Whether over tasks and over agents the means of some parts are on the side they should.

    Raises MissingError where the agents have not learned.
    """
    frame = random_tasks.judged(data, practice_values(data.study))
    if silent := why_silent(frame):
        raise MissingError(f"the agents have not learned: {silent}")
    tests: dict[int, list[Estimate]] = {1: [], -1: []}
    seen = []
    for sentence, values, bound, sign in parts(frame):
        by_task, by_agent = values.mean(axis=1), values.mean()
        for side, estimates in tests.items():
            estimates += [random_tasks.over_tasks(side * sign * by_task, side * sign * bound)]
            estimates += [over_agents(side * sign * (by_agent - bound))]
        single = f"agents {number(by_agent.min(), 2)} to {number(by_agent.max(), 2)}"
        seen.append(f"{sentence.format(estimate(mean(by_task), 2))} ({single})")
    holds = all(test.value > 0 for test in tests[1])
    return Finding(holds, f"{capital('; '.join(seen))}.", tuple(tests[1]), tuple(tests[-1]))


for claim, parts, words in (
    ("larger-views-gain-more-by-practice", gains_more,
     f"from {EARLY:,} trials on the gap falls by more with two goals ahead than with none"),
    ("larger-views-gain-longer", gains_longer,
     f"from {LATER:,} trials on the gap falls by more with four goals ahead than with none"),
    ("practice-lengthens-the-horizon", lengthens,
     "from one goal ahead to four the gap falls by more after all practice than after "
     f"{EARLY:,} trials"),
    ("first-goal-ahead-gains-agents-most", first_most,
     "after all practice the gap falls from one goal ahead to four, and by more from none to one"),
    ("agents-behind-planner", stays_behind,
     "with two, three and four goals ahead the gap of agents after all practice is higher by more "
     "than {gain:g} points than that of the planner that sees as much"),
):  # fmt: skip
    test = f"one-tailed tests over random tasks (bootstrap) and over agents (Student): {words}"
    judges(claim, test, parts=parts)(judge_parts)


PRACTICE = Section(
    "practice",
    short="Practice",
    title="What does practice gain?",
    caption="Gap of agents and planner by goals ahead, in per cent of the best known reward",
    finding=finding_of_practice,
    figure="practice",
    table="practice",
    note=(
        "Agents have practised on tasks of the family, each met once, and are tested on others, "
        "once. The gain is that of the last goal in view, a movement that has it."
    ),
)
