"""Judge the claims of a study, with p-values adjusted over all claims.

A claim says that a mean over tasks lies beyond a bound (:func:`mean_beyond`), or that each of
several means does (:func:`all_of`). :func:`judge` adjusts the p-values of all claims of a study
together, by Holm's method. Two rules make verdicts stricter:

- Each test is made a second time without the task that favours the claim most. A claim with tests
  is supported only if they are significant both times.
- If the values over tasks are very skewed, the level of significance is 1 % instead of 5 %
  (:func:`level_of`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import stats

from coartic import CoarticError
from coartic.analysis import interval, mean
from coartic.analysis.statistics import bootstrap_test, holm
from coartic.analysis.words import p_value
from coartic.estimates import LEVEL, MIN_TASKS, MIN_VALUES, Estimate

RESAMPLES_OF_CLAIMS = 99_999
"""Number of bootstrap samples of a test over tasks. The number is large, because p-values are
adjusted over many claims."""
STRICT_LEVEL = 0.01
"""Level of significance of a test whose values over tasks are very skewed."""
MAX_SKEWNESS = 2.0
"""Largest absolute skewness of values over tasks for which the level of significance is 5 %."""
SIGNS = {"greater": 1.0, "less": -1.0}
Verdict = Literal["supported", "not supported", "undecided"]
Side = Literal["greater", "less"]


def level_of(values: ArrayLike) -> float:
    """Return the level of significance for a test of a mean over tasks.

    The level is 5 %, or 1 % for skewed values. A bootstrap test of a mean rejects a true null
    hypothesis too often if the values are very skewed (``docs/statistics.md``).

    Parameters
    ----------
    values : array_like, shape (tasks,)
        One value for each task.

    Returns
    -------
    float
        0.01 if the absolute skewness of the values exceeds 2, otherwise 0.05. A test is significant
        if its adjusted p-value is below this level.

    Examples
    --------
    >>> level_of([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]), level_of([0.0] * 9 + [5.0])
    (0.05, 0.01)
    """
    sample = np.asarray(values, dtype=np.float64)
    skewed = np.ptp(sample) > 0 and abs(stats.skew(sample)) > MAX_SKEWNESS
    return STRICT_LEVEL if skewed else LEVEL


@dataclass(frozen=True)
class Finding:
    """Evidence and tests of one claim.

    The p-values of the tests in :attr:`tests`, :attr:`against` and :attr:`without` are not adjusted
    for multiple tests; :func:`judge` adjusts them.
    """

    holds: bool | None
    """True if all means lie where the claim says, otherwise False; None if there are too few tasks
    to judge the claim."""
    evidence: str
    """Sentence with the means and their intervals, or with the reason why the claim cannot be
    judged."""
    tests: tuple[Estimate, ...] = ()
    """Tests of the claim. All of them must be significant. A positive estimate means that the mean
    lies where the claim says."""
    against: tuple[Estimate, ...] = ()
    """Tests of the opposite of the claim. A claim that does not hold is refuted if the adjusted
    p-value of one of these tests is below ``level``."""
    without: tuple[Estimate, ...] = ()
    """The tests in :attr:`tests`, each made again without the task that favours the claim most."""
    level: float = LEVEL
    """Level of significance of the tests: the smallest level that :func:`level_of` gives for any of
    the tested samples."""

    @property
    def opposite_p(self) -> float:
        """Bonferroni-adjusted p-value of the opposite of the claim.

        It is the smallest p-value of the tests in ``against``, multiplied by the number of these
        tests that have a p-value, but at most 1. It is NaN if no test has a p-value.
        """
        tested = [test.p for test in self.against if not math.isnan(test.p)]
        return min(1.0, min(tested) * len(tested)) if tested else math.nan

    def verdict(self, p: float, opposite_p: float) -> Verdict:
        """Return the verdict on the claim.

        - *supported*: the claim holds, and ``p`` is below ``level`` or, because the claim has no
          tests, is NaN.
        - *not supported*: the claim does not hold, and one of these is true: ``opposite_p`` is
          below ``level``; the claim has no tests; a test of at least five values has no p-value,
          because all values are equal to the bound.
        - *undecided*: any other claim, for example one that holds and has a test of fewer than five
          values without a p-value.

        Parameters
        ----------
        p : float
            Adjusted p-value of the claim; NaN if there is none.
        opposite_p : float
            Adjusted p-value of the opposite of the claim; NaN if there is none.
        """
        untested = any(math.isnan(test.p) and min(test.n) < MIN_VALUES for test in self.tests)
        if self.holds is None or (self.holds and untested):
            return "undecided"
        if self.holds:
            # NaN: counted exactly, or no spread in any sample.
            return "undecided" if p >= self.level else "supported"
        certain = not self.tests or any(
            test.value <= 0 and math.isnan(test.p) and min(test.n) >= MIN_VALUES
            for test in self.tests
        )
        return "not supported" if certain or opposite_p < self.level else "undecided"


def _largest_p(tests: Iterable[Estimate]) -> float:
    """Return the largest p-value of tests; NaN if none of them has a p-value."""
    return max((test.p for test in tests if not math.isnan(test.p)), default=math.nan)


def tests_over_tasks(values: ArrayLike, bound: float) -> tuple[Estimate, Estimate]:
    """Test whether the mean over tasks exceeds a bound, with and without the largest value.

    ``values`` contains one value for each of at least two tasks, shape ``(tasks,)``. The first test
    uses all values, and the second test leaves out the largest value. A p-value is NaN for a test
    of a single value, or of values that are all equal to the bound. For the opposite, pass both
    arguments with the other sign.
    """
    by_task = np.asarray(values, dtype=np.float64)
    others = np.delete(by_task, by_task.argmax())
    return (
        bootstrap_test(by_task, bound, resamples=RESAMPLES_OF_CLAIMS),
        bootstrap_test(others, bound, resamples=RESAMPLES_OF_CLAIMS),
    )


def mean_beyond(
    sentence: str, values: ArrayLike, bound: float = 0.0, side: Side = "greater"
) -> Finding:
    """Test whether a mean over tasks lies beyond a bound, by a one-sided bootstrap test.

    Parameters
    ----------
    sentence : str
        Beginning of the evidence, with exactly one ``{}``, which is replaced by the mean with its
        interval. Other braces are kept.
    values : array_like, shape (tasks,)
        One value for each task. NaN stands for a task without a value, which is left out.
    bound : float
        The bound, in the unit of the values.
    side : {"greater", "less"}
        Side on which the mean is claimed to lie: above or below the bound.

    Returns
    -------
    Finding
        - ``holds`` is True if the mean lies on the claimed side. It is None, and there are no
          tests, if there are values for fewer than three tasks.
        - ``tests`` contains the test of the claim.
        - ``without`` contains the same test without the task that favours the claim most.
        - ``against`` contains one test of the opposite of the claim. This test is made with all
          tasks and without the task that favours the opposite most; the one with the larger p-value
          is returned.
        - ``level`` is the level that :func:`level_of` gives for the values.

    Raises
    ------
    CoarticError
        ``side`` is unknown, ``values`` is not one-dimensional, or ``sentence`` does not have
        exactly one ``{}``.
    ValueError
        A value is not a number, or there are values for at least three tasks and one of them or the
        bound is not finite.

    Examples
    --------
    >>> finding = mean_beyond("Planning saves {} ticks", [4.0, 5.0, 6.0, 7.0], 1.0)
    >>> finding.holds, finding.evidence
    (True, 'Planning saves 5.50 ticks (4 tasks)')
    """
    if sentence.count("{}") != 1:
        raise CoarticError(
            f"sentence {sentence!r} has {sentence.count('{}')} {{}}; it must have exactly one, for "
            "the mean"
        )
    if side not in SIGNS:
        raise CoarticError(f"side is {side!r}; it must be 'greater' or 'less'")
    found = np.asarray(values, dtype=np.float64)
    if found.ndim != 1:
        raise CoarticError(
            f"values has shape {found.shape}; it must be (tasks,), with one value for each task"
        )
    found = found[~np.isnan(found)]
    if len(found) < MIN_TASKS:
        return Finding(None, f"fewer than {MIN_TASKS} random tasks can be judged")
    sign = SIGNS[side]
    test, without = tests_over_tasks(sign * found, sign * bound)
    opposite = max(tests_over_tasks(-sign * found, -sign * bound), key=lambda test: test.p)
    words = interval(mean(found).columns("mean"), "mean", 2)
    evidence = f"{sentence.replace('{}', words)} ({len(found)} tasks)"
    return Finding(test.value > 0, evidence, (test,), (opposite,), (without,), level_of(found))


def all_of(*findings: Finding) -> Finding:
    """Join several findings into the finding on a claim that needs all of them.

    Parameters
    ----------
    *findings : Finding
        Findings of :func:`mean_beyond`, at least one.

    Returns
    -------
    Finding
        A finding that holds if all findings hold. It has the tests of all findings, their evidence
        joined by semicolons, and the smallest of their levels. If ``holds`` of a finding is None
        (too few tasks), the first such finding is returned instead.

    Raises
    ------
    CoarticError
        There are no findings.

    Examples
    --------
    >>> few = mean_beyond("one {}", [1.0])
    >>> all_of(mean_beyond("two {}", [1.0, 2.0, 3.0]), few).evidence
    'fewer than 3 random tasks can be judged'
    """
    if not findings:
        raise CoarticError("findings is empty; all_of needs at least one finding")
    for finding in findings:
        if finding.holds is None:
            return finding
    return Finding(
        all(finding.holds for finding in findings),
        "; ".join(finding.evidence for finding in findings),
        tuple(test for finding in findings for test in finding.tests),
        tuple(test for finding in findings for test in finding.against),
        tuple(test for finding in findings for test in finding.without),
        min(finding.level for finding in findings),
    )


def judge(claims: Mapping[str, tuple[str, str, Finding]]) -> pd.DataFrame:
    """Judge the claims of a study, with p-values that are Holm-adjusted over all claims.

    Parameters
    ----------
    claims : mapping of str to (str, str, Finding)
        Dict that maps the id of each claim to a tuple: its statement, a description of its test,
        and its finding. P-values are adjusted for the number of all claims, including claims
        without a p-value.

    Returns
    -------
    DataFrame
        A row for each claim, indexed by its id, with the columns ``statement``, ``verdict``,
        ``evidence``, ``test`` and three adjusted p-values, which are NaN for a claim without them:

        - ``p_holm``: p-value of the claim;
        - ``p_without``: p-value of the claim with all tasks, or without the task that favours the
          claim most, whichever is larger;
        - ``opposite_p_holm``: p-value of the opposite of the claim.

        The verdict is decided by ``p_without`` and ``opposite_p_holm`` (:meth:`Finding.verdict`).

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
        if adjusted[0] < finding.level <= adjusted[1]:
            evidence += f"; without the task that speaks most for it {p_value(adjusted[1])}"
        rows[name] = {
            "statement": statement,
            "verdict": finding.verdict(*adjusted[1:]),
            "evidence": f"{evidence[:1].upper()}{evidence[1:]}.",
            "test": test,
            "p_holm": adjusted[0],
            "p_without": adjusted[1],
            "opposite_p_holm": adjusted[2] if finding.tests else math.nan,
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("claim")
