"""The paper's claims about two-armed task 2 (exploration conditions 3 and 4)."""

from __future__ import annotations

from collections import Counter

from analysis.claims.data import TWO, Data
from analysis.claims.judges.hands import AS_OFTEN, as_often, better_hands
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.published import published_exhaustive
from analysis.words import tally


@decides("best-is-rrrr", "exact: rewards of all hand sequences; a tie leaves it open")
def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    shown = f"{' and '.join(best)} {reward:.0f} (published {printed[0]} {printed[1]})"
    text = f"best of the corrective process alone: {shown}"
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text}: a tie")


@decides("half-choose-rlrr", f"{AS_OFTEN}; of RLRR")
def _half_choose_rlrr(data: Data) -> Finding:
    return as_often(data, TWO, "EC3", "RLRR")


@decides(
    "ec3-departs",
    "exact: runs with a hand sequence that is not among the best of the corrective process",
)
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


@decides("rlrr-better", "one-tailed bootstrap test of two samples")
def _rlrr_better(data: Data) -> Finding:
    return better_hands(data, TWO, "EC3", "RLRR", "RRRR")


@decides("ec4-mixed", "exact: more than one hand sequence")
def _ec4_mixed(data: Data) -> Finding:
    found = Counter(data.learned(TWO, "EC4").hands)
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs")
