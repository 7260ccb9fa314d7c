"""Methods by id: those of this project, of installed plug-ins, and of the user's files.

Plug-ins are imported, which runs them; method files are imported by processes of their own.
"""

from __future__ import annotations

import importlib
import inspect
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib import metadata
from pathlib import Path

from pydantic import TypeAdapter

from coartic.benchmarks.code_identity import code_of
from coartic.benchmarks.reader import begin_reader, cards_of_module
from coartic.errors import CoarticError
from coartic.inputs import check_file
from coartic.learner.conditions import ABLATIONS, CONDITIONS, METHOD_PREFIX
from coartic.method import Method
from coartic.runs.card import BUILT_IN, READERS, MethodCard, card_of, methods_in
from coartic.runs.plan import SEARCH
from coartic.text import LONGEST_LINE, error_line, plain

ENTRY_POINTS = "coartic.methods"
RESERVED = (METHOD_PREFIX, SEARCH)
"""Ids that begin so have a meaning in every table: methods of this project alone have them."""
NAMES = ("CMA-ES", "learner", "optimum")
"""Names of this project's methods that could be ids of others."""
MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.receding_horizon",
    "coartic.baselines.optimum",
)
"""Where this project's methods are, each in its module's ``METHODS``."""


Registry = Mapping[str, MethodCard]
_CARDS = TypeAdapter(list[MethodCard])


def registry(method_files: Iterable[Path] = ()) -> dict[str, MethodCard]:
    """Every known method by id.

    A plug-in that cannot be loaded is a warning. Raises CoarticError for a file that
    cannot be loaded, holds no method, or takes an id that is reserved or already there.
    """
    cards = dict(built_in())
    for point in metadata.entry_points(group=ENTRY_POINTS):
        origin = f"plug-in {point.dist.name if point.dist else point.value}"
        try:  # a broken plug-in must not take the others with it
            add_cards(cards, cards_of_plugin(point, origin))
        except CoarticError as error:
            warnings.warn(
                f"{origin}: entry point {point.name!r} cannot be used: {error}", stacklevel=2
            )
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        add_cards(cards, cards_of_file(path))
    return cards


@cache
def built_in() -> Mapping[str, MethodCard]:
    """This project's methods by id."""
    cards: dict[str, MethodCard] = {}
    for name in MODULES:
        module = importlib.import_module(name)
        code = code_of(Path(inspect.getfile(module)))
        cards |= {method.name: card_of(method, BUILT_IN, name, code) for method in module.METHODS}
    return cards


_parsing = threading.Lock()  # Python 3.11 cannot parse in two threads at once


def current_code(where: str, name: str) -> str:
    """Hash of the code of a method that is imported from ``where``; ``none`` where it has none."""
    with _parsing:
        if where.endswith(".py"):
            if where not in READERS:  # which reads the file anew whenever it is asked
                list(cards_of_file(Path(where)))
            cards = READERS[where]("", "cards")
            return next((card["code"] for card in cards if card["name"] == name), "none")
        return code_of(Path(inspect.getfile(importlib.import_module(where))))


def add_cards(registered: dict[str, MethodCard], cards: Iterable[MethodCard]) -> None:
    """Add methods by id. Raises CoarticError for an id that is reserved or taken, and for
    one that differs from a name here in large and small letters alone."""
    for card in cards:
        names = (*registered, *CONDITIONS, *ABLATIONS, *NAMES)
        why = ""
        if card.name.startswith(RESERVED):
            ours = " or ".join(map(repr, RESERVED))
            why = f"is reserved: ids that begin with {ours} are this project's"
        elif card.name in registered:
            why = f"is already taken ({registered[card.name].origin})"
        elif card.name.casefold() in map(str.casefold, names):
            why = "is a name of a method here: choose another"
        if why:
            raise CoarticError(f"{card.origin}: method id {card.name!r} {why}")
        registered[card.name] = card


def cards_of_file(path: Path) -> Iterator[MethodCard]:
    """The methods of a file, which a process of its own imports: what it does there changes
    nothing here. Raises CoarticError where there is none that can be used."""
    shown = plain(str(path), LONGEST_LINE)
    check_file(path)
    if path.suffix != ".py":
        raise CoarticError(f"{shown}: the name of a method file ends in .py")
    ask = begin_reader(path, shown)
    for card in _CARDS.validate_python(ask("", "cards")):
        READERS[str(path)] = ask
        yield replace(card, origin=shown, where=str(path))


def cards_of_plugin(point: metadata.EntryPoint, origin: str) -> Iterator[MethodCard]:
    """The methods of an installed plug-in. Raises CoarticError."""
    try:
        target = point.load()
    except (Exception, SystemExit) as error:
        raise CoarticError(f"cannot be imported: {error_line(error)}") from None
    if not inspect.isclass(target):
        yield from cards_of_module(target, methods_in(target), origin, target.__name__)
    elif issubclass(target, Method):
        module = sys.modules[target.__module__]
        yield from cards_of_module(module, [target], origin, module.__name__)
    else:
        raise CoarticError(f"{target!r} is not a subclass of coartic.method.Method")
