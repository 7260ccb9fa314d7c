"""Hand recruitment: which hand hits which goal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import pandas as pd
from scipy import stats

from analysis.signatures.subtasks import isolated_reaches, postures_before
from coartic import Trajectory


def entropy(sequences: Iterable[str]) -> float:
    """Shannon entropy of hand sequences over runs, bits.

    The plug-in estimate, biased downwards for few runs. 0 (always the same sequence) to
    log₂ of the number of runs, or G bits for G goals and two hands, whichever is less.
    """
    return float(stats.entropy(list(Counter(sequences).values()), base=2)) + 0.0


def isolated_agreement(path: Trajectory) -> list[bool]:
    """Whether each goal is hit with the hand that would be chosen for it by itself.

    That is the hand with which the corrective process alone reaches it in the fewest ticks
    from the posture before; equally quick ones both agree. False for a goal that it reaches
    with neither. Where False, the choice of hand serves other goals than its own.
    """
    agrees = []
    befores = postures_before(path.execution, path.task)
    for number, (q, hand) in enumerate(zip(befores, path.hands, strict=True), 1):
        alone = isolated_reaches(path.task, q, number)
        agrees.append(bool(alone) and alone.get(hand) == min(alone.values()))
    return agrees


def best_sequences(sequences: pd.DataFrame, task: str) -> list[str]:
    """The hand sequences that are best by the corrective process alone, ties included.

    ``sequences`` is a results folder's table of that name. Empty where none has a reward.
    """
    own = sequences[(sequences.task == task) & sequences.reward.notna()]
    return [str(hands) for hands in own.hands[own.reward == own.reward.max()]]
