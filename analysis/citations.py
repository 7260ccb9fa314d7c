"""Cite the software, the paper, and the works behind methods, solvers and analysis.

The entries of the works are in ``references.bib``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

from coartic import __version__
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.words import latex, listed, slugs
from coartic.internal.text import one_line
from coartic.runs.method_info import BUILT_IN, MethodInfo
from coartic.runs.plan import world_title

THE_PAPER = "shah2013"
STATISTICS = "efron1993", "davison1997", "holm1979", "chung2013", "schuirmann1987", "cohen1988"
THEORIES = "harris1998", "todorov2002"
"""Keys of works on theories of motor control. The documentation compares methods with them."""


@cache
def references() -> Mapping[str, str]:
    """Return a dict that maps each citation key of ``references.bib`` to its BibTeX entry."""
    text = (resources.files("coartic.analysis") / "references.bib").read_text(encoding="utf-8")
    entries = re.finditer(r"^@\w+\{([^,]+),\n(?: .+\n)+\}", text, re.MULTILINE)
    return {entry[1]: entry[0] for entry in entries}


def bibliography(
    methods: Mapping[str, MethodInfo],
    *,
    analysis: bool = False,
    environment: Mapping[str, Any] | None = None,
    imports: Mapping[str, Sequence[str]] | None = None,
    worlds: Sequence[str] = ("",),
    versions: Sequence[str] = (),
) -> str:
    """Return BibTeX entries for the software, the paper, and the works behind the methods.

    Each cited work of ``references.bib`` has one entry, even if several methods cite it. Each
    method from a file that declares a citation as text has an entry of its own. A comment line
    before each entry gives the reasons for it: the methods that cite the work, or a reason such as
    ``the paper``.

    Parameters
    ----------
    methods : mapping of str to MethodInfo
        Maps the id of each method to its declaration. A comment line names each method from a file
        that declares neither a citation nor works, and each work that is not in ``references.bib``.
    analysis : bool
        True to add works on the statistics of the analysis, and works on theories of motor control
        (:data:`STATISTICS`, :data:`THEORIES`).
    environment : mapping, optional
        Environment of a results folder (:attr:`.Study.made_with`). The version and the commit of
        coartic in this environment are cited. By default, the version of coartic that is running is
        cited.
    imports : mapping, optional
        Maps the id of each method from a file to the names and versions of the packages that the
        file imports (:attr:`.Study.imports`). These packages are named in a comment line.
    worlds : sequence of str
        Names of the worlds of the runs (:attr:`.Study.worlds`); the empty string is the paper's
        world. If one of them is another world, the entry of the software names all worlds.
    versions : sequence of str
        Versions of coartic that made the runs. The entry of the software names them.

    Returns
    -------
    str
        The entries and comment lines, as the content of a ``.bib`` file.
    """
    made_with = environment or {}
    note = f"Version {made_with.get('coartic') or __version__}"
    if commit := made_with.get("commit"):
        note += f", commit {commit['id']}{' with changes' if commit['dirty'] else ''}"
    if others := [version for version in versions if version != made_with.get("coartic")]:
        note += f"; runs made with {listed(others)}, too"
    if any(worlds):
        note += f"; runs in {listed(map(world_title, worlds))}"
    software = _misc(
        "coartic",  # as in CITATION.cff
        author="{The coartic developers}",
        title="coartic: a comparative benchmark of coarticulation in motor skill acquisition",
        year="2026",
        howpublished="Computer software",
        note=latex(note),
    )
    works = {**references(), "coartic": software}
    reasons = {"coartic": ["the software"], THE_PAPER: ["the paper"]}
    of_files = []
    for name, method in methods.items():
        known = KNOWN_METHODS.get(name) if method.origin == BUILT_IN else None
        facts = known.facts if known else method.facts
        if known is None:
            of_files.append(name)
        for key in (*facts.works, *facts.solvers):
            if key in works:
                reasons.setdefault(key, []).append(name)
    for key in STATISTICS if analysis else ():
        reasons.setdefault(key, []).append("the analysis")
    for key in THEORIES if analysis else ():
        reasons.setdefault(key, []).append("theories that methods are compared with")
    entries = [f"{_comment(', '.join(whose))}\n{works[key]}" for key, whose in reasons.items()]
    slug = slugs(of_files)
    for name in of_files:
        if citation := " ".join(methods[name].citation.split()):
            title = latex(" ".join(methods[name].title.split()) or name)
            declared = _misc(f"method-{slug[name]}", title=title, note=latex(citation))
            entries.append(f"{_comment(f'{name} cites: {citation}')}\n{declared}")
        facts = methods[name].facts
        keys = (*facts.works, *facts.solvers)
        if unknown := [key for key in keys if key not in works]:
            words = f"{name} names {', '.join(unknown)}, which coartic's bibliography does not have"
            entries.append(_comment(words))
        if not citation and not keys:
            words = f"{name}: it declares no citation; ask its authors what to cite"
            entries.append(_comment(words))
        if used := (imports or {}).get(name):
            entries.append(_comment(f"{name} ran with {', '.join(used)}: cite these, too"))
    return "\n\n".join(entries) + "\n"


def _misc(key: str, **fields: str) -> str:
    """Return a BibTeX entry of type ``@misc``.

    Each keyword argument is a field of the entry. Each field is on a line of its own.
    """
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items()]
    return "\n".join([f"@misc{{{key},", *lines, "}"])


def _comment(text: str) -> str:
    """Return a string as a comment line for a BibTeX file.

    Each ``@`` is replaced by ``(at)``, because BibTeX would read it as the beginning of an entry.
    """
    return f"% {one_line(text)}".replace("@", "(at)")
