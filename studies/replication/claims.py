"""Judge the paper's claims by two verdicts each, with tests that are corrected together.

``docs/statistics.md`` explains the verdicts. Exact counts, and values without spread over runs,
need no test. A claim that a folder cannot test still counts in the correction of its group, so that
verdicts do not depend on the other runs of a folder.
"""

import tomllib
from pathlib import Path

import families
import hands
import pandas as pd
import performance
import postures
from judging import Finding, judge
from reader import MissingError, Reader

HERE = Path(__file__).parent
CLAIMS = pd.DataFrame.from_dict(
    tomllib.loads((HERE / "claims.toml").read_text("utf-8")), orient="index"
).fillna({"fitted": False, "short": ""})
"""A row for each claim, as ``claims.toml`` explains."""
RULES = postures.RULES | hands.RULES | performance.RULES | families.RULES
"""Rules that say whether claims replicate, by id."""
BEYOND = postures.BEYOND | hands.BEYOND | families.BEYOND
"""Rules that say whether learners show more than random search, for claims that need it."""
COLUMNS = [
    *("statement", "replicates", "evidence", "test", "p_holm", "opposite_p_holm"),
    *("more_than_one_selection", "evidence_beyond", "test_beyond", "p_beyond", "opposite_p_beyond"),
    *("place", "quote", "suite", "run_ids"),
]


def judge_claims(study, names):
    """Judge claims by the runs of a folder.

    The first verdict is whether a claim *replicates*. The second is whether its effect is *more
    than one selection* among as many trials; it is empty for claims that need no comparison with
    random search. P-values are corrected over the claims of a group among ``names``. ``suite`` is
    empty for claims for which the folder lacks runs or tasks. ``run_ids`` has the runs that both
    verdicts use.
    """
    names, claims = [*names], CLAIMS.loc[[*names]]
    judged, read = judge_rules(study, names, RULES, claims.test)
    compared = [name for name in names if name in BEYOND]
    beyond, read_beyond = judge_rules(study, compared, BEYOND, claims.test_beyond)
    renamed = {"verdict": "more_than_one_selection", "evidence": "evidence_beyond",
               "test": "test_beyond", "p_holm": "p_beyond",
               "opposite_p_holm": "opposite_p_beyond"}  # fmt: skip
    judged = judged.join(beyond.reindex(columns=[*renamed]).rename(columns=renamed))
    run_ids = {name: [*read.get(name, ()), *read_beyond.get(name, ())] for name in names}
    return judged.assign(
        statement=judged.statement + claims.fitted.map({True: " †", False: ""}),
        replicates=judged.verdict,
        place=claims.place,
        quote=claims.quote,
        suite=[study.suite if name in read else "" for name in names],
        run_ids=[" ".join(dict.fromkeys(run_ids[name])) for name in names],
    )[COLUMNS].rename_axis("row")


def judge_rules(study, names, rules, tests):
    """Judge claims by rules, with tests corrected within groups.

    Also returns the ids of the runs that each rule used, by claim. Claims for which the folder
    lacks runs or tasks are left out of them.
    """
    findings, run_ids = {}, {}
    for name in names:
        read = Reader(study)
        try:
            findings[name], run_ids[name] = rules[name](read), read.run_ids
        except MissingError as missing:
            findings[name] = Finding(None, str(missing))
    judged = [
        judge({name: (CLAIMS.text[name], tests[name], findings[name]) for name in group.index})
        for _, group in CLAIMS.loc[names].groupby("group", sort=False)
    ]
    return pd.concat([judge({}), *judged]).loc[names], run_ids
