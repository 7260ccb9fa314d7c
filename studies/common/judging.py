"""Judge the claims of a study by tests that are corrected over all its claims.

A claim says that a mean over tasks, or each of several means, lies beyond a bound
(:func:`mean_beyond`, joined by :func:`all_of`). :func:`judge` corrects the tests of all claims of a
study together (Holm). A claim that holds stays undecided if its tests are not significant without
the task that favours it most. If values over tasks are very skewed, p must be below 1 %
(:func:`level_of`).
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
from numpy.typing import ArrayLike
from scipy import stats

from coartic import CoarticError
from coartic.analysis import interval, mean
from coartic.analysis.statistics import bootstrap_test, holm
from coartic.analysis.words import p_value
from coartic.estimates import FEWEST, FEWEST_TASKS, LEVEL, Estimate

RESAMPLES_OF_CLAIMS = 99_999
"""Resamples of a test over tasks, whose p-value is corrected over many claims."""
STRICT_LEVEL = 0.01
"""Level of a test whose values over tasks are very skewed."""
MAX_SKEWNESS = 2.0
"""Largest absolute skewness of values over tasks at which the level of their test is 5 %."""
SIGNS = {"greater": 1.0, "less": -1.0}
Verdict = Literal["supported", "not supported", "undecided"]
Side = Literal["greater", "less"]


def level_of(values: ArrayLike) -> float:
    """Return the level at which a test of the mean of values over tasks counts as significant.

    A bootstrap test of a mean rejects a true hypothesis too often if values are very skewed
    (``docs/statistics.md``).

    Parameters
    ----------
    values : array_like, shape (tasks,)
        One value for each task.

    Returns
    -------
    float
        0.01 if the absolute skewness of the values exceeds 2, otherwise 0.05. It is compared with
        p after correction.

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
    """Evidence and tests of one claim, before correction for multiple tests."""

    holds: bool | None
    """True if the runs show the claim; None if the runs are too few."""
    evidence: str
    """Sentence with the means and their intervals, or why the claim cannot be judged."""
    tests: tuple[Estimate, ...] = ()
    """Tests of the claim, which must all hold. A positive estimate is as claimed."""
    against: tuple[Estimate, ...] = ()
    """Tests of the opposite of the claim. A claim that does not hold is refuted if one of them has
    p below the ``level`` after correction."""
    without: tuple[Estimate, ...] = ()
    """Tests of the claim over tasks, each without the task that favours the claim most."""
    level: float = LEVEL
    """Level of the tests: the smallest :func:`level_of` of the values that they test."""

    @property
    def opposite_p(self) -> float:
        """Return the smallest p-value in ``against``, corrected by Bonferroni; NaN without one."""
        tested = [test.p for test in self.against if not math.isnan(test.p)]
        return min(1.0, min(tested) * len(tested)) if tested else math.nan

    def verdict(self, p: float, opposite_p: float) -> Verdict:
        """Return the verdict for p-values of the claim and of its opposite.

        - *supported*: the claim holds, and ``p`` is below the ``level`` or NaN. (It is NaN if the
          claim was counted exactly.)
        - *not supported*: the claim does not hold, and ``opposite_p`` is below the ``level``. The
          verdict is also *not supported* if the claim has no test, or if a test of five or more
          values has no p and no positive estimate, because all values are equal.
        - *undecided*: any other claim. A claim that holds is also undecided if one of its tests has
          fewer than five values and no p.
        """
        untested = any(math.isnan(test.p) and min(test.n) < FEWEST for test in self.tests)
        if self.holds is None or (self.holds and untested):
            return "undecided"
        if self.holds:
            # NaN: counted exactly, or no spread in any sample.
            return "undecided" if p >= self.level else "supported"
        certain = not self.tests or any(
            test.value <= 0 and math.isnan(test.p) and min(test.n) >= FEWEST for test in self.tests
        )
        return "not supported" if certain or opposite_p < self.level else "undecided"


def _largest_p(tests: Iterable[Estimate]) -> float:
    """Return the largest p-value of tests that must all hold; NaN without a p-value."""
    return max((test.p for test in tests if not math.isnan(test.p)), default=math.nan)


def _tests_over_tasks(values: ArrayLike, bound: float) -> tuple[Estimate, Estimate]:
    """Test that the mean over tasks exceeds a bound, with and without the largest value.

    ``values`` has one value for each task, for at least two tasks. p is NaN for a test of a single
    value.
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
    """Test whether the mean over tasks lies beyond a bound, by a one-tailed bootstrap test.

    Parameters
    ----------
    sentence : str
        Sentence of the evidence, with one ``{}`` for the mean and its interval. Other braces stay
        as they are.
    values : array_like, shape (tasks,)
        One value for each task. NaN stands for a task without a value and does not count.
    bound : float
        The bound, in the unit of the values.
    side : {"greater", "less"}
        Side of the bound on which the mean is claimed to lie.

    Returns
    -------
    Finding
        ``holds`` is True if the mean lies on this side, and None, without a test, if there are
        fewer than three tasks. ``tests`` has the test of the claim, and ``without`` the same test
        without the task that favours the claim most. ``against`` has the test of the opposite:
        with all tasks or without the task that favours the opposite most, whichever has the
        larger p.

    Raises
    ------
    CoarticError
        If ``side`` is unknown, ``values`` is not one-dimensional, or ``sentence`` does not have
        exactly one ``{}``.
    ValueError
        If there are three values or more, and one of them or the bound is not finite.

    Examples
    --------
    >>> finding = mean_beyond("Planning saves {} ticks", [4.0, 5.0, 6.0, 7.0], 1.0)
    >>> finding.holds, finding.evidence
    (True, 'Planning saves 5.50 ticks (4 tasks)')
    """
    if sentence.count("{}") != 1:
        raise CoarticError(f"sentence {sentence!r} must have exactly one {{}}, for the mean")
    if side not in SIGNS:
        raise CoarticError(f"side must be 'greater' or 'less', not {side!r}")
    found = np.asarray(values, dtype=np.float64)
    if found.ndim != 1:
        raise CoarticError(f"values have shape {found.shape}; they need one value for each task")
    found = found[~np.isnan(found)]
    if len(found) < FEWEST_TASKS:
        return Finding(None, f"fewer than {FEWEST_TASKS} random tasks can be judged")
    sign = SIGNS[side]
    test, without = _tests_over_tasks(sign * found, sign * bound)
    opposite = max(_tests_over_tasks(-sign * found, -sign * bound), key=lambda test: test.p)
    words = interval(mean(found).columns("mean"), "mean", 2)
    evidence = f"{sentence.replace('{}', words)} ({len(found)} tasks)"
    return Finding(test.value > 0, evidence, (test,), (opposite,), (without,), level_of(found))


def all_of(*findings: Finding) -> Finding:
    """Join the findings that a claim needs together.

    Parameters
    ----------
    *findings : Finding
        Findings of :func:`mean_beyond`.

    Returns
    -------
    Finding
        A finding that holds if all findings hold, with the tests of all of them. If a finding has
        too few runs (``holds`` is None), the first such finding is returned.

    Raises
    ------
    CoarticError
        If there are no findings.

    Examples
    --------
    >>> few = mean_beyond("one {}", [1.0])
    >>> all_of(mean_beyond("two {}", [1.0, 2.0, 3.0]), few).evidence
    'fewer than 3 random tasks can be judged'
    """
    if not findings:
        raise CoarticError("all_of needs at least one finding")
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
    """Judge the claims of a study, with tests corrected over all claims (Holm).

    Parameters
    ----------
    claims : mapping of str to (str, str, Finding)
        Maps the id of each claim to its statement, its test in words, and its finding. A claim
        without a p-value still counts in the correction.

    Returns
    -------
    DataFrame
        One row for each claim, by its id, with the columns ``statement``, ``verdict``,
        ``evidence``, ``test`` and three corrected p-values (NaN without a test):

        - ``p_holm`` of the claim;
        - ``p_without`` of the claim with all tasks or without the task that favours it most,
          whichever is larger;
        - ``opposite_p_holm`` of the opposite of the claim.

        The verdict is :meth:`Finding.verdict` of the last two.

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


def judge_means(words: str | Path, values: Mapping[str, Any]) -> pd.DataFrame:
    """Judge claims whose words and bounds are in a file, as :func:`judge` does.

    Parameters
    ----------
    words : str or pathlib.Path
        TOML file with a table for each claim, by its id. ``text`` is the claim, ``test`` the test
        in words, and ``means`` a list of tables. Each table has a ``sentence`` and one bound: the
        mean is claimed to lie ``above`` it, ``below`` it, or ``within`` plus and minus it.
    values : mapping
        Maps the id of each claim to a list with one entry for each of its means. An entry has one
        value for each task, or is a dict that maps groups of tasks to such values. With groups the
        mean of each group must lie beyond the bound, and the sentence may contain ``{group}``.

    Returns
    -------
    DataFrame
        The table of :func:`judge`, with the claims of ``values``, in their order.

    Raises
    ------
    CoarticError
        If the file has no such claim, if a claim has no ``text``, ``test`` or ``means``, or if a
        claim has more or fewer means than ``values``.

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
            raise CoarticError(f"{words} has no claim {name!r}")
        claim = of_file[name]
        if missing := [key for key in ("text", "test", "means") if key not in claim]:
            raise CoarticError(f"{words}: claim {name} has no {missing[0]}")
        by_group = [entry if isinstance(entry, Mapping) else {"": entry} for entry in means]
        if len(claim["means"]) != len(by_group):
            raise CoarticError(
                f"{words}: claim {name} has {len(claim['means'])} means, but values has "
                f"{len(by_group)} of them"
            )
        asked = [*zip(claim["means"], by_group, strict=True)]
        groups = dict.fromkeys(group for values_of in by_group for group in values_of)
        finding = all_of(*(
            _mean_as_asked(words_of, group, values_of[group])
            for group in groups for words_of, values_of in asked if group in values_of
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
