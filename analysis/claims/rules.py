"""Rules that many claims share: each takes a folder and a claim, whose fields say what it is about.

:func:`higher` compares means over runs, :func:`in_every_family` means over random tasks,
:func:`counted` counts runs, and :func:`ordered` compares rewards of the corrective process alone.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import (
    MARGINS,
    QUANTITIES,
    Claim,
    Finding,
    Side,
    read_comparison,
    read_side,
)
from coartic.analysis.optima import KnownOptimum
from coartic.analysis.statistics.estimates import (
    FEWEST,
    Estimate,
    difference_of_means,
    mean,
)
from coartic.analysis.statistics.hypotheses import (
    Alternative,
    bootstrap_test,
    share_test,
)
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.paper.published import (
    ENTRIES,
    Number,
    published_cell,
    published_exhaustive,
    published_initial,
)
from coartic.analysis.words import estimate, number, tally
from coartic.robot import Array

RESAMPLES_OF_FAMILIES = 99_999
"""More than elsewhere: some verdicts on families are close, and samples are small."""
REWARDS = ("reward", "replay")
Parts = list[tuple[str, str]]
"""Parts of the evidence, each with what is measured."""
COUNTS = {
    "most": "exact binomial test that more than {most:.0%} of the runs do",
    "not most": "exact binomial test that fewer than {most:.0%} of the runs do",
    "majority": "exact binomial test that more than {majority:.0%} of the runs do",
    "half": "exact binomial tests that more than {few:.0%} and fewer than {most:.0%} of all runs "
    "do; for the opposite: the share lies outside, and Fisher's exact test tells the counts from "
    "the printed ones. 20 runs are too few to pass it after Holm's correction",
    "some": "exact: one run is enough",
}
"""How many runs have to do something, and how that is tested."""


def higher(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap test of the mean reward for each comparison"""
    tests, parts = [], []
    for task, pairs in claim.pairs.items():
        before = None
        for first, second, margin in map(read_comparison, pairs):
            a, b = data.values(task, first), data.values(task, second)
            same_runs = b.ndim and (first.who, first.hands) == (second.who, second.hands)
            compare = (a - b, margin) if same_runs else (a - margin, b)
            tests.append(bootstrap_test(*compare))
            seen = compared(task, first, second, a, b)
            if first == before:  # its value was said
                words = f"{task}, {first} {seen[seen.index('against') :]}"
            else:
                words = f"{task}, {first}: {seen}"
            parts.append((first.what, words))
            before = first
    return all_hold(tests, [*parts, *shown_beside(data, claim)])


def some_higher(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap test of the mean reward for each comparison; at least one of them \
holds, the smallest p times their number (Bonferroni)"""
    every = higher(data, claim)
    best = min(every.tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    holds = any(test.value > 0 for test in every.tests)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(every.tests)))
    return Finding(holds, every.evidence, (best,))


def in_every_family(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over instances of the mean difference, as a share of the best \
known reward, in each family"""
    tests, parts = [], []
    for pair in claim.compared:
        first, second, margin = read_comparison(pair)
        for family in claim.families:
            values = over_instances(data, family, first, second)
            tests.append(bootstrap_test(values, margin, resamples=RESAMPLES_OF_FAMILIES))
            beyond = "" if second.what == "number" else f", more than {second}"
            seen = f"{family}{beyond}: {estimate(mean(values), 2)}"
            if first.what in REWARDS:
                seen = f"{family} {pair}: {estimate(mean(values), 1)} %"
            parts.append((first.what, f"{seen} on {len(values)} instances"))
    return all_hold(tests, parts)


def over_instances(data: Data, family: str, first: Side, second: Side) -> Array:
    """Mean difference on each instance of a family that can be judged, shape ``(n,)``.

    Of rewards in per cent of the best known one.
    """
    differences = []
    for name, reference in judged_instances(data, family).items():
        with suppress(MissingError):
            a = data.values(name, first).mean()
            b = data.values(name, second).mean()
            scale = 1.0
            if first.what in REWARDS:
                scale = 100 / abs(reference.reward)
            differences.append(scale * float(a - b))
    if len(differences) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} instances of {family} can be judged")
    return np.array(differences)


def judged_instances(data: Data, family: str) -> dict[str, KnownOptimum]:
    """Instances of a family but for those of development, on which methods were tuned."""
    instances = sample(data.study)
    names = instances.families.get(family, ()) if instances else ()
    reported = [name for name in names if data.task(name).split != "development"]
    if instances is None or not reported:
        raise MissingError(f"this folder has no instances of {family} that can be judged")
    return {name: instances.references[name] for name in reported}


def counted(data: Data, claim: Claim) -> Finding:
    """exact counts of runs"""
    findings = []
    for task, texts in claim.runs.items():
        for text in texts:
            how, _, rest = text.partition(" EC")
            condition, what = f"EC{rest}".split(" ", 1)
            findings.append(count_runs(data, task, how, condition, what))
    return Finding(
        all(each.holds for each in findings),
        "; ".join(each.evidence for each in findings),
        tuple(test for each in findings for test in each.tests),
        tuple(test for each in findings for test in each.against or ()),
    )


def count_runs(data: Data, task: str, how: str, condition: str, what: str) -> Finding:
    """Whether so many runs do something; ``how`` is a name of :data:`COUNTS`."""
    does = runs_that(data, task, condition, what)
    count, total = int(does.sum()), len(does)
    share = count / total
    words = (
        f"{task} {condition} {what}: {count} of {total} runs ({tally(data.hands(task, condition))})"
    )
    if how == "some":
        return Finding(count > 0, words)
    if how == "half":
        return about_half(task, condition, what, words, count, total)
    bound = MARGINS["majority" if how == "majority" else "most"]
    alternatives: tuple[Alternative, Alternative] = ("greater", "less")
    if how == "not most":
        alternatives = ("less", "greater")
    limits = stats.binomtest(count, total, alternative=alternatives[0]).proportion_ci()
    limit = f"at least {limits.low:.0%}" if how != "not most" else f"at most {limits.high:.0%}"
    test, against = (share_test(count, total, bound, tail) for tail in alternatives)
    holds = share < bound if how == "not most" else share > bound
    if limits.low > 0 or limits.high < 1:
        words += f", {limit} of all (95 %)"
    return Finding(holds, words, (test,), (against,))


def runs_that(data: Data, task: str, condition: str, what: str) -> NDArray[np.bool_]:
    """Which runs do something, shape ``(runs,)``: ``LRLR``, ``not best``, ``RRLR rightward``.

    ``commonest``: have the commonest hand sequence; ``best``, ``initial``: one that is best by the
    corrective process alone, or the initial one; ``rightward``: of the runs with these hands, the
    base only moves right.
    """
    inverse, what = what.startswith("not "), what.removeprefix("not ")
    learned = data.runs(task, condition).hands.astype(str).to_numpy()
    if what.endswith(" rightward"):
        q0, hands = data.task(task).q0, what.partition(" ")[0]
        runs = [r.execution for r in data.cell(task, condition).runs if r.execution.hands == hands]
        if not runs:
            raise MissingError(f"no run of {condition} on {task} learned {hands}")
        does = np.array([bool((base_steps(q0, run.configurations) > 0).all()) for run in runs])
    else:
        wanted = [what]
        if what == "commonest":
            wanted = [data.hands(task, condition).most_common(1)[0][0]]
        elif what == "best":
            wanted = data.best_sequences(task)[0]
        elif what == "initial":
            wanted = [data.task(task).initial_hands]
        does = np.isin(learned, wanted)
    return ~does if inverse else does


def base_steps(start: Array, configurations: Array) -> Array:
    """How far the base moves along x from goal to goal, length unit, shape ``(G,)``."""
    return np.diff(np.append(start[0], configurations[:, 0]))


def about_half(
    task: str, condition: str, hands: str, words: str, count: int, total: int
) -> Finding:
    """Whether a share lies between few and most; against it also speaks the printed count."""
    few, most = MARGINS["few"], MARGINS["most"]
    low, high = stats.binomtest(count, total).proportion_ci()
    cell = published_cell(task, condition)
    assert cell is not None
    printed = cell.sequences[hands].runs
    printed_total = sum(summary.runs for summary in cell.sequences.values())
    derived = any(
        (entry.kind, entry.task, entry.condition, entry.hands) == ("count", task, condition, hands)
        for entry in ENTRIES.values()
        if isinstance(entry, Number) and entry.difference_of
    )
    share = count / total
    within = Estimate(
        min(share - few, most - share),
        n=(total,),
        p=max(
            share_test(count, total, few, "greater").p,
            share_test(count, total, most, "less").p,
        ),
    )
    table = [[count, total - count], [printed, printed_total - printed]]
    unlike = Estimate(
        share - printed / printed_total,
        n=(total, printed_total),
        p=float(stats.fisher_exact(table).pvalue),
    )
    return Finding(
        few < share < most,
        f"{words}, {low:.0%} to {high:.0%} of all (95 %); published {printed} of {printed_total}"
        + " (derived)" * derived,
        (within,),
        (unlike,),
    )


def ordered(data: Data, claim: Claim) -> Finding:
    """exact: rewards of the corrective process alone; a tie leaves it undecided"""
    ((task, pairs),) = claim.pairs.items()
    ((first, second),) = (pair.split(" > ") for pair in pairs)
    solved = {name: r for name, r in data.sequences(task).items() if not math.isnan(r)}
    others = set(solved) - {first} if second == "others" else {second} & set(solved)
    rivals = [solved[name] for name in others]
    if first not in solved or not rivals:
        raise MissingError(f"the corrective process alone has no reward with {first} or {second}")
    return Finding(
        None if solved[first] == max(rivals) else solved[first] > max(rivals),
        f"{task}: {first} {number(solved[first])} (published {number(printed_corrective(task))}), "
        f"{second} {number(max(rivals))}.",
    )


def printed_corrective(task: str) -> float:
    """Printed reward of the corrective process alone, with the initial hands or the best."""
    solution = published_initial(task) or published_exhaustive(task)
    return solution.number if solution else math.nan


def shown_beside(data: Data, claim: Claim) -> Parts:
    """What the claim shows beside its comparisons, as far as the folder has it."""
    parts = []
    for task, texts in claim.shown.items():
        for beside in map(read_side, texts):
            with suppress(MissingError):
                values = np.atleast_1d(data.values(task, beside))
                parts.append((beside.what, f"{task}, {beside}: {in_words(beside.what, values)}"))
    return parts


def evidence(parts: Parts) -> str:
    """Parts by what is measured: ``Ticks by which ...: a; b. Share of ...: c.``"""
    by_what: dict[str, list[str]] = {}
    for what, part in parts:
        words = QUANTITIES[what] if what not in REWARDS else ""
        by_what.setdefault(f"{words[:1].upper()}{words[1:]}: " if words else "", []).append(part)
    return " ".join(f"{words}{'; '.join(of_quantity)}." for words, of_quantity in by_what.items())


def all_hold(tests: list[Estimate], parts: Parts) -> Finding:
    """What is seen where every test points as claimed."""
    return Finding(all(test.value > 0 for test in tests), evidence(parts), tuple(tests))


def in_words(what: str, values: Array) -> str:
    """The mean with its BCa interval; ticks and rewards with one decimal."""
    return estimate(mean(values), 1 if in_ticks(what) else 3)


def in_ticks(what: str) -> bool:
    """Whether a quantity is counted in ticks."""
    return what in REWARDS or "ticks by which" in QUANTITIES[what]


def compared(task: str, first: Side, second: Side, a: Array, b: Array) -> str:
    """Both sides of a comparison with their difference, and what the paper prints of them."""
    seen = in_words(first.what, a)
    if second.what == "number":
        return seen if b == 0 else f"{seen} against {second.who}"
    if not b.ndim:
        seen += f" against {number(float(b))} ({second})"
    elif first.what.removeprefix("replayed-") != second.what.removeprefix("replayed-"):
        return f"{seen}, {second.what} {in_words(second.what, b)}"
    else:
        ticks = in_ticks(first.what)
        difference = estimate(difference_of_means(a, b), 1 if ticks else 3) + " ticks" * ticks
        seen += f" against {in_words(second.what, b)} ({second}), a difference of {difference}"
    printed = [as_printed(task, each) for each in (first, second)]
    return f"{seen}; published {printed[0]} and {printed[1]}" if None not in printed else seen


def as_printed(task: str, side: Side) -> str | None:
    """Mean reward of one side as the paper has it, in words; None where it does not print it."""
    alone = {"initial": published_initial, "best": published_exhaustive}
    cell = published_cell(task, side.who) if side.what in REWARDS else None
    if side.who in alone and (solution := alone[side.who](task)):
        value, derived = solution.number, bool(solution.difference_of)
    elif cell and (summary := cell.sequences.get(side.hands) if side.hands else cell.summary):
        value, derived = summary.mean, summary.derived
    else:
        return None
    return f"{number(value)}{' (derived)' * derived}"
