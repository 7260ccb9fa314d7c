"""What a reader wants first: four questions, each with a sentence of the data and a picture."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from coartic.analysis.claims.register import Judged
from coartic.analysis.comparisons.methods import INFORMED, UNTOLD
from coartic.analysis.comparisons.overall import variant
from coartic.analysis.comparisons.paper import paper_rows
from coartic.analysis.comparisons.reached import ALL_TASKS
from coartic.analysis.figures.postures import contexts
from coartic.analysis.figures.price import main_methods
from coartic.analysis.figures.ranking import learner, standings
from coartic.analysis.markup import escaped
from coartic.analysis.methods import LEARNER, spoken_name
from coartic.analysis.published import published_cells
from coartic.analysis.report.document import Block, Bullets, Prose, Section, Strip, Verdict
from coartic.analysis.report.summary import learned, unlike_printed
from coartic.analysis.report.text import tone_of
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.study import Study
from coartic.analysis.words import marked, stated, typographic
from coartic.method import Information

_SAID: dict[str, dict[str, str]] = stated(__file__)
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
        _card("general", in_general(study), strips(study)),
        _card("methods", winners(study), _some(pictures.get("ranking"))),
        _card("price", price(study), _some(pictures.get("price"))),
    )
    cards = tuple(card for card in found if card is not None)
    about = (Prose((_SAID["about"]["learner"],)),) if most_learned(study) is not None else ()
    return Section("answers", "In short", about, cards, cards=True)


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
    most = most_learned(study)
    task = escaped(study.tasks[most[0]].label) if most else ""
    facts = {
        "found": found,
        "method": escaped(spoken_name(found.method)),
        "first": escaped(f"goal {found.goal + 1} of {first.label.lower()}"),
        "second": escaped(f"that of {second.label.lower()}"),
        "runs": sum(map(len, found.postures)),
        "spreads": "" if math.isnan(found.spreads) else f"; {found.spreads:.1f} SD of the runs",
        "p": "" if math.isnan(found.p) else f", p {_p(found.p)}",
        "played": _said("coarticulation", "played", task=task) if task else "",
    }
    differs = found.apart > 0 and not found.p >= LEVEL
    return _said("coarticulation", "seen" if differs else "same", **facts)


def _played(study: Study) -> str:
    most = most_learned(study)
    if most is None:
        return ""
    task, label, good = most
    return _said(
        "coarticulation",
        "sacrifice",
        task=escaped(study.tasks[task].label),
        method=escaped(spoken_name(label)),
        learned=typographic(f"{good.reward.mean():.0f}"),
        initial=typographic(f"{good.initial_reward.mean():.0f}"),
        given_up=given_up(study),
    )


def given_up(study: Study) -> str:
    """Whether the learner is slower to the first goal and faster to the last, by the task it
    improves most on; empty where that was not measured."""
    most, found = most_learned(study), study.signatures
    if most is None:
        return ""
    task, label, _ = most
    found = found[(found.task == task) & found.value.notna() & (found.label == label)]
    of = found.drop_duplicates("signature").set_index("signature")
    names = [f"{part} against the same hands" for part in ("first subtask", "total")]
    if not set(names) <= set(of.index):
        return ""
    rows: list[Any] = [of.loc[name] for name in names]
    first, whole = rows
    least = first.value if math.isnan(first.low) else first.low
    changes = (typographic(f"{row.value:+.1f}") for row in rows)
    return _said(
        "coarticulation",
        "given_up" if least > 0 > whole.value else "not_given_up",
        task=escaped(study.tasks[task].label),
        method=escaped(spoken_name(label)),
        interval=_interval(first),
        **dict(zip(("first", "whole"), changes, strict=True)),
    )


def most_learned(study: Study) -> tuple[str, str, pd.DataFrame] | None:
    """Of :func:`~coartic.analysis.report.summary.learned` where the largest share was gained."""
    gains: dict[float, tuple[str, str, pd.DataFrame]] = {}
    for found in learned(study):
        reward, initial = found[2].reward.mean(), found[2].initial_reward.mean()
        if initial < 0:
            gains.setdefault(float((reward - initial) / -initial), found)
    return gains[max(gains)] if gains else None


def reproduced(study: Study) -> str:
    """The paper's learned rewards and claims, counted by verdict."""
    if not of_the_paper(study):
        return ""
    said = claims_found(study), cells_found(study), _fitted(study)
    return " ".join([_how(study), *filter(None, said)]) if any(said[:2]) else ""


def in_general(study: Study) -> str:
    """Of random tasks alone: the claims about them by verdict."""
    alone = study.instances is not None and not of_the_paper(study)
    return claims_found(study) if alone else ""


def of_the_paper(study: Study) -> bool:
    """Whether any run is on a task of the paper."""
    return any(task in study.tasks for task, _ in published_cells())


def cells_found(study: Study) -> str:
    """The paper's learned rewards by verdict."""
    cells = _cells(study)
    if not cells:
        return ""
    facts = {name: _counted(cells, name) for name in ("equivalent", "undecided", "different")}
    return _said("paper", "cells", cells=cells.total(), margin=f"{100 * MARGIN:.0f} %", **facts)


def claims_found(study: Study) -> str:
    """The paper's claims by verdict; empty where none is decided."""
    found = _claims(study)
    if not found["supported"] + found["not supported"]:
        return ""
    facts = {"open": _counted(found, "cannot tell"), "measured": _counted(found, "measured")}
    own = "paper" if study.instances is None or of_the_paper(study) else "general"
    return _said(own, "claims", claims=found.total(), **_decided(found), **facts)


def _fitted(study: Study) -> str:
    """What is left without the tasks whose goals are not printed."""
    if not any(entry.claim.fitted for entry in study.judged):
        return ""
    return _said("paper", "fitted", **_decided(_claims(study, fitted=False)))


def _cells(study: Study) -> Counter[Any]:
    return Counter(row.verdict for row in paper_rows(study) if row.verdict is not None)


def _claims(study: Study, *, fitted: bool = True) -> Counter[Any]:
    """The paper's claims by verdict, with or without those on reconstructed tasks."""
    judged = (entry for entry in study.judged if entry.claim.place)
    return Counter(entry.verdict for entry in judged if fitted or not entry.claim.fitted)


def _decided(found: Counter[Any]) -> dict[str, str]:
    return {
        "supported": _counted(found, "supported"),
        "refuted": _counted(found, "not supported"),
    }


def _how(study: Study) -> str:
    """The answer in a word or two, by what is found and what is refuted."""
    cells, claims = _cells(study), _claims(study)
    if not cells["different"] + claims["not supported"]:
        return _SAID["paper"]["open" if cells["undecided"] + claims["cannot tell"] else "yes"]
    return _SAID["paper"]["part" if cells["equivalent"] + claims["supported"] else "no"]


def _counted(found: Counter[Any], verdict: str) -> str:
    count = found[verdict]
    return f"{count or 'none'} {_IN_WORDS[verdict][count != 1]}"


def strips(study: Study) -> list[Block]:
    """Verdicts as strips of colours and words, then what is not reproduced, by name."""
    cells = []
    for row in paper_rows(study):
        task, verdict = study.tasks[row.cell.task], row.verdict or "not printed"
        name = marked(f"{_unbroken(task.label)} {row.cell.label.removeprefix(LEARNER)}", task)
        cells.append(Verdict(name, verdict, tone_of(verdict), "#published-and-ours"))
    judged = [entry for entry in study.judged if entry.claim.place]
    decided = sorted(judged, key=lambda entry: _ORDER.index(entry.verdict))
    squares = []
    for entry in decided:
        name = entry.claim.statement + " †" * entry.claim.fitted
        link = f"#claim-{entry.claim.id}"
        squares.append(Verdict(name, entry.verdict, tone_of(entry.verdict), link))
    found: list[Block] = []
    if any(cell.tone != "plain" for cell in cells):
        found.append(Strip("strip-cells", "Learned rewards", tuple(cells)))
    if squares and any(square.tone in ("good", "bad") for square in squares):
        found.append(Strip("strip-claims", "Claims", tuple(squares), counted=True))
    if found:
        refuted = tuple(_refuted(judged, study))
        if refuted:
            found += [Prose((_SAID["paper"]["refuted"],)), Bullets(refuted)]
    return found


def _unbroken(text: str) -> str:
    """With spaces and hyphens at which no line breaks."""
    return text.replace(" ", "\N{NO-BREAK SPACE}").replace("-", "\N{NON-BREAKING HYPHEN}")


_ORDER = ("supported", "cannot tell", "not supported", "measured")


def _refuted(judged: Iterable[Judged], study: Study) -> Iterable[str]:
    """Cells that differ and claims that do not hold, by name."""
    for words in unlike_printed(study):
        yield f"Different: {escaped(words)}."
    refuted = [entry for entry in judged if entry.verdict == "not supported"]
    for entry in sorted(refuted, key=lambda entry: entry.claim.fitted):
        statement = escaped(entry.claim.statement.rstrip(".")) + " †" * entry.claim.fitted
        yield f"[{statement}](#claim-{entry.claim.id})."


def winners(study: Study) -> str:
    """The best of those that learn by trial, the paper's learner, the best that is told more."""
    found = standings(study)
    if not len(found):
        return ""
    shown = found[found.task == found.task.iloc[0]].reset_index(drop=True)
    by_trial = shown[shown.told == INFORMED[Information.REWARD_BY_TRIAL]].reset_index(drop=True)
    said, (proven, known) = "", _proven(study)
    sure_of = f" (proven on {proven} of {known} tasks)"
    if proven == known:
        sure_of = ", which is proven"
    if len(by_trial):
        best, apart = by_trial.iloc[0], _is_apart(by_trial)
        sure = ""
        if apart is not None:
            second = escaped(spoken_name(by_trial.method[1]))
            sure = f", {'surely' if apart else 'not surely'} before {second}"
        said = _said(
            "methods",
            "learners",
            best=escaped(spoken_name(best.method)),
            leads="is ahead" if apart is False else "wins",
            row=best,
            known="optimum" if 2 * proven > known else "best known reward",
            interval=_interval(best, about=_SAID["methods"]["about"]),
            sure=sure,
            learner=_place_of_learner(by_trial),
        )
    others = {"informed": INFORMED[Information.REWARD_FORMULA], "untold": UNTOLD}
    for sentence, told in others.items():
        own = shown[shown.told == told]
        if len(own):
            best = own.iloc[0]
            name = escaped(spoken_name(best.method))
            said += _said("methods", sentence, proven=sure_of, best=name, row=best)
    return said


def _interval(row: Any, about: str = "") -> str:
    if math.isnan(row.low):
        return ""
    return _said("methods", "interval", row=row, about=about)


def _is_apart(rows: pd.DataFrame) -> bool | None:
    """Whether the first is apart from the second by their intervals; None without these."""
    if len(rows) < 2 or rows.low[:2].isna().any():
        return None
    return bool(rows.high[0] < rows.low[1])


def _place_of_learner(rows: pd.DataFrame) -> str:
    own = rows[rows.method.map(learner)]
    if not len(own) or own.index[0] == 0:
        return ""
    row = own.iloc[0]
    name = escaped(spoken_name(row.method).removeprefix("learner"))
    of = {"name": name, "place": own.index[0] + 1, "count": len(rows)}
    return _said("methods", "learner", row=row, interval=_interval(row), **of)


def _proven(study: Study) -> tuple[int, int]:
    """Tasks whose best known reward is proven to be the optimum, and those that have one."""
    known = [best for (_, arm), best in study.optima.items() if arm == "free"]
    return sum(best.proven for best in known), len(known)


def price(study: Study) -> str:
    """What half of the levels cost the learner, beside the best of its kind and a plan."""
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
        return alone + _plan(shown, labels, own, None)
    halves = [_half(trials[trials.method == m]) for m in (own, rival)]
    name = escaped(spoken_name(rival))
    if halves[0] is None or halves[1] is None:
        facts = {"learner": f"{100 * last[own]:.0f} %", "less": f"{100 * last[rival]:.0f} %"}
        said = _said("price", "never", rival=name, **facts)
    else:
        amounts = [f"{_amount(half)} trials" for half in (halves[0], halves[1])]
        times = halves[0] / halves[1]
        fewer = _said("price", "fewer", times=_amount(times)) if times >= 2 else ""
        facts = {"learner": amounts[0], "less": amounts[1], "fewer": fewer}
        said = _said("price", "half", rival=name, **facts)
    return said + _plan(shown, labels, own, rival)


def _learns(trials: pd.DataFrame, method: str) -> bool:
    """Whether it reaches more in more trials."""
    share = trials[trials.method == method].share
    return bool(len(share) and share.iloc[-1] > share.iloc[0])


def _plan(shown: pd.DataFrame, labels: Iterable[str], own: str, rival: str | None) -> str:
    """What makes no trials and reaches half of the levels with the least kinematics."""
    none = shown[(shown.spend == "trials") & (shown.budget == 0) & (shown.share >= 0.5)].method
    kinematics = shown[shown.spend == "forward_kinematics"]
    halves = {m: _half(kinematics[kinematics.method == m]) for m in labels if m in set(none)}
    cheap = {m: half for m, half in halves.items() if half is not None}
    if not cheap:
        return ""
    best = min(cheap, key=lambda m: cheap[m])
    name = spoken_name(best)
    half, other = (_half(kinematics[kinematics.method == m]) for m in (own, rival))
    beside = ""
    if half is not None:
        spent = "" if other is None else _amount(other)
        named = escaped(spoken_name(str(rival)))
        also = spent and _said("price", "rival", name=named, spent=spent)
        beside = _said("price", "beside", spent=_amount(half), rival=also)
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
    every, other = list(learned(study)), []
    for task, _, good in every:
        hands = str(good.hands.mode().iloc[0])
        first = good.initial_hands.dropna()
        if len(first) and hands != first.iloc[0]:
            other.append(escaped(f"{study.tasks[task].label} ({first.iloc[0]} to {hands})"))
    if other:
        return _said("findings", "hands", tasks=" and ".join(other))
    return _SAID["findings"]["same_hands"] if every else ""


def pace_found(study: Study) -> str:
    """After how many trials half of the learner's gain is there, by task."""
    parts = []
    for task, _, good in learned(study):
        halves = list(_halves(study, good))
        if halves:
            median = float(pd.Series(halves).median())
            parts.append(escaped(f"{_amount(median)} trials on {study.tasks[task].label.lower()}"))
    return _said("findings", "learning", trials=", ".join(parts)) if parts else ""


def _halves(study: Study, good: pd.DataFrame) -> Iterable[float]:
    """Of each run the trial that had half of its whole gain."""
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
        return given_up(study)
    larger = int((both.equivalent > both.other).sum())
    return _said("findings", "context", equivalent=larger, count=len(both))


def limits_found(items: Sequence[str]) -> str:
    """How many limitations there are."""
    return _said("findings", "limitations", count=len(items))
