"""What users hand in: files, read bounded, what is wrong with them in words, and how much a plan
may ask for."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coartic.errors import CoarticError
from coartic.text import did_you_mean, plain

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

MOST_BYTES = 1_000_000
"""Of a file: a thousand times a usual task, and parsed within a second or so."""
MOST_CELLS = 10_000
"""Of a suite: sixty times the largest one shipped."""
MOST_RUNS = 1_000_000
"""Of a cell."""
MOST_PLANNED = 2_000_000
"""Runs of a plan, which is held in memory."""
MOST_TRIALS = 10_000_000
"""Of a run: a thousand times the paper's; their rewards are kept."""
MOST_SECONDS = 1_000_000
"""Of a run: eleven days; the system's clocks of waiting end at twice that."""
MOST_SEED = 2**63 - 1

_SHOWN = 20  # problems of one file
_BRIEF = 80  # characters of a value in a sentence


def read_text(path: str | Path, *, error: type[CoarticError] = CoarticError) -> str:
    """The text of a file in UTF-8. Raises ``error`` where there is none, or it is very long."""
    shown = plain(str(path))
    try:
        if Path(path).stat().st_size > MOST_BYTES:
            raise error(f"{shown}: is longer than {MOST_BYTES:_} bytes, the most that is read")
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{shown}: is not a text file in UTF-8") from None
    except (OSError, ValueError) as failure:
        why = getattr(failure, "strerror", None) or failure
        raise error(f"{shown}: cannot be read: {why}") from None


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """The content of a TOML file. Raises ``error`` for one that cannot be used."""
    text, shown = read_text(path, error=error), plain(str(path))
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as failure:  # TOMLDecodeError is a ValueError
        raise error(f"{shown}: is not valid TOML: {brief(str(failure))}") from None


def brief(text: str) -> str:
    """A text as one short printable line, with its length where it is cut."""
    if len(text) <= _BRIEF:
        return plain(text)
    return f"{plain(text[:60])}... ({len(text)} characters)"


def brief_value(value: object) -> str:
    """A value as it would be written in Python, as :func:`brief` shows it."""
    try:
        return brief(repr(value))
    except ValueError:  # Python's own bound, which hexadecimal input evades
        return "a number of more than 4300 digits"


def problems(
    source: str,
    error: ValidationError,
    known: Iterable[str] = (),
    explain: Callable[[ErrorDetails], str | None] = lambda detail: None,
) -> str:
    """One line for each problem of a file, the first :data:`_SHOWN` of them.

    In words of :func:`explained`, or of ``explain`` where it has some.
    """
    details, shown = _causes(error), plain(source)
    texts = (explain(detail) or explained(detail, known) for detail in details[:_SHOWN])
    lines = list(dict.fromkeys(f"{shown}: {plain(text)}" for text in texts))
    if len(details) > _SHOWN:
        lines.append(f"{shown}: has {len(details) - _SHOWN} more problems")
    return "\n".join(lines)


def problems_inline(error: ValidationError, known: Iterable[str] = (), most: int = 3) -> str:
    """The same as part of a sentence, the first ``most`` of them."""
    details, known = _causes(error), list(known)
    found = "; ".join(plain(explained(detail, known)) for detail in details[:most])
    return found + (f" and {len(details) - most} more" if len(details) > most else "")


def _causes(error: ValidationError) -> list[ErrorDetails]:
    """The errors, without a list counted too short because of its bad entries."""
    details = error.errors(include_url=False)
    return [
        detail
        for detail in details
        if detail["type"] != "too_short"
        or not any(
            other["loc"] != detail["loc"] and other["loc"][: len(detail["loc"])] == detail["loc"]
            for other in details
        )
    ]


def key_of(location: tuple[int | str, ...]) -> str:
    """Where in a file: ``goals[1][0]``, ``robot.left_links``."""
    text = ""
    for part in location:
        name = brief(str(part))
        text += f"[{name}]" if isinstance(part, int) else f".{name}" if text else name
    return text or "the whole"


_WANTED = {
    "finite_number": "a finite number",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "an integer",
    "int_parsing": "an integer",
    "int_parsing_size": "an integer that is not that long",
    "int_from_float": "an integer",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "a text",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dataclass_type": "a table",
    "greater_than": "greater than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "{expected}",
    "enum": "{expected}",
}
_TYPE_TOLD = {"float_type", "int_type", "string_type", "tuple_type", "list_type"}
"""Where the type of a value may not be seen from how it is written."""


def explained(detail: ErrorDetails, known: Iterable[str] = ()) -> str:
    """One sentence for a thing that is wrong; ``known`` is what an unknown key may have meant."""
    kind, context, value = detail["type"], detail.get("ctx", {}), detail["input"]
    key, shown = key_of(detail["loc"]), brief_value(value)
    if kind in _WANTED:
        found = f"{shown} ({type(value).__name__})" if kind in _TYPE_TOLD else shown
        return f"{key} is {found}; it must be {_WANTED[kind].format(**context)}"
    match kind:
        case "missing":
            return f"{key} is missing"
        case "extra_forbidden" | "unexpected_keyword_argument":
            return f"{key} is an unknown key{did_you_mean(str(detail['loc'][-1]), known)}"
        case "string_pattern_mismatch":
            return f"{key} is {shown}; {_letters(context['pattern'])}"
        case "string_too_long":
            return f"{key} has {len(value)} characters; it takes {context['max_length']}"
        case "too_short":
            return f"{key} has too few entries; it needs at least {context['min_length']}"
        case "too_long":
            count = context["actual_length"] or "more"
            return f"{key} has {count} entries; it takes {context['max_length']}"
        case "not_plain" | "scalar":
            return f"{key} {detail['msg']}"
    message = detail["msg"]
    return f"{key}: {message[:1].lower()}{message[1:]} (found {shown})"


def _letters(pattern: str) -> str:
    """What a pattern of names lets through, of one that ends in a set of characters."""
    marks = re.search(r"0-9([^]]*)\]\*\$$", pattern)
    if marks is None:
        return f"it must match {pattern}"
    *some, last = map(repr, marks[1])
    return f"use letters, digits, {', '.join(some)} and {last} only"
