"""The rule of our claims on wrong objectives."""

from __future__ import annotations

import numpy as np

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.statistics.estimates import FEWEST, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.studies.objectives import TERMS, advantage
from coartic.analysis.words import estimate

RESAMPLES_OF_OBJECTIVES = 99_999
"""As many as for families of tasks: p-values are corrected over many claims."""


def less_regret(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap tests over random tasks that the first regrets less than the second by \
more than {regret:g} % of the best known reward"""
    tests, parts = [], []
    for where, pair in claim.cells.items():
        terms, _, weight = where.partition(" ")
        first, second = pair
        for term in TERMS if terms == "every" else (terms,):
            table = advantage(data.study, first, second, term)
            if len(table) < FEWEST or float(weight) not in table.columns:
                raise MissingError(f"this folder has too few tasks with {term} {weight}")
            values = np.array(table[float(weight)], dtype=np.float64)
            test = bootstrap_test(values, MARGINS["regret"], resamples=RESAMPLES_OF_OBJECTIVES)
            tests.append(test)
            parts.append(
                f"{term} {weight}: {first} {estimate(mean(values), 1)} % less regret than "
                f"{second} on {len(values)} random tasks"
            )
    data.run_ids.extend(data.study.runs.run_id)
    return Finding(all(test.estimate > 0 for test in tests), f"{'; '.join(parts)}.", tuple(tests))
