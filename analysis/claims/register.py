"""What a claim is, and the rules of its verdict (:data:`RULES`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from coartic.analysis.claims.data import Data
from coartic.analysis.claims.reconstructions import held_by
from coartic.analysis.report.document import DataTable, RestsOn
from coartic.analysis.statistics.estimates import LEVEL, RESAMPLES, Inference
from coartic.robot import Array

Verdict = Literal["supported", "not supported", "cannot tell", "measured"]
Section = Literal[
    "One-armed tasks", "Two-armed tasks", "General", "Families of tasks", "Beyond the paper"
]
Correction = Literal["paper", "beside", "families"]
"""Which claims are corrected together: on the paper's cells, with runs beside them, on families of
random tasks."""
Rule = Literal["higher", "most", "few", "about", "differ", "tested", "counted", "measured"]
"""How a claim is decided; ``claims.toml`` says what each is."""

RULES = (
    "*Supported*: what the claim says is seen, and the largest p-value of the tests it rests on "
    "(they must all hold: an intersection-union test) stays below 5 % after Holm's correction. "
    "*Not supported*: it is not seen, and the contrary of one of its tests is significant (the "
    "smallest p-value of the contrary times their number, below 5 % after Holm's correction). "
    "What is counted exactly, or shows no spread over runs, needs no test and is supported or "
    "not as it is. *Cannot tell*: neither, or the folder lacks the runs. What the goals of the "
    "two-armed tasks were chosen to give is *measured* where it is so: no support. Each of the "
    "three corrections is over a family that the register fixes: its claims with a test on the "
    "paper's own seven cells, those that take other runs beside them, or those on families of "
    "random tasks, whose tests are over instances. The contraries are corrected by themselves: "
    "that some claim of a family is wrongly supported has a chance of 5 % at most, that some is "
    "wrongly not supported another. A claim that a folder "
    "cannot test counts in its family all the same, with a p-value of 1, so that what is decided "
    "stays decided whatever is run beside. Where no rule could come out both ways, and where the "
    "paper compares nothing, things are *measured*, without a verdict."
)
"""How verdicts are reached, in inline markup."""
FITTED = (
    "† rests on the two-armed tasks, whose goals are not printed. The default ones give "
    "what is printed of the corrective process alone, and were chosen because learned rewards and "
    "hand sequences come near to the printed ones: no independent test. Beside it, in how many of "
    "the admissible sets of goals that are kept the claim holds, by uncorrected tests with 20 "
    "runs (docs/reconstruction.md)."
)
"""What the mark of a fitted claim means."""
CHOSEN = (
    "On the one-armed tasks the arrival threshold, the tick that detects arrival, the height of "
    "the shoulders and the best noisy trial as the learned reward were chosen because the numbers "
    "printed there (−303, −314; −319 and −333, which follow from them and the printed gains) come "
    "out so (docs/model.md). Claims on these tasks are independent tests of what they say, not of "
    "those numbers."
)
"""What independent claims do not test."""


@dataclass(frozen=True)
class Finding:
    """What was seen of one claim, before any correction of its tests."""

    holds: bool | None
    """Whether what the claim says is seen; None where nothing is judged."""
    evidence: str
    tests: tuple[Inference, ...] = ()
    """Tests that it rests on, turned so that a positive estimate is as claimed."""
    against: tuple[Inference, ...] | None = None
    """Tests of the contrary, any of which refutes it; None: the other tails of ``tests``."""
    samples: tuple[Array, ...] = ()
    """What the tests are of, where they are of instances: their values (n,) less their bound."""
    table: DataTable | None = None
    """Numbers that are more than a sentence can hold; its id is ``evidence-`` and the claim's."""


@dataclass(frozen=True)
class Claim:
    """One statement and how it is decided."""

    id: str
    statement: str
    section: Section
    rule: Rule
    test: str
    """In inline markup."""
    judge: Callable[[Data], Finding]
    beside: bool = False
    """Whether it takes runs beside the paper's cells."""
    pairs: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Comparisons by task, of the rule that names them."""
    families: Sequence[str] = ()
    """Families of random tasks that it is about, with their versions."""
    compared: Sequence[str] = ()
    """Comparisons on each of their instances."""
    unit: str = ""
    """Of what its tests of instances are of."""
    runs: Mapping[str, str] = field(default_factory=dict)
    """Condition and hands by task, of a rule that counts runs."""
    place: str = ""
    """Section of the paper that makes it; empty for comparisons of our own."""
    quote: str = ""
    """A few words of the paper by which the place can be found."""
    figure: str = ""
    """Figure of the paper that shows it, where one does."""
    fitted: bool = False
    """Whether it rests on a task whose goals were chosen for results like it."""
    selected: bool = False
    """Whether goals were admitted by it."""

    @property
    def reconstructions(self) -> str:
        """In how many admissible sets of goals it holds, in words; empty where it is not one
        of their runs that it rests on."""
        return "; ".join(map(str, held_by(self.id))) if self.fitted else ""

    @property
    def correction(self) -> Correction:
        """Which claims it is corrected with."""
        if self.families:
            return "families"
        return "beside" if self.beside else "paper"

    @property
    def tested(self) -> bool:
        """Whether its rule gives p-values, so that it is one of its family."""
        return self.rule not in ("counted", "measured")


@dataclass(frozen=True, kw_only=True)
class Judged(Finding):
    """A claim with what was seen of it, and its verdict."""

    claim: Claim
    run_ids: tuple[str, ...] = ()
    others: Mapping[str, RestsOn] = field(default_factory=dict)
    """What it rests on beside runs, in words, and of which kind that is."""
    adjusted_p: float = math.nan
    """:attr:`p`, adjusted over its family (Holm)."""
    adjusted_contrary_p: float = math.nan
    power: float = math.nan
    """Chance of *supported* with so many runs if the paper's numbers are exactly right;
    NaN where it prints none."""
    contrary_power: float = math.nan
    """Chance of *not supported* if the contrary holds: :mod:`coartic.analysis.claims.power`."""
    visible: float = math.nan
    """True effect in every family with which so many instances support it with power 80 %."""

    @property
    def sources(self) -> tuple[str, ...]:
        """What it rests on beside runs, in words."""
        return tuple(self.others)

    @property
    def origin(self) -> Mapping[str, tuple[RestsOn, ...]]:
        """What verdict and evidence rest on where no runs are behind them."""
        if self.run_ids:
            return {}
        kinds = tuple(dict.fromkeys(self.others.values())) or ("text",)
        return dict.fromkeys(("verdict", "evidence"), kinds)

    @property
    def p(self) -> float:
        """Largest of its tests, which must all hold; NaN where nothing is tested or judged."""
        known = [t.p for t in self.tests if not math.isnan(t.p)]
        return max(known) if known and self.claim.tested else math.nan

    @property
    def contrary_p(self) -> float:
        """Smallest p-value of the contrary, times the number of tests (Bonferroni)."""
        p = [
            t.p if self.against is not None else min(1.0, 1 - t.p + 1 / (RESAMPLES + 1))
            for t in (self.tests if self.against is None else self.against)
            if not math.isnan(t.p)
        ]
        return min(1.0, min(p) * len(p)) if p and self.claim.tested else math.nan

    @property
    def verdict(self) -> Verdict:
        """By :data:`RULES`."""
        if not self.run_ids and not self.sources:
            return "cannot tell"
        if self.claim.rule == "measured":
            return "measured"
        if self.holds is None:
            return "cannot tell"
        if self.holds and self.claim.selected:
            return "measured"
        if self.holds:
            # NaN: counted exactly, or no spread in any sample.
            return "cannot tell" if self.adjusted_p >= LEVEL else "supported"
        certain = not self.tests or any(
            t.estimate <= 0 and math.isnan(t.p) and min(t.n) > 1 for t in self.tests
        )
        refuted = certain or self.adjusted_contrary_p < LEVEL
        return "not supported" if refuted else "cannot tell"

    @property
    def methods(self) -> tuple[str, ...]:
        """Its tests, in words."""
        every = *self.tests, *(self.against or ())
        untested = (f" ({t.note})" if math.isnan(t.p) and t.note else "" for t in every)
        return tuple(dict.fromkeys(t.method + why for t, why in zip(every, untested, strict=True)))

    @property
    def marked(self) -> str:
        """The verdict, with † where the claim is fitted."""
        return self.verdict + (" †" if self.claim.fitted else "")
