"""Findings and verdicts: evidence and tests of each claim, corrected over all claims of a study.

A claim needs one mean over tasks, or several, beyond a bound (:func:`mean_beyond`, joined by
:func:`all_of`). :func:`judge` corrects the claims of a study over each other (Holm). A claim that
holds is undecided if its tests come out otherwise without the task that favours it most.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.words import capital, interval, p_value
from coartic.errors import CoarticError
from coartic.estimates import FEWEST, LEVEL, Estimate, mean
from coartic.internal.arguments import Numbers, checked_arguments
from coartic.internal.limits import brief_value
from coartic.internal.text import counted

RESAMPLES_OF_CLAIMS = 99_999
"""Resamples of a test over tasks, whose p-value is corrected over many claims."""
Verdict = Literal["supported", "not supported", "undecided", "depends on the goals"]
Side = Literal["greater", "less"]


@dataclass(frozen=True)
class Finding:
    """Evidence and tests of one claim, before any correction."""

    holds: bool | None
    """True if the runs show the claim; None if the runs are too few."""
    evidence: str
    """Sentence with the means and their intervals, or why the claim cannot be judged."""
    tests: tuple[Estimate, ...] = ()
    """Tests of the claim, which all have to hold; a positive estimate is as claimed."""
    against: tuple[Estimate, ...] = ()
    """Tests of the opposite of the claim; p below 5 % of any test, after correction, refutes a
    claim that does not hold."""
    without: tuple[Estimate, ...] = ()
    """Tests of the claim over tasks, each without the task that favours the claim most."""

    def __str__(self) -> str:
        """Return a sentence: what the runs show, the largest p of ``tests``, and the evidence."""
        shown = {True: "The runs show it", False: "The runs do not show it", None: "Too few runs"}
        p = p_value(_largest_p(self.tests))
        return f"{shown[self.holds]}{f' ({p})' * bool(p)}: {self.evidence.rstrip('.')}."

    @property
    def opposite_p(self) -> float:
        """Smallest p-value in ``against``, times the number of p-values there (Bonferroni), 1 at
        most; NaN without a p-value."""
        tested = [test.p for test in self.against if not math.isnan(test.p)]
        return min(1.0, min(tested) * len(tested)) if tested else math.nan

    def verdict(self, p: float, opposite_p: float) -> Verdict:
        """Return ``supported``, ``not supported`` or ``undecided`` by p-values of the claim and of
        its opposite, corrected or not.

        A claim that holds is supported if ``p`` is below 5 %, or NaN: counted exactly. A claim
        that does not hold is not supported if ``opposite_p`` is below 5 %, if the claim has no
        test, or if a test of three values or more (in each sample) has no p and no positive
        estimate: all values equal the bound or each other. Other claims are undecided, and so is a
        claim that holds by a test of fewer than three values without p."""
        untested = any(math.isnan(test.p) and min(test.n) < FEWEST for test in self.tests)
        if self.holds is None or (self.holds and untested):
            return "undecided"
        if self.holds:
            # NaN: counted exactly, or no spread in any sample.
            return "undecided" if p >= LEVEL else "supported"
        certain = not self.tests or any(
            test.value <= 0 and math.isnan(test.p) and min(test.n) >= FEWEST for test in self.tests
        )
        return "not supported" if certain or opposite_p < LEVEL else "undecided"


def _largest_p(tests: Iterable[Estimate]) -> float:
    """Return the largest p-value of tests that must all hold; NaN without a p-value."""
    return max((test.p for test in tests if not math.isnan(test.p)), default=math.nan)


def _tests_over_tasks(values: Numbers, bound: float) -> tuple[Estimate, Estimate]:
    """Return two one-tailed bootstrap tests that the mean of values, one for each task, exceeds a
    bound: with all values, and without the largest value. Two values are needed at least; p is NaN
    for a test of a single value."""
    every = np.asarray(values, dtype=np.float64)
    return (
        bootstrap_test(every, bound, resamples=RESAMPLES_OF_CLAIMS),
        bootstrap_test(np.delete(every, every.argmax()), bound, resamples=RESAMPLES_OF_CLAIMS),
    )


@checked_arguments
def mean_beyond(
    sentence: str, values: Numbers, bound: float = 0.0, side: Side = "greater"
) -> Finding:
    """Test whether the mean over tasks lies beyond a bound, by a one-tailed bootstrap test.

    Parameters
    ----------
    sentence : str
        Sentence of the evidence, with one ``{}`` in the place of the mean and its interval; other
        braces are text.
    values : array_like, shape (tasks,)
        A value for each task; NaN, which does not count, for a task without a value.
    bound : float
        In the unit of the values.
    side : {"greater", "less"}
        Side of the bound on which the mean is claimed to lie.

    Returns
    -------
    Finding
        ``holds``: the mean lies on this side; None, without a test, with fewer than three tasks.
        ``evidence``: the sentence, or that tasks are too few. ``tests`` has a test of the claim;
        ``without`` a test of the claim without the task that favours it most; ``against`` a test of
        the opposite, with all tasks or without the task that favours the opposite most, whichever
        has the larger p.

    Raises
    ------
    CoarticError
        For another side or shape, and for a sentence that has not one ``{}``.
    ValueError
        There are three values or more, and one of them or the bound is not finite.

    Examples
    --------
    >>> finding = mean_beyond("Planning saves {} ticks", [4.0, 5.0, 6.0, 7.0], 1.0)
    >>> finding.holds, finding.evidence
    (True, 'Planning saves 5.50 [4.50, 6.50] ticks (4 tasks)')
    """
    if sentence.count("{}") != 1:
        raise CoarticError(f"the sentence {brief_value(sentence)} needs one {{}}, for the mean")
    there = np.asarray(values)
    if there.ndim != 1:
        raise CoarticError(f"values have shape {there.shape}; needed is a value for each task")
    there = there[~np.isnan(there)]
    if len(there) < FEWEST:
        return Finding(None, f"fewer than {FEWEST} random tasks can be judged")
    sign = 1.0 if side == "greater" else -1.0
    test, without = _tests_over_tasks(sign * there, sign * bound)
    opposite = max(_tests_over_tasks(-sign * there, -sign * bound), key=lambda test: test.p)
    found = interval(mean(there).columns("mean"), "mean", 2)
    evidence = f"{sentence.replace('{}', found)} ({counted(len(there), 'task')})"
    return Finding(test.value > 0, evidence, (test,), (opposite,), (without,))


@checked_arguments
def all_of(*findings: Finding) -> Finding:
    """Join findings that a claim needs together.

    Parameters
    ----------
    *findings : Finding
        Findings of :func:`mean_beyond`.

    Returns
    -------
    Finding
        Finding that holds if all findings hold, with ``tests``, ``against`` and ``without`` of all;
        or the first finding with too few runs (``holds`` is None).

    Raises
    ------
    CoarticError
        Without findings.

    Examples
    --------
    >>> few = mean_beyond("one {}", [1.0])
    >>> all_of(mean_beyond("two {}", [1.0, 2.0, 3.0]), few).evidence
    'fewer than 3 random tasks can be judged'
    """
    if not findings:
        raise CoarticError("all_of needs one finding at least: a claim cannot rest on nothing")
    for finding in findings:
        if finding.holds is None:
            return finding
    return Finding(
        all(finding.holds for finding in findings),
        "; ".join(finding.evidence for finding in findings),
        tuple(test for finding in findings for test in finding.tests),
        tuple(test for finding in findings for test in finding.against),
        tuple(test for finding in findings for test in finding.without),
    )


@checked_arguments
def judge(claims: Mapping[str, tuple[str, str, Finding]]) -> pd.DataFrame:
    """Judge the claims of a study, with their tests corrected over each other (Holm).

    Parameters
    ----------
    claims : mapping of str to (str, str, Finding)
        Statement, test in words and finding of each claim, by the claim's id. A claim without a
        p-value counts in the correction all the same.

    Returns
    -------
    DataFrame
        A row for each claim, by its id: ``statement``, ``verdict`` (``supported``, ``not
        supported`` or ``undecided``), ``evidence``, ``test`` and corrected p-values: ``p_holm`` of
        the claim, ``p_without`` of the claim with all tasks and without the task that favours it
        most (the larger p), and ``opposite_p_holm`` of its opposite; NaN without a test. The
        verdict is :meth:`Finding.verdict` of the last two p-values.

    Examples
    --------
    >>> seen = mean_beyond("It saves {} ticks", [4.0, 5.0, 6.0, 7.0, 5.0, 6.0])
    >>> judge({"saves": ("Planning saves ticks.", "bootstrap test", seen)}).verdict.to_dict()
    {'saves': 'supported'}
    """
    findings = [finding for _, _, finding in claims.values()]
    p = holm([_largest_p(finding.tests) for finding in findings], len(findings))
    without = holm(
        [_largest_p(finding.tests + finding.without) for finding in findings], len(findings)
    )
    opposite = holm([finding.opposite_p for finding in findings], len(findings))
    rows = {}
    for (name, (statement, test, finding)), *adjusted in zip(
        claims.items(), p, without, opposite, strict=True
    ):
        evidence = (
            finding.evidence if finding.holds is not None else f"Not judged: {finding.evidence}"
        )
        if adjusted[0] < LEVEL <= adjusted[1]:
            evidence += f"; without the task that speaks most for it {p_value(adjusted[1])}"
        rows[name] = {
            "statement": statement,
            "verdict": finding.verdict(*adjusted[1:]),
            "evidence": f"{capital(evidence)}.",
            "test": test,
            "p_holm": adjusted[0],
            "p_without": adjusted[1],
            "opposite_p_holm": adjusted[2] if finding.tests else math.nan,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("claim")


@checked_arguments
def judge_means(words: str | Path, values: Mapping[str, Any]) -> pd.DataFrame:
    """Judge claims whose words and bounds are in a file, as :func:`judge` does.

    Parameters
    ----------
    words : str or pathlib.Path
        TOML file with a table for each claim, by its id: ``text``, the claim, ``test`` in words,
        and ``means``, a list of tables with a ``sentence`` and one bound: the mean is claimed to
        lie ``above`` it, ``below`` it (:func:`mean_beyond`), or ``within`` plus and minus it.
    values : mapping
        By the ids of claims, a list with an entry for each of their means: a value for each task,
        or a mapping of groups of tasks to such values, when the mean of each group has to lie so;
        a sentence can have the group as ``{group}``.

    Returns
    -------
    DataFrame
        The table of :func:`judge`, with the claims that have values, in their order.

    Raises
    ------
    CoarticError
        The file lacks a claim, a claim lacks an entry, or it has more or fewer means than values.

    Examples
    --------
    The claim of a file ``claims.toml``, and its verdict::

        [saves]
        text = "Planning saves ticks."
        test = "one-tailed bootstrap test over tasks: more than one tick"
        means = [{ sentence = "Planning saves {} ticks", above = 1.0 }]

        judge_means("claims.toml", {"saves": [[4.0, 5.0, 6.0, 7.0, 5.0, 6.0]]}).verdict
    """
    claims, of_file = {}, tomllib.loads(Path(words).read_text("utf-8"))
    for name, means in values.items():
        if name not in of_file:
            raise CoarticError(f"{words} has no claim {brief_value(name)}")
        claim = of_file[name]
        if missing := [key for key in ("text", "test", "means") if key not in claim]:
            raise CoarticError(f"{words}: claim {name} has no {missing[0]}")
        every = [of if isinstance(of, Mapping) else {"": of} for of in means]
        if len(claim["means"]) != len(every):
            has = counted(len(claim["means"]), "mean")
            raise CoarticError(
                f"{words}: claim {name} has {has}, but values of {len(every)} are given"
            )
        asked = [*zip(claim["means"], every, strict=True)]
        groups = dict.fromkeys(group for of in every for group in of)
        finding = all_of(*(
            _mean_as_asked(mean, group, of[group])
            for group in groups for mean, of in asked if group in of
        ))  # fmt: skip
        claims[name] = (claim["text"], claim["test"], finding)
    return judge(claims)


def _mean_as_asked(asked: Mapping[str, Any], group: str, values: Any) -> Finding:
    """Return the finding on the values of a group, as a file asks (:func:`judge_means`)."""
    sentence = asked["sentence"].replace("{group}", group)
    if "within" in asked:
        above = mean_beyond(sentence, values, -asked["within"])
        below = mean_beyond(sentence, values, asked["within"], "less")
        return replace(all_of(above, below), evidence=above.evidence)
    if "above" in asked:
        return mean_beyond(sentence, values, asked["above"])
    return mean_beyond(sentence, values, asked["below"], "less")
