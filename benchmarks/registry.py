"""Methods by id: those of this project, of installed plug-ins, and of the user's files.

Plug-ins and method files are imported, which runs them.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from types import ModuleType

from coartic.benchmarks.code_identity import code_of
from coartic.errors import CoarticError
from coartic.inputs import check_file
from coartic.learner.conditions import METHOD_PREFIX
from coartic.method import Information, Method
from coartic.runs.card import BUILT_IN, MethodCard, card_of, load_file, methods_in
from coartic.runs.plan import SEARCH
from coartic.text import LONGEST_LINE, error_line, plain

ENTRY_POINTS = "coartic.methods"
RESERVED = (METHOD_PREFIX, SEARCH)
"""Ids that begin so have a meaning in every table: methods of this project alone have them."""
MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.receding_horizon",
    "coartic.baselines.believed_reward",
    "coartic.baselines.optimum",
)
"""Where this project's methods are, each in its module's ``METHODS``."""


Registry = Mapping[str, MethodCard]


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
        code = code_of(Path(inspect.getfile(module)))  # once for its methods: it takes a while
        cards |= {method.name: card_of(method, BUILT_IN, name, code) for method in module.METHODS}
    return cards


_parsing = threading.Lock()  # Python 3.11 cannot parse in two threads at once


def current_code(where: str, name: str) -> str:
    """Hash of the code of a method that is imported from ``where``; ``none`` where it has none."""
    with _parsing:
        if where.endswith(".py"):
            return {card.name: card.code for card in cards_of_file(Path(where))}.get(name, "none")
        return code_of(Path(inspect.getfile(importlib.import_module(where))))


def add_cards(registered: dict[str, MethodCard], cards: Iterable[MethodCard]) -> None:
    """Add methods by id. Raises CoarticError for an id that is reserved or taken."""
    for card in cards:
        if card.name.startswith(RESERVED):
            raise CoarticError(
                f"{card.origin}: method id {card.name!r} is reserved: ids that begin with "
                f"{' or '.join(map(repr, RESERVED))} are this project's"
            )
        if card.name in registered:
            raise CoarticError(
                f"{card.origin}: method id {card.name!r} is already taken "
                f"({registered[card.name].origin})"
            )
        registered[card.name] = card


def cards_of_file(path: Path) -> Iterator[MethodCard]:
    """The methods of a file. Raises CoarticError where there is none that can be used."""
    shown = plain(str(path), LONGEST_LINE)
    check_file(path)
    try:
        module = load_file(path)
    except (Exception, SystemExit) as error:
        raise CoarticError(f"{shown}: cannot be imported: {error_line(error)}") from None
    yield from cards_of_module(module, methods_in(module), shown, str(path))


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


def cards_of_module(
    module: ModuleType, methods: Iterable[type[Method]], origin: str, where: str
) -> Iterator[MethodCard]:
    """Methods of a module with their code. Raises CoarticError where there is none."""
    methods = list(methods)
    for method in methods:
        check_declaration(method, origin)
        file = Path(inspect.getfile(module))
        data = tuple(file.parent / name for name in method.files)
        try:
            code = code_of(file, data)
        except OSError as error:
            raise CoarticError(
                f"{origin}: method {method.name!r} declares a file that cannot be read: "
                f"{error.filename}"
            ) from None
        except (SyntaxError, ValueError) as error:
            raise CoarticError(
                f"{origin}: it imports what is no Python: {error_line(error)}"
            ) from None
        yield card_of(method, origin, where, code)
    if not methods:
        unfinished = [
            f"{value.__name__} has no {', '.join(sorted(value.__abstractmethods__))}"
            for value in vars(module).values()
            if inspect.isclass(value) and issubclass(value, Method) and inspect.isabstract(value)
            and value is not Method
        ]  # fmt: skip
        why = f" that is complete: {', '.join(unfinished)}" if unfinished else ""
        raise CoarticError(f"{origin}: defines no subclass of coartic.method.Method{why}")


def check_declaration(method: type[Method], origin: str) -> None:
    """Raises CoarticError where a method does not declare what every method does."""
    where = f"{origin}: {method.__name__}"
    for attribute in ("name", "title", "citation"):
        text = getattr(method, attribute, None)
        if not isinstance(text, str) or plain(text, LONGEST_LINE) != text:
            raise CoarticError(f"{where}: {attribute} must be a text of one line, not {text!r}")
    if not _NAME.fullmatch(method.name):
        raise CoarticError(
            f"{where}: name {method.name!r} may have letters, digits, '.', '_', '+', '/' and '-'"
        )
    told = getattr(method, "told", None)
    if not isinstance(told, frozenset | set) or not all(isinstance(i, Information) for i in told):
        raise CoarticError(f"{where}: told must be a set of Information, not {told!r}")


_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+/-]{0,79}")
