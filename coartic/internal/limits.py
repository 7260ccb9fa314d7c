"""Limits on what a plan may ask for, and checks of the numbers that users give."""

from __future__ import annotations

import numbers
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from coartic.internal.text import plain

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MOST_CELLS = 10_000
"""Most cells of a suite."""
MOST_RUNS = 1_000_000
"""Most runs of a cell."""
MOST_TRIALS = 10_000_000
"""Most trials of a run; the rewards of all of them are kept."""
MOST_SECONDS = 1_000_000
"""Most seconds of a run: a system can wait for twice that at most."""
MOST_SEED = 2**63 - 1
"""Largest seed of a suite."""
MOST_RUN_SEED = 2**128 - 1
"""Largest seed of a run."""
WIDTHS = (1e-9, 100.0)
"""Least and greatest half width of a box of targets, length unit (base) and rad (joints)."""


def check_limits(name: str, value: Any, least: float, most: float) -> None:
    """Raise ValueError, which calls the value ``name``, unless it is a number from ``least`` to
    ``most``, both included, and an integer (not 3.0) if ``least`` is an ``int``. True and False are
    no numbers."""
    whole = isinstance(least, int)
    kind = numbers.Integral if whole else numbers.Real
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:
        raise ValueError(
            f"{name} is {brief_value(value)}; it must be a {'whole ' * whole}number "
            f"from {least:{'' if whole else 'g'}} to {most:{',' if isinstance(most, int) else 'g'}}"
        )


def plain_values(value: Any) -> Any:
    """Return a value with ``x.item()`` in place of each scalar x of NumPy, also in copies of lists,
    tuples and dictionaries (values, not keys; subclasses stay)."""
    import numpy as np

    if type(value) in (list, tuple):
        return type(value)(map(plain_values, value))
    if type(value) is dict:
        return {name: plain_values(each) for name, each in value.items()}
    if isinstance(value, np.generic):
        return value.item()
    return value


def real_array(name: str, value: Any) -> NDArray[np.float64]:
    """Return real numbers as an array of float64 of their shape (:func:`real_numbers`). Raises
    ValueError, which calls the value ``name``, for other values."""
    try:
        return real_numbers(value)
    except ValueError as error:
        raise ValueError(f"{name} is {brief_value(value)}; it {error}") from None


def real_numbers(value: Any) -> NDArray[np.float64]:
    """Return real numbers as an array of float64 of their shape; NaN and infinity pass. An
    ``ndarray`` of float64 is returned itself, not a copy. Raises ValueError for anything else:
    text, complex numbers, True and False, rows of unequal length, masked entries, integers beyond
    float64."""
    import numpy as np  # which the command line's help does without

    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    _refuse_entries(value)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError("should be real numbers, in rows of one length") from None
    if array.dtype == object and all(
        isinstance(each, numbers.Real) and not isinstance(each, bool) for each in array.flat
    ):
        with suppress(OverflowError):  # an integer beyond 1e308
            array = array.astype(np.float64)  # a nullable column of pandas
    if array.dtype.kind not in "uif":
        raise ValueError("should be real numbers")
    return array.astype(np.float64, copy=False)


def _refuse_entries(value: Any) -> None:
    """Raise ValueError for an array with masked entries, and for a list or tuple that contains, at
    any depth of lists and tuples, such an array, True, False or an array of bools."""
    import numpy as np

    if isinstance(value, list | tuple):
        for each in value:
            if isinstance(each, bool) or getattr(getattr(each, "dtype", None), "kind", "") == "b":
                raise ValueError("should be real numbers, without True or False")
            _refuse_entries(each)
    elif isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ValueError("should have no masked entries")


def brief_value(value: object) -> str:
    """Return the ``repr`` of a value as one printable line, cut to 80 characters."""
    return plain(repr(value), 80)
