"""What users hand in: files, read bounded, what is wrong with them in words, and how much a plan
may ask for."""

from __future__ import annotations

import numbers
import re
import stat
import tomllib
from collections.abc import Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import PydanticCustomError

from coartic.errors import CoarticError
from coartic.text import LONGEST_LINE, counted, did_you_mean, plain, short_repr

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pydantic_core import ErrorDetails

T = TypeVar("T")

MOST_CELLS = 10_000
"""Most cells of a suite: sixty times the largest one shipped."""
MOST_RUNS = 1_000_000
"""Most runs of a cell."""
MOST_TRIALS = 10_000_000
"""Most trials of a run: a thousand times the paper's; their rewards are kept."""
MOST_SECONDS = 1_000_000
"""Most seconds of a run: eleven days; the system's clocks of waiting end at twice that."""
MOST_SEED = 2**63 - 1
MOST_BYTES = 10_000_000
"""Most bytes of a file of tasks, suites or methods: a hundred times the largest one shipped."""
WIDTHS = (1e-9, 100.0)
"""Least and greatest half width of a box of targets, length unit (base) and rad (joints)."""

_SHOWN = 20  # problems of one file
_PLAINER = {
    r"^(Input|String|Tuple|List|Dictionary|Value error,) ": "",
    r"^should have at least (\d+ \w+) after validation, not \d+": r"needs at least \1",
    r"^should have at most (\d+ \w+) after validation, not \d+": r"may have at most \1",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "valid integer": "whole number",
    "valid number": "number",
    "valid string": "text",
    "a valid boolean": "true or false",
    "valid (list|tuple)": "list",
    r"(valid )?dictionary( or (an )?instance of \w+)?": "table",
}
"""Wordings of pydantic, and what they say to a person."""


def in_sentences(kind: type[T]) -> type[T]:
    """The class itself, which raises ValueError in sentences where it is called with what it does
    not take."""
    init: Any = kind.__init__

    @wraps(init)
    def call(self: Any, *args: Any, **given: Any) -> None:
        try:
            init(self, *args, **given)
        except ValidationError as error:
            fields = [*type(self).__pydantic_fields__]
            raise ValueError(f"{type(self).__name__}: {explain_inline(error, fields)}") from None

    kind.__init__ = call  # type: ignore[method-assign]
    return kind


@in_sentences
class FileData(BaseModel):
    """What a file states: it cannot be changed, and every key is known."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __repr__(self) -> str:
        """What it states beyond the defaults, in a few lines."""
        stated = {}
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if field.is_required() or value != field.get_default(call_default_factory=True):
                stated[name] = value
        return short_repr(self, **stated)

    def __str__(self) -> str:
        return repr(self)


def read_toml(path: str | Path, *, error: type[CoarticError] = CoarticError) -> dict[str, Any]:
    """The content of a TOML file. Raises ``error`` for one that cannot be used."""
    check_file(path, error=error)
    shown = plain(str(path), LONGEST_LINE)
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError:
        raise error(f"{shown}: is not a text file in UTF-8") from None
    except OSError as failure:
        raise error(f"{shown}: cannot be read: {failure.strerror or failure}") from None
    except (ValueError, RecursionError) as failure:  # TOMLDecodeError is a ValueError
        raise error(f"{shown}: is not valid TOML: {plain(str(failure), 80)}") from None


def check_file(path: str | Path, *, error: type[CoarticError] = CoarticError) -> None:
    """Raises ``error`` for what cannot be read or is no file, such as a pipe or a device, and for
    a file of more than :data:`MOST_BYTES`."""
    shown = plain(str(path), LONGEST_LINE)
    try:
        found = Path(path).stat()
    except (OSError, ValueError) as failure:  # ValueError: a NUL in the name
        reason = getattr(failure, "strerror", None) or failure
        raise error(f"{shown}: cannot be read: {reason}") from None
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe or a device"
        raise error(f"{shown}: cannot be read: it is {kind}, not a file")
    if found.st_size > MOST_BYTES:
        raise error(f"{shown}: has {found.st_size} bytes; it may have {MOST_BYTES} at most")


def check_limits(name: str, value: Any, least: float, most: float) -> None:
    """Raises ValueError for what is no number from ``least`` to ``most``, or, where ``least`` is
    an ``int``, no whole one."""
    whole = isinstance(least, int)
    kind = numbers.Integral if whole else numbers.Real
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if not is_number or not least <= float(value) <= most:
        raise ValueError(
            f"{name} is {brief_value(value)}; it must be a {'whole ' * whole}number "
            f"from {least:{'' if whole else 'g'}} to {most:{'_' if isinstance(most, int) else 'g'}}"
        )


def real_array(name: str, value: Any) -> NDArray[np.float64]:
    """Numbers as an array of the shape that they have. Raises ValueError for anything else."""
    import numpy as np  # which the command line's help does without

    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name} has rows of different lengths") from None
    if array.dtype.kind not in "uif":
        raise ValueError(f"{name} is {brief_value(value)}; needed are real numbers")
    return array.astype(np.float64, copy=False)


def brief_value(value: object) -> str:
    """A value as it would be written in Python, as one short printable line."""
    return plain(repr(value), 80)


def explain_file(source: str, error: ValidationError, keys: Iterable[str] = ()) -> str:
    """One line for each problem of a file, the first :data:`_SHOWN` of them.

    ``keys`` are the keys that it may have, wherever they belong.
    """
    sentences, more = explain_first(error, list(keys))
    lines = [f"{plain(source)}: {sentence}" for sentence in sentences]
    if more:
        lines.append(f"{plain(source)}: has {counted(more, 'more problem')}")
    return "\n".join(lines)


def explain_inline(error: ValidationError, keys: Sequence[str]) -> str:
    """The problems of a file, the first :data:`_SHOWN` of them, as part of a sentence."""
    return "; ".join(explain_first(error, keys)[0])


def explain_first(error: ValidationError, keys: Sequence[str]) -> tuple[list[str], int]:
    """A sentence for each of the first :data:`_SHOWN` problems, and how many more there are."""
    details = error.errors(include_url=False)
    # A list is counted too short without its bad entries.
    details = [d for d in details if d["type"] != "too_short"] or details[:1]
    sentences = (plain(explain_problem(detail, keys)) for detail in details[:_SHOWN])
    return list(dict.fromkeys(sentences)), max(0, len(details) - _SHOWN)


def error_saying(text: str) -> PydanticCustomError:
    """A validation error whose message needs no prefix."""
    return PydanticCustomError("sentence", "{text}", {"text": text})


def explain_problem(detail: ErrorDetails, keys: Sequence[str] = ()) -> str:
    """One sentence for a thing that is wrong; ``keys`` is what an unknown key may have meant."""
    key, message = "", detail["msg"]  # where it is: goals[1][0], robot.left_links
    for part in detail["loc"]:
        if not key and isinstance(part, int) and keys:
            part = keys[part]  # an argument without its name
        name = plain(str(part), 80)
        key += f"[{name}]" if isinstance(part, int) else f".{name}" if key else name
    match detail["type"]:
        case "sentence":
            return message
        case "missing":
            return f"{key} is missing"
        case "extra_forbidden" | "unexpected_keyword_argument":
            name, table = str(detail["loc"][-1]), str(detail["loc"][0])
            if len(detail["loc"]) > 1 and name in keys:
                return f"{key} is an unknown key; {name!r} belongs above the line [{table}]"
            return f"{key} is an unknown key{did_you_mean(name, keys)}"
        case "list_type" | "tuple_type" if key == "goals":
            message = "should be a list of points, such as [[3.0, 2.0]]"
        case "list_type" | "tuple_type" if isinstance(detail["input"], str):
            message = f"should be a list, such as [{detail['input']!r}]"
        case "string_pattern_mismatch" if key == "name":
            message = "begins with a letter or digit and may have '.', '_' and '-' besides"
    for wording, plainer in _PLAINER.items():
        message = re.sub(wording, plainer, message)
    return f"{key} is {brief_value(detail['input'])}; it {message[:1].lower()}{message[1:]}"
