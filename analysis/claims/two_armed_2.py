"""The paper's claims about two-armed task 2 (exploration conditions 3 and 4)."""

from __future__ import annotations

from collections import Counter

from analysis.claims.data import TWO, Data
from analysis.claims.judges.hands import better_hands
from analysis.claims.judges.shares import AS_OFTEN, as_often
from analysis.claims.register import Claim, Finding
from analysis.published import published_exhaustive
from analysis.words import tally


def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    shown = f"{' and '.join(best)} {reward:.0f} (published {printed[0]} {printed[1]})"
    text = f"best of the corrective process alone: {shown}"
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text}: a tie")


def _half_choose_rlrr(data: Data) -> Finding:
    return as_often(data, TWO, "EC3", "RLRR")


def _ec3_departs(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    found = Counter(data.learned(TWO, "EC3").hands)
    away = sum(count for hands, count in found.items() if hands not in best)
    text = (
        f"{tally(found)}; best of the corrective process alone {' and '.join(best)} "
        f"({reward:.0f}): {away} of {found.total()} runs depart from it"
    )
    if away:
        return Finding(True, text)
    if len(best) > 1:
        return Finding(None, f"{text}. With a tie, to choose among the best is no departure")
    return Finding(False, text)


def _rlrr_better(data: Data) -> Finding:
    return better_hands(data, TWO, "EC3", "RLRR", "RRRR")


def _ec4_mixed(data: Data) -> Finding:
    found = Counter(data.learned(TWO, "EC4").hands)
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs")


_EC3 = "Results, Exploration Condition 3"

TWO_ARMED_2: tuple[Claim, ...] = (
    Claim(
        "best-is-rrrr",
        "In two-armed task 2, the corrective process alone does best with RRRR.",
        "Two-armed tasks",
        "exact: rewards of all hand sequences; a tie leaves it open",
        _best_is_rrrr,
        _EC3,
        "The best initial solution used the right hand for each of",
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "half-choose-rlrr",
        "In two-armed task 2, about half the runs under condition 3 choose RLRR, not RRRR (9 of "
        "20).",
        "Two-armed tasks",
        f"{AS_OFTEN}; of RLRR",
        _half_choose_rlrr,
        _EC3,
        "in about half the runs of two-armed task 2",
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "ec3-departs",
        "In two-armed task 2, condition 3 finds other hands than those that are best with the "
        "corrective process alone.",
        "Two-armed tasks",
        "exact: runs with a hand sequence that is not among the best of the corrective process",
        _ec3_departs,
        _EC3,
        "produced a different hand recruitment sequence than that of the best",
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "rlrr-better",
        "In two-armed task 2, runs under condition 3 that learn RLRR get more than those that "
        "learn RRRR.",
        "Two-armed tasks",
        "one-tailed bootstrap test of two samples",
        _rlrr_better,
        _EC3,
        "The difference in reward is small but significant",
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "ec4-mixed",
        "In two-armed task 2, runs under condition 4 differ in the hands that they find.",
        "Two-armed tasks",
        "exact: more than one hand sequence",
        _ec4_mixed,
        "Results, Summary of Two-Armed Task Results",
        "(mixed)",
        "Figure 8",
        fitted=True,
    ),
)
