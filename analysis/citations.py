"""What to cite: the software, the paper, and the works behind methods, solvers and analysis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coartic import __version__
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.references import Reference, references
from coartic.analysis.words import slugs
from coartic.text import one_line

PAPER = "shah2013"
_STATISTICS = (
    *("efron1993", "davison1997", "agarwal2021", "newcombe2006", "holm1979"),
    *("chung2013", "schuirmann1987", "cohen1988"),
)

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "{": r"\textbraceleft{}",  # braces that BibTeX counts, with a backslash or without
    "}": r"\textbraceright{}",
    **{sign: f"\\{sign}" for sign in "%&#_$"},
}


@dataclass(frozen=True)
class MethodSource:
    """A method as a plan or the registry declares it."""

    id: str
    title: str
    citation: str
    """Empty where it is not known."""
    built_in: bool


def software(environment: Mapping[str, Any] | None = None) -> Reference:
    """This software; the facts are CITATION.cff's.

    Version and commit are those of a study's ``environment``; without one, of this version.
    """
    environment = environment or {}
    note = f"Version {environment.get('coartic') or __version__}"
    commit = environment.get("commit")
    if commit:
        note += f", commit {commit['id']}{' with changes' * commit['dirty']}"
    return Reference(
        "coartic",
        "misc",
        {
            "author": "{The coartic developers}",
            "title": "coartic: a comparative benchmark of coarticulation in motor skill "
            "acquisition",
            "year": "2026",
            "howpublished": "Computer software",
            "note": _escaped(note),
        },
    )


def behind_analysis() -> tuple[str, ...]:
    """Keys of the works behind signatures and statistics."""
    from coartic.analysis.signatures.register import REGISTER  # with all that measures them

    sources = dict.fromkeys(key for signature in REGISTER.values() for key in signature.sources)
    return (*_STATISTICS, *sources)


def bibliography(
    methods: list[MethodSource],
    *,
    analysis: bool = False,
    environment: Mapping[str, Any] | None = None,
) -> str:
    """BibTeX for the software, the paper and the methods, each work once.

    A comment before an entry names the methods that rest on it. Of methods of others, and of
    built-in ones without a row in ``methods.toml``, there is no more than the citation that they
    declare: it is printed as a comment and as the note of a ``@misc``. With ``analysis`` the
    works behind statistics and signatures follow. ``environment`` is a study's, for
    :func:`software`.
    """
    known = {**references(), "coartic": software(environment)}
    reasons: dict[str, list[str]] = {"coartic": ["the software"], PAPER: ["the paper"]}
    others = []
    for method in methods:
        row = KNOWN_METHODS.get(method.id) if method.built_in else None
        if row is None:
            others.append(method)
            continue
        for key in (*row.works, *row.solvers):
            reasons.setdefault(key, []).append(method.id)
    if analysis:
        for key in behind_analysis():
            reasons.setdefault(key, []).append("the analysis")
    entries = [
        f"{_comment(', '.join(reason))}\n{known[key].to_bibtex()}"
        for key, reason in reasons.items()
    ]
    slug = slugs(method.id for method in others)
    return "\n\n".join([*entries, *(_other(item, slug[item.id]) for item in others)]) + "\n"


def _other(method: MethodSource, key: str) -> str:
    citation = " ".join(method.citation.split())
    if not citation:
        return _comment(f"{method.id}: it declares no citation; ask its authors what to cite")
    fields = {
        "title": _escaped(" ".join(method.title.split()) or method.id),
        "note": _escaped(citation),
    }
    entry = Reference(f"method-{key}", "misc", fields)
    whose = "built in, without a row in methods.toml" if method.built_in else "a method of others"
    comment = _comment(f"{method.id}, {whose}, cites: {citation}")
    return f"{comment}\n{entry.to_bibtex()}"


def _comment(text: str) -> str:
    # BibTeX knows no comments: between entries it skips everything but an @.
    return f"% {one_line(text)}".replace("@", "(at)")


def _escaped(text: str) -> str:
    return "".join(_SPECIAL.get(sign, sign) for sign in one_line(text))
