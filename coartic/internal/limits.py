"""Largest values of numbers that users pass, and checks of such numbers."""

from __future__ import annotations

import numbers
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from coartic.internal.text import plain

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_CELLS = 10_000
"""Largest number of instances that a range of instances names, and of episodes of a score."""
MAX_RUNS = 1_000_000
"""Largest number of runs of a cell."""
MAX_TRIALS = 10_000_000
"""Largest number of trials of a run. The rewards of all trials are stored."""
MAX_SECONDS = 1_000_000
"""Largest time limit (in s). The longest wait that operating systems allow is about twice this
time."""
MAX_SEED = 2**63 - 1
"""Largest seed of a suite."""
MAX_RUN_SEED = 2**128 - 1
"""Largest seed of a run."""
WIDTHS = (1e-9, 100.0)
"""Smallest and largest half width of the box in which optimisers search for targets, in length
units (base) and rad (joints)."""


def check_limits(name: str, value: Any, least: float, most: float) -> None:
    """Raise ValueError if a value is not a number from ``least`` to ``most``.

    Both ends are allowed. The value must be an integer (not 3.0) if ``least`` is an ``int``. True
    and False are not numbers. The error message begins with ``name``.
    """
    is_integer = isinstance(least, int)
    kind = numbers.Integral if is_integer else numbers.Real
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:
        lower = f"{least:{'' if is_integer else 'g'}}"
        upper = f"{most:{',' if isinstance(most, int) else 'g'}}"
        raise ValueError(
            f"{name} is {brief_value(value)}; it must be "
            f"{'an integer' if is_integer else 'a number'} from {lower} to {upper}"
        )


def plain_values(value: Any) -> Any:
    """Convert NumPy scalars to Python objects, also inside lists, tuples and dicts.

    Lists, tuples and dicts are copied, at any depth. Keys of dicts, and objects of subclasses of
    ``list``, ``tuple`` and ``dict``, are not converted.

    Examples
    --------
    >>> import numpy as np
    >>> plain_values({"seed": np.int64(3), "sizes": [np.float64(0.5)]})
    {'seed': 3, 'sizes': [0.5]}
    """
    import numpy as np

    if type(value) in (list, tuple):
        return type(value)(map(plain_values, value))
    if type(value) is dict:
        return {name: plain_values(item) for name, item in value.items()}
    if isinstance(value, np.generic):
        return value.item()
    return value


def real_array(name: str, value: Any) -> NDArray[np.float64]:
    """Convert real numbers to an array of float64 (:func:`real_numbers`).

    Raises ValueError for any other value. The error message begins with ``name``.
    """
    try:
        return real_numbers(value)
    except ValueError as error:
        raise ValueError(f"{name} is {brief_value(value)}; it {error}") from None


def real_numbers(value: Any) -> NDArray[np.float64]:
    """Convert real numbers to an array of float64 of the same shape.

    ``value`` is a number, an array, or a list of numbers or of lists. An ``ndarray`` of float64 is
    returned without a copy. NaN and infinity are allowed. Raises ValueError for strings, complex
    numbers, True and False, rows of unequal length, masked entries of NumPy, integers that are too
    large for float64, and any other objects that are not real numbers.
    """
    import numpy as np  # slow to import, and the help of commands does not need it

    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    _refuse_entries(value)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError("should be real numbers, in rows of equal length") from None
    if array.dtype == object and all(
        isinstance(entry, numbers.Real) and not isinstance(entry, bool) for entry in array.flat
    ):
        with suppress(OverflowError):  # an integer beyond 1e308
            array = array.astype(np.float64)  # a nullable column of pandas
    if array.dtype.kind not in "uif":
        raise ValueError("should be real numbers")
    return array.astype(np.float64, copy=False)


def _refuse_entries(value: Any) -> None:
    """Raise ValueError if an array has masked entries, or a list contains True or False.

    Lists and tuples are searched at any depth.
    """
    import numpy as np

    if isinstance(value, list | tuple):
        for item in value:
            if isinstance(item, bool) or getattr(getattr(item, "dtype", None), "kind", "") == "b":
                raise ValueError("should be real numbers, without True or False")
            _refuse_entries(item)
    elif isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ValueError("should not have masked entries")


def brief_value(value: object) -> str:
    """Return the ``repr`` of a value as one printable line, cut to 80 characters."""
    return plain(repr(value), 80)
