"""What a reader wants first: four questions, each with a sentence of the data and a picture."""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from coartic.analysis.claims.register import Judged
from coartic.analysis.comparisons.methods import INFORMED
from coartic.analysis.comparisons.overall import variant
from coartic.analysis.comparisons.paper import paper_rows
from coartic.analysis.comparisons.reached import ALL_TASKS
from coartic.analysis.figures.postures import contexts
from coartic.analysis.figures.price import main_methods
from coartic.analysis.figures.ranking import learner, standings
from coartic.analysis.markup import escaped
from coartic.analysis.methods import LEARNER, spoken_name
from coartic.analysis.report.document import Block, Bullets, Section, Strip, Verdict
from coartic.analysis.report.summary import best_condition, unlike_printed
from coartic.analysis.report.text import tone_of
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.study import Study
from coartic.analysis.words import typographic
from coartic.method import Information

_SAID: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)
_IN_WORDS = {
    "equivalent": ("is equivalent", "are equivalent"),
    "undecided": ("is undecided", "are undecided"),
    "different": ("differs", "differ"),
    "supported": ("is", "are"),
    "not supported": ("is not", "are not"),
    "cannot tell": ("cannot be told", "cannot be told"),
    "measured": ("is measured without a verdict", "are measured without a verdict"),
}


def answers(study: Study, pictures: Mapping[str, Block], player: Block | None) -> Section:
    """The four questions as cards; ``pictures`` by id.

    A question that the runs do not answer is left out.
    """
    found = (
        _card("coarticulation", coarticulation(study), _some(pictures.get("postures"), player)),
        _card("paper", reproduced(study), strips(study)),
        _card("methods", winners(study), _some(pictures.get("ranking"))),
        _card("price", price(study), _some(pictures.get("price"))),
    )
    cards = tuple(card for card in found if card is not None)
    return Section("answers", "In short", (), cards, cards=True)


def _card(name: str, finding: str, blocks: Sequence[Block]) -> Section | None:
    if not finding or not blocks:
        return None
    return Section(f"answer-{name}", _SAID[name]["question"], tuple(blocks), finding=finding)


def _some(*blocks: Block | None) -> list[Block]:
    return [block for block in blocks if block is not None]


def _said(section: str, sentence: str, **facts: Any) -> str:
    return _SAID[section][sentence].format(**facts)


def coarticulation(study: Study) -> str:
    """What it is, by a goal that two tasks share before they differ; else by what is played."""
    found = contexts(study)
    if found is None:
        return _played(study)
    first, second = found.tasks
    facts = {
        "goal": found.goal,
        "method": escaped(spoken_name(found.method)),
        "first": escaped(f"goal {found.goal + 1} of {first.label.lower()}"),
        "second": escaped(f"that of {second.label.lower()}"),
        "runs": sum(map(len, found.postures)),
        "apart": f"{found.apart:.2f}",
        "hands": f"{found.hands_apart:.2f}",
        "spreads": "" if math.isnan(found.spreads) else f"; {found.spreads:.1f} SD of the runs",
        "p": "" if math.isnan(found.p) else f", p {_p(found.p)}",
    }
    differs = found.apart > 0 and not found.p >= LEVEL
    return _said("coarticulation", "seen" if differs else "same", **facts)


def _played(study: Study) -> str:
    task = most_learned(study)
    if task is None:
        return ""
    label = best_condition(study, task)
    assert label is not None  # of what was learned
    good = study.cells[task, label].good
    return _said(
        "coarticulation",
        "sacrifice",
        task=escaped(study.tasks[task].label),
        method=escaped(spoken_name(label)),
        learned=typographic(f"{good.reward.mean():.0f}"),
        initial=typographic(f"{good.initial_reward.mean():.0f}"),
    )


def most_learned(study: Study) -> str | None:
    """The task on which the learner's best condition gained the largest share; None for none."""
    gains = {}
    for task in study.tasks:
        label = best_condition(study, task)
        if label is not None:
            good = study.cells[task, label].good
            initial = good.initial_reward.mean()
            if initial < 0:
                gains[task] = float((good.reward.mean() - initial) / -initial)
    return max(gains, key=lambda task: gains[task]) if gains else None


def reproduced(study: Study) -> str:
    """The paper's learned rewards and claims, counted by verdict."""
    return " ".join(filter(None, (cells_found(study), claims_found(study))))


def cells_found(study: Study) -> str:
    """The paper's learned rewards by verdict, after the answer in a word."""
    cells = Counter(row.verdict for row in paper_rows(study) if row.verdict is not None)
    if not cells:
        return ""
    claims = Counter(entry.verdict for entry in study.judged if entry.claim.place)
    facts = {name: _counted(cells, name) for name in ("equivalent", "undecided", "different")}
    margin = f"{100 * MARGIN:.0f} %"
    how = _how(cells, claims)
    return _said("paper", "cells", how=how, cells=cells.total(), margin=margin, **facts)


def claims_found(study: Study) -> str:
    """The paper's claims by verdict; empty where none is decided."""
    judged = [entry for entry in study.judged if entry.claim.place]
    found = Counter(entry.verdict for entry in judged)
    if not found["supported"] + found["not supported"]:
        return ""
    facts = {
        "supported": _counted(found, "supported"),
        "refuted": _counted(found, "not supported"),
        "open": _counted(found, "cannot tell"),
        "measured": _counted(found, "measured"),
    }
    fitted = any(entry.claim.fitted for entry in judged)
    text = _said("paper", "claims", claims=found.total(), **facts)
    return text + _SAID["paper"]["fitted"] * fitted


def _how(cells: Counter[Any], claims: Counter[Any]) -> str:
    """The answer in a word or two, by what is found and what is refuted."""
    if not cells["different"] + claims["not supported"]:
        whole = not cells["undecided"] + claims["cannot tell"]
        return "**Yes.**" if whole else "**Yes, as far as can be told.**"
    if cells["equivalent"] + claims["supported"] == 0:
        return "**No.**"
    more = claims["supported"] > claims["not supported"] and not cells["different"]
    return "**Largely.**" if more else "**In part.**"


def _counted(found: Counter[Any], verdict: str) -> str:
    count = found[verdict]
    return f"{count or 'none'} {_IN_WORDS[verdict][count != 1]}"


def strips(study: Study) -> list[Block]:
    """Verdicts as strips of colours and words, then what is not reproduced, by name."""
    cells = tuple(
        Verdict(
            f"{_unbroken(study.tasks[row.cell.task].label)} "
            + row.cell.label.removeprefix(LEARNER)
            + " †" * bool(study.tasks[row.cell.task].reconstructed),
            row.verdict or "not printed",
            tone_of(row.verdict or ""),
            "#published-and-ours",
        )
        for row in paper_rows(study)
    )
    judged = [entry for entry in study.judged if entry.claim.place]
    decided = sorted(judged, key=lambda entry: _ORDER.index(entry.verdict))
    squares = tuple(
        Verdict(
            entry.claim.statement + " †" * entry.claim.fitted,
            entry.verdict,
            tone_of(entry.verdict),
            f"#claim-{entry.claim.id}",
        )
        for entry in decided
    )
    found: list[Block] = []
    if any(cell.tone != "plain" for cell in cells):
        found.append(Strip("strip-cells", "Learned rewards", cells))
    if squares and any(square.tone in ("good", "bad") for square in squares):
        found.append(Strip("strip-claims", "Claims", squares, counted=True))
    if found:
        found.append(Bullets(tuple(_refuted(judged, study))))
    return [block for block in found if not isinstance(block, Bullets) or block.items]


def _unbroken(text: str) -> str:
    """With spaces and hyphens at which no line breaks."""
    return text.replace(" ", "\N{NO-BREAK SPACE}").replace("-", "\N{NON-BREAKING HYPHEN}")


_ORDER = ("supported", "cannot tell", "not supported", "measured")


def _refuted(judged: Iterable[Judged], study: Study) -> Iterable[str]:
    """Cells that differ and claims that do not hold, by name."""
    for words in unlike_printed(study):
        yield f"Different: {escaped(words)}."
    for entry in judged:
        if entry.verdict == "not supported":
            statement = escaped(entry.claim.statement.rstrip(".")) + " †" * entry.claim.fitted
            yield f"Not supported: [{statement}](#claim-{entry.claim.id})."


def winners(study: Study) -> str:
    """The best of those that learn by trial, the paper's learner, the best that is told more."""
    found = standings(study)
    if not len(found):
        return ""
    shown = found[found.task == found.task.iloc[0]].reset_index(drop=True)
    by_trial = shown[shown.told == INFORMED[Information.REWARD_BY_TRIAL]].reset_index(drop=True)
    by_formula = shown[shown.told == INFORMED[Information.REWARD_FORMULA]]
    said = ""
    if len(by_trial):
        best, sure = by_trial.iloc[0], _sure(by_trial)
        said = _said(
            "methods",
            "learners",
            best=escaped(spoken_name(best.method)),
            leads="is ahead" if sure.startswith(", not") else "wins",
            gap=f"{best.gap:.1f}",
            interval=_interval(best),
            sure=sure,
            learner=_place_of_learner(by_trial),
        )
    if len(by_formula):
        best = by_formula.iloc[0]
        said += _said(
            "methods",
            "informed",
            best=escaped(spoken_name(best.method)),
            gap=f"{best.gap:.1f}",
            proven=_proven(study),
        )
    return said


def _interval(row: Any) -> str:
    return "" if math.isnan(row.low) else rf" \[{row.low:.1f}, {row.high:.1f}]"


def _sure(rows: pd.DataFrame) -> str:
    """Whether the first is apart from the second by their intervals."""
    if len(rows) < 2 or rows.low[:2].isna().any():
        return ""
    second = escaped(spoken_name(rows.method[1]))
    return (
        f", surely before {second}"
        if rows.high[0] < rows.low[1]
        else f", not surely before {second}"
    )


def _place_of_learner(rows: pd.DataFrame) -> str:
    own = rows[rows.method.map(learner)]
    if not len(own) or own.index[0] == 0:
        return ""
    row = own.iloc[0]
    name = escaped(spoken_name(row.method).removeprefix("learner"))
    return _said(
        "methods",
        "learner",
        name=name,
        place=f"place {own.index[0] + 1}",
        count=len(rows),
        gap=f"{row.gap:.1f}",
        interval=_interval(row),
    )


def _proven(study: Study) -> str:
    known = [best for (_, arm), best in study.optima.items() if arm == "free"]
    proven = sum(best.proven for best in known)
    if proven == len(known):
        return ", which is proven"
    return f" (proven on {proven} of {len(known)} tasks, elsewhere the best known)"


def price(study: Study) -> str:
    """What the learner spends for half of the targets, beside the best of its kind and a plan."""
    found = study.reached
    if not len(found):
        return ""
    task = ALL_TASKS if (found.task == ALL_TASKS).any() else str(found.task.iloc[-1])
    shown = found[found.task == task]
    labels = main_methods(shown)
    own = next((label for label in labels if learner(label)), None)
    if own is None:
        return ""
    trials = shown[(shown.spend == "trials") & (shown.budget > 0)]
    learners = [m for m in labels if _learns(trials, m) and m != own]
    last = {m: float(trials[trials.method == m].share.iloc[-1]) for m in (*learners, own)}
    rival = max(learners, key=lambda m: last[m], default=None)
    if rival is None:
        alone = _said("price", "alone", learner=f"{100 * last[own]:.0f} %")
        return alone + _plan(shown, labels, own)
    halves = [_half(trials[trials.method == m]) for m in (own, rival)]
    name = escaped(spoken_name(rival))
    if None in halves:
        facts = {"learner": f"{100 * last[own]:.0f} %", "less": f"{100 * last[rival]:.0f} %"}
        said = _said("price", "never", rival=name, **facts)
    else:
        amounts = [f"{_amount(half)} trials" for half in halves if half is not None]
        said = _said("price", "half", learner=amounts[0], rival=name, less=amounts[1])
    return said + _plan(shown, labels, own)


def _learns(trials: pd.DataFrame, method: str) -> bool:
    """Whether it reaches more in more trials."""
    share = trials[trials.method == method].share
    return bool(len(share) and share.iloc[-1] > share.iloc[0])


def _plan(shown: pd.DataFrame, labels: Iterable[str], own: str) -> str:
    """What makes no trials and reaches half of the targets with the least kinematics."""
    trials = shown[shown.spend == "trials"].groupby("method").budget
    none = shown[(shown.spend == "trials") & (shown.budget == 0) & (shown.share >= 0.5)].method
    known = shown[(shown.spend == "forward_kinematics") & shown.method.isin(set(none))]
    halves = {m: _half(known[known.method == m]) for m in labels if (known.method == m).any()}
    cheap = {m: half for m, half in halves.items() if half is not None}
    if not cheap or not len(trials):
        return ""
    best = min(cheap, key=lambda m: cheap[m])
    name = spoken_name(best)
    kinematics = shown[(shown.spend == "forward_kinematics") & (shown.method == own)]
    half = _half(kinematics)
    beside = "" if half is None else _said("price", "beside", spent=_amount(half))
    name = escaped(name[0].upper() + name[1:])
    return _said("price", "plans", name=name, spent=_amount(cheap[best]), beside=beside)


def _half(rows: pd.DataFrame) -> float | None:
    reached = rows[rows.share >= 0.5].budget
    return float(reached.min()) if len(reached) else None


def _amount(value: float) -> str:
    """With two figures."""
    return typographic(f"{float(f'{value:.2g}'):.0f}")


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"= {value:.2g}"


def hands_found(study: Study) -> str:
    """Where the learner's best condition ends with other hands than it began with."""
    other, learned = [], False
    for task in study.tasks:
        label = best_condition(study, task)
        if label is None:
            continue
        learned, good = True, study.cells[task, label].good
        hands = str(good.hands.mode().iloc[0])
        first = good.initial_hands.dropna()
        if len(first) and hands != first.iloc[0]:
            other.append(escaped(f"{study.tasks[task].label} ({first.iloc[0]} to {hands})"))
    if not learned:
        return ""
    return (
        _said("findings", "hands", tasks=" and ".join(other))
        if other
        else _SAID["findings"]["same_hands"]
    )


def pace_found(study: Study) -> str:
    """After how many trials half of the learner's gain is there, by task."""
    parts = []
    for task in study.tasks:
        label = best_condition(study, task)
        halves = [] if label is None else list(_halves(study, task, label))
        if halves:
            median = float(pd.Series(halves).median())
            parts.append(escaped(f"{_amount(median)} trials on {study.tasks[task].label.lower()}"))
    return _said("findings", "learning", trials=", ".join(parts)) if parts else ""


def _halves(study: Study, task: str, label: str) -> Iterable[float]:
    """Of each run the trial that had half of its whole gain."""
    good = study.cells[task, label].good
    for run_id, initial in zip(good.run_id, good.initial_reward, strict=True):
        run = study.best_so_far[str(run_id)]
        if run.learns and not pd.isna(initial) and run.rewards[-1] > initial:
            enough = run.rewards >= (initial + run.rewards[-1]) / 2
            yield float(run.spent["trials"][enough][0])


def context_found(study: Study) -> str:
    """In how many methods what follows changes what the hand does not feel most."""
    frame = study.signatures
    keys = ["task", "label", "where"]
    parts = [
        frame[(frame.signature == name) & frame.value.notna()].set_index(keys).value
        for name in ("motor-equivalent part", "non-motor-equivalent part")
    ]
    both = pd.concat(parts, axis=1, keys=["equivalent", "other"]).dropna()
    both = both[[not variant(str(label)) for label in both.index.get_level_values("label")]]
    if not len(both):
        return ""
    larger = int((both.equivalent > both.other).sum())
    return _said("findings", "context", equivalent=larger, count=len(both))


def limits_found(items: Sequence[str]) -> str:
    """How many limitations there are."""
    return _said("findings", "limitations", count=len(items))
