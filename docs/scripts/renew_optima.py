"""Make the shipped optima anew: ``python docs/scripts/renew_optima.py FOLDER`` (suite optimum)."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from typing import Any

from coartic import CoarticError
from coartic.analysis.optima import restrictions
from coartic.analysis.study import Study, load
from coartic.internal.files import write_atomically
from coartic.internal.text import one_line
from coartic.runs.plan import SEARCH
from coartic.tasks.optima import DATA, entries, essence

OTHER_SEARCH = "trajectory-optimisation/path-length"


def collect(study: Study) -> list[dict[str, Any]]:
    """Entries of ``optima.json`` from a results folder of suite ``optimum``.

    Raises CoarticError where the folder has no searches for the optimum.
    """
    proofs = study.runs.method.str.startswith(SEARCH)
    if not proofs.any():
        raise CoarticError(f"{study.folder}: has no runs of methods {SEARCH}*")
    runs = study.runs[proofs | (study.runs.method == OTHER_SEARCH)]
    runs = runs.assign(**restrictions(runs))
    keys = ("coartic", "commit", "model_code", "python", "date")
    made_by = {key: study.made_with[key] for key in keys}
    collected = []
    for key, group in runs.groupby(["task", "base", "other_arm"], sort=False):
        name, base, arm = map(str, key)
        good = group[group.status == "ok"]
        facts: dict[str, Any] = {"infeasible": group.reason.iloc[0]}
        if len(good):
            best, bounds = good.iloc[int(good.reward.astype(int).argmax())], good.proven_bound
            rows = study.solutions[study.solutions.run_id == best.run_id].drop(columns="run_id")
            facts = {
                "reward": int(best.reward),
                "hands": str(best.hands),
                "bound": int(bounds.min()) if bounds.notna().any() else None,
                "searches": good.groupby("method").reward.max().astype(int).to_dict(),
                "solution": rows.to_dict("records"),
            }
        entry = {
            "task": name,
            "essence": essence(study.tasks[name]),
            "base": base,
            "other_arm": arm,
            "run_ids": sorted(group.run_id),
            "made_by": made_by,
        }
        collected.append(entry | facts)
    return collected


def key_of(entry: dict[str, Any]) -> tuple[str, str, str]:
    """What an entry is about: task, lock of the base, other arm."""
    return entry["task"], entry["base"], entry["other_arm"]


def content_with(new: Iterable[dict[str, Any]], old: Iterable[dict[str, Any]]) -> bytes:
    """Content of ``optima.json``: new entries replace old ones about the same problem that are no
    better."""
    by_key = {key_of(entry): entry for entry in old}
    for entry in new:
        before = by_key.get(key_of(entry), entry).get("reward")
        if before is None or ("reward" in entry and entry["reward"] >= before):
            by_key[key_of(entry)] = entry
    content = [by_key[key] for key in sorted(by_key)]
    return f"{json.dumps({'optima': content}, indent=1, ensure_ascii=False)}\n".encode()


def main() -> None:
    """Renew the entries of ``optima.json`` that a results folder of suite ``optimum`` covers."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(
            "usage: python docs/scripts/renew_optima.py RESULTS_FOLDER\n"
            f"Renews in {DATA} what the folder's optimum runs cover; the rest stays."
        )
    try:
        new = collect(load(sys.argv[1]))
    except CoarticError as error:
        sys.exit(one_line(str(error)))
    write_atomically(DATA, content_with(new, entries()))
    print(f"{DATA}: {len(new)} optima renewed")


if __name__ == "__main__":
    main()
