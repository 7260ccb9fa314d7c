"""A claim. The paper's are lists in ``paper.py``, ``coarticulation.py`` and ``families.py``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from coartic.analysis.claims.judging import Finding
from coartic.analysis.claims.reader import Reader


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, and how it is judged.

    Runs of the learner are judged with 10,000 trials, and at least three of them. The whole paper,
    sentence by sentence, is accounted for in ``docs/sentences.toml``.
    """

    id: str
    text: str
    place: str
    """Section of the paper that says it, and the figure that shows it, where one does."""
    quote: str
    """A few words of the paper by which the place can be found."""
    test: str
    """The test, in words."""
    judge: Callable[[Reader], Finding]
    group: Literal["paper", "beside", "families", "exact"] = "paper"
    """With which claims it is corrected: with those on the paper's seven cells; those that take
    runs beside them, so that they change no verdict on those cells; those on families of random
    tasks; with none, as it is counted exactly."""
    fitted: bool = False
    """Whether it rests on goals that the paper does not print."""
    sets: str = ""
    """Of such a claim: how many of the sets of goals that the paper's text admits support it
    (docs/reconstruction.md); not of one that chose them, or that takes other runs."""
    depends: bool = False
    """Whether at most half of them do, on some task."""
    short: str = ""
    """In a few words; the three claims that carry the paper's point have it."""
