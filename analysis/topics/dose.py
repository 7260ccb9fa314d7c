"""How much of the whole task's reward a movement needs: what is learned by the factor γ with which
the rewards of the other movements count."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import LEARNER, PLACEBO
from coartic.analysis.section import Section
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import random_tasks
from coartic.analysis.topics.coarticulation.values import pairs_of_contexts
from coartic.analysis.trajectories import Trajectories
from coartic.analysis.words import interval_in_words

RANDOM = "random"
"""Random tasks of all families together, a task alike."""
GUESSES = "guesses"
"""What counts for the placebo, in the place of movements."""
MEASURES = {
    "nearer": "next goal nearer (ticks)",
    "first": "first movement slower (ticks)",
    "saved": "ticks saved (%)",
}
"""What is measured of each run, with the words of its axis."""
KEYS = ["group", "counted", "dose"]


@cached
def dose_values(study: Study) -> pd.DataFrame:
    """What each run of the learner has learned by γ, and what the best of random guesses shows.

    Columns :data:`KEYS`: a family or a task of the paper, the movements whose rewards count, and γ
    (``dose``); ``task``, ``cell``, and :data:`MEASURES`: arrays with a value for each run. Of the
    learner these are of the noiseless replay after learning. Empty where no γ was varied.
    """
    rows: list[Row] = []
    for method, cells in random_tasks.solved_cells(study).items():
        for cell, parameters in cells:
            learner = method.startswith(LEARNER) and "discount" in parameters
            if learner or method == PLACEBO:
                family = study.tasks[cell.task].family
                rows.append(
                    {
                        "group": str(family).partition("/")[0] if family else cell.task,
                        "counted": parameters.get("counted", GUESSES),
                        "dose": float(parameters.get("discount", math.nan)),
                        "task": cell.task,
                        "cell": cell,
                        **measures_of(study, cell),
                    }
                )
    frame = pd.DataFrame(rows, columns=[*KEYS, "task", "cell", *MEASURES])
    return frame if len(set(frame.dose.dropna())) > 1 else frame[:0]


def measures_of(study: Study, cell: CellRuns) -> Row:
    """:data:`MEASURES` of a cell's runs."""
    runs, rewards = learned(study, cell), cell.rewards
    if cell.method != PLACEBO:
        rewards = cell.good.replay_reward.to_numpy(dtype=np.float64, na_value=np.nan)
    initial = math.nan if runs.initial is None else float(runs.initial.reward or math.nan)
    return {
        "nearer": SIGNS["arm"].of(runs),
        "first": SIGNS["first"].of(runs),
        "saved": 100 * (initial - rewards) / initial,
    }


def learned(study: Study, cell: CellRuns) -> Trajectories:
    """Replays of the learner, the selected trials of the placebo."""
    executed = study.trajectories if cell.method == PLACEBO else study.replays
    return executed(cell.task, cell.label)


def by_task(frame: pd.DataFrame, name: str) -> pd.Series:
    """Means over the runs of each task."""
    return frame.set_index("task")[name].map(random_tasks.mean_or_nan).astype(np.float64)


@table("group, counted, dose, tasks, runs, nearer[], first[], saved[], apart, apart_p, beyond_p")
def dose(study: Study) -> Rows:
    """What is learned by γ: means over random tasks, or over the runs on one of the paper's.

    ``apart``: distance of the mean postures at the goal that this task shares with another one,
    with its p, and that of the test that it is beyond the placebo's.
    """
    frame, drawn = dose_values(study), {n for n, t in study.tasks.items() if t.family is not None}
    together = frame[frame.task.isin(drawn)].assign(group=RANDOM)
    for keys, rows in pd.concat([together, frame]).groupby(KEYS, sort=False, dropna=False):
        at = dict(zip(KEYS, keys, strict=True))
        row: Row = {**at, "tasks": len(rows), "runs": sum(len(cell.good) for cell in rows.cell)}
        for name in MEASURES:
            every = by_task(rows, name)
            if not drawn.issuperset(rows.task):
                every = pd.Series(np.concatenate(list(rows[name])))
            row |= random_tasks.mean_of(name, every)
        (task,) = rows.task if len(rows) == 1 else ("",)
        row |= apart(study, frame, task, at)
        words = GUESSES if at["counted"] == GUESSES else f"{at['counted']} {at['dose']:g}"
        yield f"{at['group']} {words}", row | runs_of(*rows.cell)


def apart(study: Study, frame: pd.DataFrame, task: str, at: dict[str, Any]) -> Row:
    """How far postures lie apart at goal 1, which a task of the paper shares with another one."""
    pairs = [pair for pair in pairs_of_contexts(study) if pair[0] == task]
    if not pairs or study.tasks[task].family is not None:
        return {}
    first, second, _ = pairs[0]

    def contexts(counted: str, dose: float) -> TwoContexts | None:
        same = frame.dose.isna() if math.isnan(dose) else frame.dose == dose
        cells = frame[(frame.counted == counted) & same].set_index("task").cell
        if not {first, second} <= set(cells.index):
            return None
        runs = [learned(study, cells[name]) for name in (first, second)]
        found = TwoContexts(runs[0], runs[1], 1, study.tasks[task].hands[-1])
        return found if all(found.runs) else None

    ours, guesses = contexts(at["counted"], at["dose"]), contexts(GUESSES, math.nan)
    if ours is None:
        return {}
    placebo = at["counted"] == GUESSES or guesses is None
    beyond = math.nan if placebo or guesses is None else ours.p_beyond(guesses)
    return {"apart": ours.apart, "apart_p": ours.p, "beyond_p": beyond}


LOOKS: dict[str, tuple[str, str, Any]] = {
    "all": ("all movements count", style.BLUE, style.SOLID),
    "later": ("later ones alone", style.ORANGE, style.DASHED),
    GUESSES: ("random guesses", style.GREY, style.DOTTED),
}
"""How a line is called and drawn, by what counts."""


@figure(
    "dose",
    "What is learned by how much the other movements' rewards count",
    "The learner by the factor γ with which rewards of the other movements count, from each by "
    "itself (0) to the whole task (1), judged by its noiseless replay. a: ticks by which postures "
    "leave the next goal nearer; b: by which the first movement is longer than the corrective "
    "process's; c: ticks saved, of the initial solution's. Means over random tasks with their "
    f"{style.COVERAGE} interval. d: distance of the postures at the goal that ascending and "
    "descending share. Grey: the best of random guesses, which selects.",
)
def draw_dose(study: Study) -> Parts:
    """The measures by γ on random tasks, and postures apart on the paper's."""
    data = dose(study)
    if not len(data):
        raise missing(study, "no runs of the learner that differ in the discount")
    drawing, panels = style.panels((2, 2), (style.TWO, 4.6))
    random, shared = data[data.group == RANDOM], data[data.apart.notna()]
    panels_of = dict(zip((*MEASURES, "apart"), panels, strict=True))
    for name, axes in panels_of.items():
        for counted, rows in (shared if name == "apart" else random).groupby("counted", sort=False):
            words, color, dash = LOOKS[str(counted)]
            if counted == GUESSES:
                axes.axhline(rows[name].iloc[0], color=color, linestyle=dash, label=words)
                continue
            places = rows.dose + 0.01 * (counted == "later")
            line: Any = {"color": color, "linestyle": dash, "markersize": 3.5, "label": words}
            style.means_at(axes, places, rows, name, **line)
        axes.set_ylabel(MEASURES.get(name, "postures apart"))
        axes.set_xlabel("γ")
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 3)
    whole = random[random.counted == "all"]
    each = (f"γ {row.dose:g}: {row.saved:.1f} %" for row in whole.itertuples())
    return drawing, data, f"Ticks saved on random tasks. {'; '.join(each)}.", ()


def finding_of_dose(study: Study) -> str:
    """What is learned on random tasks at both ends and halfway."""
    data = dose(study)
    rows = data[(data.group == RANDOM) & (data.counted == "all")]
    by_dose = rows.set_index("dose").to_dict("index")
    if not {0.0, 0.5, 1.0} <= by_dose.keys():
        return ""
    parts = []
    for name, unit, words in (
        ("saved", " %", "what it learns saves {} of the ticks"),
        ("nearer", " ticks", "postures leave the next goal nearer by {}"),
        ("first", " ticks", "the first movement is longer by {}"),
    ):
        values = [interval_in_words(by_dose[g], name, unit) for g in (0.0, 0.5, 1.0)]
        parts.append(words.format(f"{values[0]}, {values[1]} and {values[2]}"))
    return (
        f"On {by_dose[1.0]['tasks']} random tasks, where the rewards of the other movements count "
        f"by 0, by half and in full: {'; '.join(parts)}."
    )


def learned_at(data: Data, name: str, dose: float = math.nan, counted: str = "all") -> pd.Series:
    """A measure on each random task that is judged; without γ that of the placebo."""
    frame = dose_values(data.study)
    guesses = math.isnan(dose)
    kept = frame.dose.isna() if guesses else (frame.dose == dose) & (frame.counted == counted)
    return by_task(random_tasks.judged(data, frame[kept]), name)


@judges(
    "dose-moves-postures",
    test="one-tailed bootstrap tests over random tasks, of noiseless replays: with γ = 1 postures "
    "of base and chosen arm leave the next goal nearer by more than {ticks:g} tick more than with "
    "γ = 0, and nearer than those of the best of random guesses",
)
def dose_moves_postures(data: Data) -> Finding:
    """Postures with the reward of the whole, less those without and those of the placebo."""
    whole = learned_at(data, "nearer", 1.0)
    return random_tasks.means_over_tasks({
        "With γ = 1 postures leave the next goal nearer by {} ticks more than with γ = 0": (
            whole - learned_at(data, "nearer", 0.0), MARGINS["ticks"], 1
        ),
        "than those of random guesses by {} ticks": (whole - learned_at(data, "nearer"), 0.0, 1),
    })  # fmt: skip


@judges(
    "dose-slows-first-movements",
    test="one-tailed bootstrap test over random tasks, of noiseless replays: with γ = 1 the first "
    "movement takes more than {ticks:g} tick longer than with γ = 0, each against the corrective "
    "process with the same hands",
)
def dose_slows_first_movements(data: Data) -> Finding:
    """First movements with the reward of the whole, less those without."""
    longer = learned_at(data, "first", 1.0) - learned_at(data, "first", 0.0)
    sentence = "With γ = 1 the first movement takes {} ticks longer than with γ = 0"
    return random_tasks.means_over_tasks({sentence: (longer, MARGINS["ticks"], 1)})


def saves_more(data: Data, more: tuple[float, str], less: tuple[float, str], by: float) -> Finding:
    """What is saved with a γ and what counts, less that with others; more than a bound."""
    values = [learned_at(data, "saved", *at) for at in (more, less)]
    names = [
        f"γ = {dose:g}{', later movements' * (kind == 'later')}" for dose, kind in (more, less)
    ]
    sentence = f"With {names[0]} learning saves {{}} points more than with {names[1]}"
    return random_tasks.means_over_tasks({sentence: (values[0] - values[1], by, 1)})


SAVED = (
    "one-tailed bootstrap test over random tasks, of ticks that noiseless replays save, in per "
    "cent of the initial solution's: "
)


WHOLE, GAIN = (1.0, "all"), MARGINS["gain"]
judges(
    "dose-saves", SAVED + "with γ = 1 more than {gain:g} point more than with γ = 0",
    more=WHOLE, less=(0.0, "all"), by=GAIN,
)(saves_more)  # fmt: skip
judges(
    "half-a-dose-saves-less", SAVED + "with γ = 1 more than {gain:g} point more than 0.5",
    more=WHOLE, less=(0.5, "all"), by=GAIN,
)(saves_more)  # fmt: skip
judges(
    "three-quarters-suffice", SAVED + "with γ = 0.75 less than {gain:g} point less than with γ = 1",
    more=(0.75, "all"), less=WHOLE, by=-GAIN,
)(saves_more)  # fmt: skip
judges(
    "earlier-movements-count", SAVED + "with γ = 1 more than {gain:g} point more where all "
    "movements count than where later ones alone do",
    more=WHOLE, less=(1.0, "later"), by=GAIN,
)(saves_more)  # fmt: skip


@judges(
    "no-step-at-a-small-dose",
    test="one-tailed bootstrap tests over random tasks, of noiseless replays: the mean of γ = 0 "
    "and γ = 1 less that of γ = 0.1 is above 0, of the ticks that are saved and of those by which "
    "the first movement is longer",
)
def no_step_at_a_small_dose(data: Data) -> Finding:
    """How far the smallest dose stays behind half of the way."""
    behind = {}
    for name, words in (("saved", "{} points saved"), ("first", "{} ticks of the first movement")):
        none, little, whole = (learned_at(data, name, dose) for dose in (0.0, 0.1, 1.0))
        behind[f"with γ = 0.1 {words} are missing to half of the way"] = (none + whole) / 2 - little
    return random_tasks.means_over_tasks({s: (values, 0.0, 1) for s, values in behind.items()})


DOSE = Section(
    "dose",
    short="Dose",
    title="How much of the whole task's reward does it take?",
    caption="What is learned by the factor with which rewards of the other movements count",
    finding=finding_of_dose,
    figure="dose",
    table="dose",
    note=(
        "By noiseless replays: what was learned, not what was selected. With γ = 0 each movement "
        "counts by itself, with γ = 1 and all movements it is the paper's learner. Random guesses "
        "are judged by the best of as many trials, which selects. Postures apart: at the goal that "
        "two tasks share, over runs."
    ),
)
