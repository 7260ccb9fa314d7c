"""The register as a page to read and as a frame."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Sequence

import pandas as pd

from analysis.claims import register
from analysis.claims.register import Judged
from analysis.markup import code, escaped
from analysis.page import Heading, Part, page
from analysis.results.folder import Results
from analysis.table import NONE, Table

FITTED = (
    "† rests on the two-armed tasks. Their goals are a reconstruction, chosen so that printed "
    "rewards and hand sequences come out (docs/model.md): a reproduction, no independent test."
)


def claims_frame(judged: Iterable[Judged]) -> pd.DataFrame:
    """One row per claim.

    Columns: ``id``, ``section``, ``statement``, ``verdict``, ``fitted``, ``evidence`` (with its
    table, row by row), ``test``, ``p`` (largest of the claim's tests), ``adjusted_p`` (Holm),
    ``contrary_p`` (smallest of the contrary's tests, times their number),
    ``adjusted_contrary_p``, ``place``, ``quote``, ``figure`` (of the paper), ``runs`` (ids,
    space-separated), ``sources`` (what else it rests on).
    """
    return pd.DataFrame(
        [
            {
                "id": entry.claim.id,
                "section": entry.claim.section,
                "statement": entry.claim.statement,
                "verdict": entry.verdict,
                "fitted": entry.claim.fitted,
                "evidence": _whole(entry),
                "test": entry.claim.test,
                "p": entry.p,
                "adjusted_p": entry.adjusted_p,
                "contrary_p": entry.contrary_p,
                "adjusted_contrary_p": entry.adjusted_contrary_p,
                "place": entry.claim.place,
                "quote": entry.claim.quote,
                "figure": entry.claim.figure,
                "runs": " ".join(entry.run_ids),
                "sources": ", ".join(entry.sources),
            }
            for entry in judged
        ]
    )


def claims_page(results: Results, judged: Sequence[Judged]) -> str:
    """The register as a Markdown page: counts, a table of verdicts, then claim by claim.

    The runs behind each claim are in :func:`claims_frame`.
    """
    specification = results.manifest.specification
    tests = sum(not math.isnan(entry.p) for entry in judged)
    contraries = sum(not math.isnan(entry.contrary_p) for entry in judged)
    parts: list[Part] = [
        Heading(1, "Claims"),
        f"What Shah, Barto & Fagg (2013) say of their model, tested on suite "
        f"{code(specification.suite)}: {specification.runs} runs of "
        f"{specification.trials} trials, seed {specification.seed}.",
        _summary(judged),
        f"{_rules()} {FITTED} Run ids of every claim are in `claims.csv`.",
        Table(
            "Verdicts",
            ("claim", "verdict", "adjusted p", "of the contrary"),
            tuple(
                (
                    entry.claim.id,
                    _verdict(entry),
                    _p(entry.adjusted_p),
                    _p(entry.adjusted_contrary_p),
                )
                for entry in judged
            ),
            tuple(f"#{entry.claim.id}" for entry in judged),
        ),
        f"Adjusted by Holm over the {tests} claims that could be tested here, for the contrary "
        f"over {contraries}.",
    ]
    for section, entries in itertools.groupby(judged, key=lambda entry: entry.claim.section):
        parts += [Heading(2, section), *(part for entry in entries for part in _entry(entry))]
    return page(parts)


def _summary(judged: Sequence[Judged]) -> str:
    paper = [entry for entry in judged if entry.claim.place]
    lines = []
    for name, entries in (
        ("Independent tests", [e for e in paper if not e.claim.fitted]),
        ("Reproductions †", [e for e in paper if e.claim.fitted]),
    ):
        found = Counter(entry.verdict for entry in entries)
        counted = ", ".join(
            f"{found[verdict]} {verdict}"
            for verdict in ("supported", "not supported", "cannot tell")
        )
        lines.append(f"**{name}**: {len(entries)} claims, {counted}.")
    return "\n".join(lines)


def _rules() -> str:
    """The rules as the register's own docstring has them."""
    return (register.__doc__ or "").split("\n\n", 1)[1].strip().replace("\n", " ")


def _entry(entry: Judged) -> list[Part]:
    claim = entry.claim
    where = ", ".join(filter(None, (claim.place, claim.figure))) or "not in the paper"
    quote = f": “{claim.quote}”" if claim.quote else ""
    items = [f"Seen: {escaped(entry.evidence)}.", f"Test: {claim.test}."]
    if claim.place and entry.methods:
        p = f"p = {_p(entry.p)}, adjusted {_p(entry.adjusted_p)}"
        contrary = f"of the contrary {_p(entry.contrary_p)}, adjusted "
        contrary += _p(entry.adjusted_contrary_p)
        items.append(f"{p}; {contrary}; {escaped('; '.join(entry.methods))}.")
    items.append(f"Place: {escaped(f'{where}{quote}')}. Rests on: {escaped(_basis(entry))}.")
    parts: list[Part] = [
        Heading(3, claim.id),
        f"{escaped(claim.statement)} **{_verdict(entry).capitalize()}.**",
        items,
    ]
    return parts if entry.table is None else [*parts, entry.table]


def _basis(entry: Judged) -> str:
    runs = [f"{len(entry.run_ids)} runs"] if entry.run_ids else []
    return ", ".join([*runs, *entry.sources]) or "nothing in this folder"


def _verdict(entry: Judged) -> str:
    return entry.verdict + (" †" if entry.claim.fitted else "")


def _p(value: float) -> str:
    return NONE if math.isnan(value) else f"{value:.2g}"


def _whole(entry: Judged) -> str:
    if entry.table is None:
        return entry.evidence
    names = entry.table.columns
    rows = (
        ", ".join(f"{name} {cell}" for name, cell in zip(names, row, strict=True))
        for row in entry.table.rows
    )
    return f"{entry.evidence}. " + "; ".join(rows)
