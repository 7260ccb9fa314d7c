"""Citations: the software, the paper, and the works behind methods, solvers and analysis.

The works are the entries of ``references.bib``, which are printed as they stand there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from coartic import CoarticError, __version__
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.words import latex, slugs
from coartic.runs.card import BUILT_IN, MethodCard
from coartic.text import did_you_mean, one_line

THE_PAPER = "shah2013"
STATISTICS = (
    *("efron1993", "davison1997", "holm1979", "chung2013", "schuirmann1987", "cohen1988"),
)


@cache
def references() -> Mapping[str, str]:
    """The entries of ``references.bib`` by key, in BibTeX."""
    text = (resources.files("coartic.analysis") / "references.bib").read_text(encoding="utf-8")
    entries = re.finditer(r"^@\w+\{([^,]+),\n(?: .+\n)+\}", text, re.MULTILINE)
    return {entry[1]: entry[0] for entry in entries}


def software(made_with: Mapping[str, Any] | None = None) -> str:
    """This software in BibTeX; the facts are CITATION.cff's.

    Version and commit are those of a results folder's environment; without one, of this version.
    """
    made_with = made_with or {}
    note = f"Version {made_with.get('coartic') or __version__}"
    commit = made_with.get("commit")
    if commit:
        note += f", commit {commit['id']}{' with changes' * commit['dirty']}"
    return misc(
        "coartic",
        author="{The coartic developers}",
        title="coartic: a comparative benchmark of coarticulation in motor skill acquisition",
        year="2026",
        howpublished="Computer software",
        note=latex(note),
    )


def bibliography(
    methods: Mapping[str, MethodCard],
    *,
    analysis: bool = False,
    environment: Mapping[str, Any] | None = None,
    released: Mapping[str, str] | None = None,
) -> str:
    """BibTeX for the software, the paper and the methods, each work once.

    A comment before an entry names the methods that rest on it. Of methods of others, and of
    built-in ones without a row in ``methods.toml``, there is no more than the citation that they
    declare: it is printed as a comment and as the note of a ``@misc``. With ``analysis`` the
    works behind statistics and signatures follow. ``environment`` is a results folder's, for
    :func:`software`; ``released`` are suites and SHA-256 of the results that this version ships.
    """
    works = {**references(), "coartic": software(environment)}
    reasons: dict[str, list[str]] = {"coartic": ["the software"]}
    if released:
        files = ", ".join(f"{suite}.sqlite.xz {digits}" for suite, digits in released.items())
        works["coartic-results"] = misc(
            "coartic-results",
            author="{The coartic developers}",
            title=latex(f"Results of coartic {__version__}: suites {' and '.join(released)}"),
            year="2026",
            howpublished="Data shipped with the software",
            note=latex(f"SHA-256: {files}"),
        )
        reasons["coartic-results"] = ["the results that this version ships"]
    reasons[THE_PAPER] = ["the paper"]
    others = []
    for name, method in methods.items():
        row = KNOWN_METHODS.get(name) if method.origin == BUILT_IN else None
        if row is None:
            others.append(name)
            continue
        for key in (*row.works, *row.solvers):
            if key not in works:
                hint = did_you_mean(key, works) or "; add it"
                raise CoarticError(f"{name} in methods.toml: no {key!r} in references.bib{hint}")
            reasons.setdefault(key, []).append(name)
    for key in STATISTICS if analysis else ():
        reasons.setdefault(key, []).append("the analysis")
    entries = [f"{comment(', '.join(whose))}\n{works[key]}" for key, whose in reasons.items()]
    slug = slugs(others)
    for name in others:
        method = methods[name]
        if not (citation := " ".join(method.citation.split())):
            entries.append(
                comment(f"{name}: it declares no citation; ask its authors what to cite")
            )
            continue
        ours = method.origin == BUILT_IN
        whose = "built in, without a row in methods.toml" if ours else "a method of others"
        title = latex(" ".join(method.title.split()) or name)
        declared = misc(f"method-{slug[name]}", title=title, note=latex(citation))
        entries.append(f"{comment(f'{name}, {whose}, cites: {citation}')}\n{declared}")
    return "\n\n".join(entries) + "\n"


def misc(key: str, **fields: str) -> str:
    """A ``@misc`` in BibTeX, one field a line."""
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items()]
    return "\n".join([f"@misc{{{key},", *lines, "}"])


def comment(text: str) -> str:
    """A line that BibTeX skips: between entries it skips everything but an @."""
    return f"% {one_line(text)}".replace("@", "(at)")
