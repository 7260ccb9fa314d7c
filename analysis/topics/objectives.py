"""What it costs to plan for a wrong reward: regret by penalty and weight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from coartic import Movement, Task, execute
from coartic.analysis.claims.data import Data, MissingError, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.section import Section
from coartic.analysis.statistics.estimates import FEWEST, RESAMPLES, SEED, TAILS, mean
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.words import capital, estimate, interval_in_words, number
from coartic.robot import Array
from coartic.tasks.task import address_of

Solution = tuple[tuple[Movement, ...], CellRuns]
"""A solution and the runs behind it."""
TERMS = {"joints": "costly joints", "region": "costly disc", "distinct": "postures alike"}
"""Penalties, each by its one weight, in words."""
WHO: dict[str, tuple[str, str, Any]] = {
    "told": ("the planner told of the penalty", style.INK, style.SOLID),
    "ticks": ("the planner of ticks", style.VERMILLION, style.SOLID),
    "smooth": ("the planner of smoothness", style.ORANGE, style.DASHED),
    "learner": ("the learner", style.BLUE, style.SOLID),
    "from plan": ("the learner from the plan of ticks", style.SKY, style.DASHED),
    "cma-es": ("CMA-ES", style.GREEN, style.SOLID),
}
"""Who makes movements, in words, with colour and dash: planners that are told of the penalty, that
believe that ticks count alone, that believe in smoothness; the learner, from the corrective process
and from the plan of ticks; CMA-ES."""
SCORED = {
    "believed-reward/plan": "told",
    "dual-process": "learner",
    "believed-reward/EC1": "from plan",
    "believed-reward/EC4": "from plan",
    "cma-es/bandit": "cma-es",
}
"""Who makes the runs on tasks with a penalty, by method."""
WITHOUT_PENALTY = {
    "believed-reward/plan": "ticks",
    "trajectory-optimisation/squared-changes": "smooth",
}
"""Who makes the plans for tasks without one, which are executed under each penalty."""


def base_of(task: str) -> str:
    """The name of the task of which a task with a penalty is a variant."""
    return task.partition(".")[0]


def term_of(task: Task) -> tuple[str, float]:
    """The one term of a task's penalty that counts, and its weight; no term and 0 without any."""
    if task.penalty is None:
        return "", 0.0
    weights = {term: getattr(task.penalty, term) for term in TERMS}
    (term,) = (term for term, weight in weights.items() if weight)
    return term, weights[term]


@cached
def rewards(study: Study) -> pd.DataFrame:
    """Mean reward under the true objective: a row for each task, term, weight and who.

    Columns ``task`` (without its variant), ``family`` (missing for the paper's), ``split``,
    ``term``, ``weight``, ``who``, ``reward``, ``regret``, in per cent of the best reward that is
    known under this objective, and ``cell``, whose runs are behind it. A task without a penalty is
    one of weight 0 under every term. Runs that failed are left out.
    """
    rows = []
    plans = plans_without_penalty(study)
    for name, task in study.tasks.items():
        address = address_of(base_of(name))
        family, split = (address.family, address.split) if address else (None, None)
        term, weight = term_of(task)
        seen: dict[str, tuple[float, CellRuns]] = {}
        best = -np.inf
        for (run_on, label), cell in study.cells.items():
            method = label.partition(" ")[0]
            who = SCORED.get(method) or SCORED.get(method.partition("/")[0])
            if run_on == name and who is not None and len(cell.good):
                seen[who] = float(cell.rewards.mean()), cell
                best = max(best, float(cell.rewards.max()))
        for who, (movements, cell) in plans.get(base_of(name), {}).items():
            scored = execute(task, movements, model=study.model)
            if scored.reward is not None:
                seen[who] = float(scored.reward), cell
                best = max(best, float(scored.reward))
        for one in TERMS if weight == 0 else (term,):
            for who, (reward, cell) in seen.items():
                regret = 100 * (best - reward) / abs(best)
                row = (base_of(name), family, split, one, weight, who, reward, regret, cell)
                rows.append(row)
    columns = ["task", "family", "split", "term", "weight", "who", "reward", "regret", "cell"]
    return pd.DataFrame(rows, columns=columns).astype({"family": "string", "split": "string"})


@cached
def plans_without_penalty(study: Study) -> dict[str, dict[str, Solution]]:
    """Plans of those that know of no penalty, and their runs, by task without a penalty."""
    plans: dict[str, dict[str, Solution]] = {}
    for (name, label), cell in study.cells.items():
        who = WITHOUT_PENALTY.get(label.partition(" ")[0])
        if who and study.tasks[name].penalty is None and len(cell.good):
            run = str(cell.good.run_id.iloc[0])
            plans.setdefault(name, {})[who] = study.movements(name, label)[run], cell
    return plans


def on_random_tasks(study: Study) -> pd.DataFrame:
    """Rows of :func:`rewards` on random tasks; development instances where there are no others."""
    frame = rewards(study)
    frame = frame[frame.family.notna()]
    reported = frame[frame.split != "development"]
    return reported if len(reported) else frame


def advantage(study: Study, first: str, second: str, term: str) -> pd.DataFrame:
    """Regret of ``second`` less that of ``first``, in per cent of the best known reward.

    A row for each random task that both solved under every weight of a term, a column for each
    weight, 0 first; indexed by family and task.
    """
    frame = on_random_tasks(study)
    frame = frame[frame.term == term]
    second_regret, first_regret = (
        frame[frame.who == who].pivot_table("regret", index=["family", "task"], columns="weight")
        for who in (second, first)
    )
    return (second_regret - first_regret).dropna()


def crossing(weights: Array, means: Array) -> float:
    """The weight from which a mean advantage, shape ``(weights,)``, is above 0 to the last weight.

    Linear between weights; 0 where it always is, infinite where it is not at the last one.
    """
    if means[-1] <= 0:
        return np.inf
    below = np.flatnonzero(means <= 0)
    if not len(below):
        return 0.0
    k = int(below[-1])
    share = -means[k] / (means[k + 1] - means[k])
    return float(weights[k] + share * (weights[k + 1] - weights[k]))


@table("term, weight, who, tasks, regret[], helps[]")
def objectives(study: Study) -> Rows:
    """Regret under the true reward by penalty, its weight and who, means over random tasks.

    In per cent of the best known reward. ``helps``: by how much less the learner from the plan of
    ticks regrets than the learner from the corrective process.
    """
    frame = on_random_tasks(study)
    if not (frame.weight > 0).any():
        return
    for term in TERMS:
        helped = advantage(study, "from plan", "learner", term)
        for (weight, who), rows in sorted(
            frame[frame.term == term].groupby(["weight", "who"]),
            key=lambda part: (part[0][0], list(WHO).index(str(part[0][1]))),
        ):
            row: Row = {"term": term, "weight": weight, "who": who, "tasks": len(rows)}
            row |= random_tasks.mean_of("regret", rows.regret)
            if who == "from plan" and weight in helped.columns:
                row |= random_tasks.mean_of("helps", helped[weight])
            yield f"{term} {weight:g} {who}", row | runs_of(*rows.cell)


@table("term, who, tasks, crossing[]")
def crossings(study: Study) -> Rows:
    """The weight from which trial and error regrets less than the planner that believes in ticks.

    Its interval: percentiles of bootstrap resamples of random tasks within their families, which
    are not widened as means over tasks are, as a crossing can be infinite: beyond the largest
    weight, if at all.
    """
    frame = on_random_tasks(study)
    for term in TERMS:
        for who in ("learner", "cma-es"):
            table = advantage(study, who, "ticks", term)
            if len(table) < FEWEST:
                continue
            weights = np.array(table.columns, dtype=np.float64)
            rng = np.random.default_rng(SEED)
            by_family = [part.to_numpy() for _, part in table.groupby(level="family")]
            drawn = [
                part[rng.integers(len(part), size=(RESAMPLES, len(part)))].mean(axis=1)
                for part in by_family
            ]
            each = [crossing(weights, resample) for resample in np.mean(drawn, axis=0)]
            low, high = np.quantile(each, TAILS, method="inverted_cdf")
            centre = crossing(weights, np.mean([part.mean(axis=0) for part in by_family], axis=0))
            row: Row = {"term": term, "who": who, "tasks": len(table), "crossing": centre}
            of_both = frame[(frame.term == term) & frame.who.isin([who, "ticks"])]
            cells = {id(cell): cell for cell in of_both.cell}
            ends = {"crossing_low": low, "crossing_high": high}
            yield f"{term} {who}", row | ends | runs_of(*cells.values())


@figure(
    "objectives",
    "Regret by how wrong a planner's objective is",
    "Regret under the true reward, which loses a penalty of this weight beside 1 a tick: mean over "
    f"random tasks with its {style.COVERAGE} interval (bootstrap over tasks), in per cent of the "
    "best known reward. Bands: the interval of the weight at which the learner (blue) and CMA-ES "
    "(green), which are told nothing, overtake the planner of ticks. Horizontally by the square "
    "root.",
)
def draw_objectives(study: Study) -> Parts:
    """A panel for each penalty, a line for each who."""
    data = objectives(study)
    if not len(data):
        raise missing(study, "no random tasks with a penalty")
    drawing, panels = style.figure_of((1, len(TERMS)), (style.TWO, 2.8), sharey=True)
    weights = sorted(data.weight.unique())
    edge = 1.05 * weights[-1]
    weights_of_crossings = crossings(study)
    for axes, (term, title) in zip(panels, TERMS.items(), strict=True):
        axes.set_title(title)
        axes.set_xscale("function", functions=(np.sqrt, np.square))
        axes.set_xticks(weights, [f"{weight:g}" for weight in weights])
        axes.set_xlim(0, edge)
        axes.set_xlabel("weight (ticks)")
        for at in weights_of_crossings[weights_of_crossings.term == term].to_dict("records"):
            band: Any = {"color": WHO[at["who"]][1], "alpha": 0.15, "linewidth": 0}
            axes.axvspan(*np.minimum([at["crossing_low"], at["crossing_high"]], edge), **band)
        for who, (words, color, dash) in WHO.items():
            rows = data[(data.term == term) & (data.who == who)]
            line: Any = {"color": color, "linestyle": dash}
            label = words.removeprefix("the ")
            style.means(axes, rows.weight, rows, "regret", **line, label=label)
        axes.set_ylim(bottom=0)
    panels[0].set_ylabel("regret (%)")
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 3)
    each = (f"{name}: {value:.1f} %" for name, value in data.regret.items())
    return drawing, data, f"Regret by penalty, weight and who. {'; '.join(each)}.", ()


def finding_of_objectives(study: Study) -> str:
    """Regrets at the largest weight, by penalty, and where the learner overtakes the planner."""
    data = objectives(study)
    last = data[data.weight == data.weight.max()]
    regrets = last.pivot_table("regret", "term", "who", sort=False)
    if not {"ticks", "learner"} <= set(regrets.columns):
        return ""
    words = {term: "a costly disc" if term == "region" else TERMS[term] for term in TERMS}
    loses = [f"{number(regret, 1)} %" for regret in regrets.ticks]
    loses[0] += " of the best known reward"
    with_terms = (f"{of} with {words[t]}" for of, t in zip(loses, regrets.index, strict=True))
    sentence = (
        f"On {last.tasks.max()} random tasks with a penalty of weight {number(data.weight.max())} "
        f"a planner that believes that ticks alone count loses {', '.join(with_terms)}, the "
        f"learner {', '.join(f'{number(regret, 1)} %' for regret in regrets.learner)}."
    )
    overtakes = [
        f"{interval_in_words(row, 'crossing', digits=0)} with {words[row['term']]}"
        for row in crossings(study).to_dict("records")
        if row["who"] == "learner"
    ]
    if overtakes:
        overtaken = "The learner overtakes that planner at a weight of"
        sentence += f" {overtaken} {', '.join(overtakes)}."
    return sentence


def less_regret(
    data: Data, first: str, second: str, weight: float, terms: tuple[str, ...]
) -> Finding:
    """Whether ``first`` regrets less than ``second`` under penalties of a weight."""
    tests, parts = [], []
    for term in terms:
        table = advantage(data.study, first, second, term)
        if len(table) < FEWEST or weight not in table.columns:
            raise MissingError(f"this folder has too few tasks with {term} {weight:g}")
        tests.append(random_tasks.over_tasks(table[weight], MARGINS["regret"]))
        at = f"at weight {weight:g} ({TERMS[term]})" if weight else "without a penalty"
        parts.append(f"{estimate(mean(table[weight]), 1)} points {at} on {len(table)} random tasks")
    data.run_ids.extend(data.study.runs.run_id)
    pair = f"{capital(WHO[first][0])} regrets less than {WHO[second][0]}"
    seen = f"{pair}: {', '.join(parts)}. Points are per cent of the best known reward."
    return Finding(all(test.value > 0 for test in tests), seen, tuple(tests))


CLAIMED: dict[str, tuple[str, str, float, tuple[str, ...]]] = {
    "right-objective-plans-better": ("ticks", "learner", 0, ("distinct",)),
    "learner-overtakes-wrong-plans": ("learner", "ticks", 300, (*TERMS,)),
    "cma-es-overtakes-sooner": ("cma-es", "ticks", 100, ("joints", "distinct")),
    "learner-finds-distinct-postures": ("learner", "smooth", 300, ("distinct",)),
    "slightly-wrong-plan-helps": ("from plan", "learner", 30, (*TERMS,)),
    "very-wrong-plan-hurts": ("learner", "from plan", 300, ("joints",)),
    "truth-beats-trial-and-error": ("told", "learner", 100, (*TERMS,)),
}
"""Who regrets less than whom by a claim, at which weight of which penalties."""
for _claim, (_first, _second, _weight, _terms) in CLAIMED.items():
    judges(
        _claim,
        test="one-tailed bootstrap tests over random tasks that the first regrets less than the "
        "second by more than {regret:g} % of the best known reward",
        first=_first,
        second=_second,
        weight=_weight,
        terms=_terms,
    )(less_regret)


OBJECTIVES = Section(
    "objectives",
    short="Wrong objectives",
    title="What does it cost to plan for a wrong reward?",
    caption=(
        "Regret under the true reward, in per cent of the best known: means over random tasks"
    ),
    finding=finding_of_objectives,
    figure="objectives",
    table="objectives",
    note=(
        "The true reward loses a penalty beside 1 a tick: joints cost their way, a disc costs the"
        " elbow that is in it, postures at neighbouring goals cost being alike. Its weight says "
        "how wrong a planner is that believes in ticks alone, or in smoothness. Told: a planner "
        "that knows the penalty. From plan: the learner that starts from the plan of ticks, and "
        "so never ends worse than it. Table crossings has the weights at which trial and error "
        "overtakes the planner of ticks."
    ),
)
