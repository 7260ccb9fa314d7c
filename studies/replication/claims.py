"""The paper's claims with their verdicts, by their tests corrected together.

- *Supported*: the runs show the claim, and the largest p-value of its tests, which must all hold
  (intersection-union test), is below 5 % after Holm's correction; tests over random tasks also
  without the task that favours the claim most.
- *Not supported*: the runs do not show the claim, and the opposite of one of its tests is
  significant (smallest p-value of the opposites times their number, below 5 % after Holm's
  correction).
- *Depends on the goals*: our goals support the claim, but at most half of the sets of goals
  consistent with the paper's text do (``sets.csv``).
- *Undecided*: none of these, or the folder lacks the runs.

Exact counts, and values without spread over runs, need no test. A claim that a folder cannot test
counts in its group all the same, so that verdicts do not change with the other runs of a folder.
"""

import tomllib
from pathlib import Path

import families
import hands
import pandas as pd
import performance
import postures
from reader import MissingError, Reader

from coartic import load_task
from coartic.analysis import judge
from coartic.analysis.judging import Finding

HERE = Path(__file__).parent
CLAIMS = pd.DataFrame.from_dict(
    tomllib.loads((HERE / "claims.toml").read_text("utf-8")), orient="index"
).fillna({"fitted": False, "short": ""})
"""A row for each claim, as ``claims.toml`` explains."""
RULES = postures.RULES | hands.RULES | performance.RULES | families.RULES


def judge_claims(study, names):
    """Judge claims by a folder, each corrected over the claims of its group among ``names``.

    Returns a row for each claim, as :func:`coartic.analysis.judge` does, with ``run_ids`` of the
    runs that the claim read; ``sets``, the number of sets of goals that support and refute it;
    ``place`` and ``quote`` of the paper; ``suite``, empty for a claim for which the folder lacks
    runs or tasks.
    """
    findings, run_ids, suites = {}, {}, {}
    for name in names:
        read = Reader(study)
        try:
            findings[name] = RULES[name](read)
            run_ids[name], suites[name] = " ".join(dict.fromkeys(read.run_ids)), study.suite
        except MissingError as missing:
            findings[name] = Finding(None, str(missing))
    claims = CLAIMS.loc[names]
    judged = pd.concat(
        judge({name: (claim.text, claim.test, findings[name]) for name, claim in group.iterrows()})
        for _, group in claims.groupby("group", sort=False)
    ).loc[names]
    few = pd.Series([*map(few_sets_support, names)], names)
    marks = claims.fitted.map({True: " †", False: ""})
    return (
        judged.assign(
            statement=judged.statement + marks,
            verdict=judged.verdict.mask(
                few & (judged.verdict == "supported"), "depends on the goals"
            ),
            sets=[*map(sets_in_words, names)],
            place=claims.place,
            quote=claims.quote,
            suite=[suites.get(name, "") for name in names],
            run_ids=[run_ids.get(name, "") for name in names],
        )
        .drop(columns="p_without")
        .rename_axis("row")
    )


SETS = pd.read_csv(HERE / "sets.csv")
"""Number of sets of goals, consistent with the paper's text, that support and refute a claim."""


def few_sets_support(name):
    """Return whether at most half of the sets of goals support a claim, on some task."""
    of_claim = SETS[SETS.claim == name]
    return bool((2 * of_claim.supported <= of_claim.members).any())


def sets_in_words(name):
    """Say how many sets of goals support a claim; empty for a claim on published goals."""
    words = [
        f"{row.supported} of {row.members} ({load_task(row.task).label}"
        f"{f', refuted in {row.refuted}' * (row.refuted > 0)})"
        for row in SETS[SETS.claim == name].itertuples()
    ]
    return "; ".join(words) or "not counted" * CLAIMS.fitted[name]
