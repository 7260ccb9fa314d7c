"""Verdicts on planted findings, and tests of planted means over tasks."""

import numpy as np
import pytest

from coartic import CoarticError
from common.judging import all_of, judge, judge_means, mean_beyond
from tests.support.made_up import found

NAN = float("nan")


def test_joined_findings_have_the_opposites_of_all():
    own, other = found(False, 0.7, against=[0.01]), found(True, 0.99, against=[0.2, 0.3])
    joined = all_of(own, other)
    assert (joined.against, joined.tests) == (own.against + other.against, own.tests + other.tests)
    assert [joined.holds, all_of(other, other).holds] == [False, True]


def judged(*findings):
    """Planted findings judged together."""
    return judge({f"planted-{n}": ("It is so.", "exact", each) for n, each in enumerate(findings)})


@pytest.mark.parametrize(
    ("finding", "verdict"),
    [
        (found(True), "supported"),
        (found(True, NAN), "supported"),  # no spread, no doubt
        (found(True, NAN, n=2), "undecided"),  # two values decide nothing
        (found(True, 0.001, 0.2), "undecided"),
        (found(False, 0.5, 0.97), "undecided"),  # the contrary of one of two
        (found(False, 0.7, against=[0.01]), "not supported"),
        (found(False, 0.7, against=[0.06]), "undecided"),
        (found(False, 0.99, against=[]), "undecided"),  # a test without a contrary side
        (found(False), "not supported"),
        (found(None), "undecided"),
    ],
)
def test_verdicts(finding, verdict):
    assert judged(finding).verdict.tolist() == [verdict]


def test_p_values_are_the_largest_of_a_claim_corrected_over_the_claims():
    """0.03 alone is significant, and is not with two other claims (Holm 1979)."""
    entries = judged(found(True, 0.03), found(True, 0.001), found(True, 0.02, 0.04))
    assert entries.p_holm.tolist() == pytest.approx([0.06, 0.003, 0.06])
    assert entries.verdict.tolist() == ["undecided", "supported", "undecided"]


def test_opposites_are_corrected_over_the_claims_too():
    """Of p of the opposites 0.0401, 0.0251 and 0.0011."""
    entries = judged(*(found(False, p) for p in (0.96, 0.975, 0.999)))
    assert entries.verdict.tolist() == ["undecided", "undecided", "not supported"]
    assert entries.opposite_p_holm.tolist() == pytest.approx([0.0502, 0.0502, 0.0033])


def test_each_bound_of_a_verdict_on_both_sides():
    """5 % does not support, and does not refute; two tasks are too few, three are judged."""
    seen = mean_beyond("{}", [4.0, 5.0, 6.0])
    unseen = mean_beyond("{}", [-4.0, 5.0, -6.0])
    below = np.nextafter(0.05, 0)
    assert [seen.verdict(p, NAN) for p in (below, 0.05)] == ["supported", "undecided"]
    assert [unseen.verdict(NAN, p) for p in (below, 0.05)] == ["not supported", "undecided"]
    assert [mean_beyond("{}", [4.0, 4.0, more]).holds for more in (NAN, 4.0)] == [None, True]
    assert [mean_beyond("{}", [1.0, 2.0, 3.0], bound).holds for bound in (1.99, 2.0, 2.01)] == [
        True, False, False,
    ]  # fmt: skip
    below_two = [mean_beyond("{}", [1.0, 2.0, 3.0], bound, "less").holds for bound in (2.0, 2.01)]
    assert below_two == [False, True]


def test_a_mean_of_very_skewed_values_needs_one_per_cent():
    """Skewness of one value that differs from n - 1 others: (n - 2) / sqrt(n - 1)."""
    level, strict = np.nextafter(0.05, 0), np.nextafter(0.01, 0)
    for values, bound in (([4.0] * 5 + [1.0], level), ([4.0] * 7 + [1.0], strict)):  # 1.8, 2.3
        for sign in (1, -1):
            side = "greater" if sign > 0 else "less"
            seen = mean_beyond("{}", sign * np.array(values), 0.0, side)
            unseen = mean_beyond(
                "{}", sign * np.array(values), 0.0, "less" if sign > 0 else "greater"
            )
            both = all_of(mean_beyond("{}", [1.0, 2.0, 3.0]), seen)
            for p in (bound, np.nextafter(bound, 1)):
                is_below = p < np.nextafter(bound, 1)
                assert seen.verdict(p, NAN) == ("supported" if is_below else "undecided")
                assert both.verdict(p, NAN) == ("supported" if is_below else "undecided")
                assert unseen.verdict(NAN, p) == ("not supported" if is_below else "undecided")


def test_words_and_bounds_of_claims_are_of_a_file(tmp_path):
    """Of two means in two groups of tasks each has to lie beyond its bound; groups one by one."""
    words = tmp_path / "claims.toml"
    words.write_text("""\
        [between]
        text = "It is between."
        test = "bootstrap tests"
        means = [{ sentence = "{group} {}", above = 1 }, { sentence = "again {}", below = 6 }]
    """)
    first, second = [2.0, 3.0, 4.0], [3.0, 5.0, 7.0, 5.0]
    both = {"one": first, "two": second}
    means = [mean_beyond(*asked) for asked in (
        ("one {}", first, 1), ("again {}", first, 6, "less"),
        ("two {}", second, 1), ("again {}", second, 6, "less"),
    )]  # fmt: skip
    due = judge({"between": ("It is between.", "bootstrap tests", all_of(*means))})
    assert judge_means(words, {"between": [both, both]}).equals(due)
    text = words.read_text("utf-8").replace('{ sentence = "again {}", below = 6 }', "")
    for bound, verdict in ((1, "not supported"), (9, "supported")):
        words.write_text(text.replace("above = 1", f"within = {bound}"))
        within = judge_means(words, {"between": [{"two": 3 * second}]}).loc["between"]
        assert within.evidence.startswith("Two 5.00 [4.17, 5.83] (12 tasks)")
        assert (within.verdict, within.evidence.count("tasks")) == (verdict, 1)
    with pytest.raises(CoarticError, match="claims.toml has no claim 'beyond'"):
        judge_means(words, {"beyond": [first]})
    with pytest.raises(CoarticError, match="'between' has 1 means, but values has 2"):
        judge_means(words, {"between": [first, first]})
    words.write_text("[between]\ntext = 'It is.'\nmeans = []")
    with pytest.raises(CoarticError, match="claim 'between' has no test"):
        judge_means(words, {"between": []})
