"""Open the shipped results.

``benchmarks/shipped/SUITE.sqlite.xz`` is the compressed file of the results folder of a suite. The
script ``docs/scripts/pack_shipped.py`` writes it.
"""

from __future__ import annotations

import hashlib
import lzma
from contextlib import AbstractContextManager
from functools import lru_cache
from pathlib import Path

import coartic
from coartic.errors import CoarticError
from coartic.runs.store import Store, open_content, open_store

SHIPPED = "shipped"
"""Name that stands for the shipped results in place of a folder."""
SHIPPED_FOLDER = Path(coartic.__file__).parent / "benchmarks" / "shipped"
HASHES = "SHA256SUMS"
PACKED = ".sqlite.xz"


def open_shipped(suite: str) -> AbstractContextManager[Store]:
    """Open the shipped results of a suite in memory, for reading in a ``with`` block.

    Raises CoarticError if no results of the suite are shipped, or if their file was changed or
    cannot be read.
    """
    path = SHIPPED_FOLDER / f"{suite}{PACKED}"
    try:
        hashes = shipped_hashes()
        content = path.read_bytes() if suite in hashes else b""
    except (OSError, ValueError) as error:
        raise CoarticError(f"{path} cannot be read: install coartic again ({error})") from None
    if suite not in hashes:
        raise CoarticError(
            f"suite {suite!r} has no shipped results; the suites {', '.join(hashes)} have"
        )
    if hashlib.sha256(content).hexdigest() != hashes[suite]:
        raise CoarticError(f"{path} was changed after it was shipped: install coartic again")
    return open_content(_decompressed(content), SHIPPED)


@lru_cache(maxsize=1)  # a report opens the same results several times
def _decompressed(content: bytes) -> bytes:
    """Return the decompressed content of a file with shipped results."""
    return lzma.decompress(content)


def open_results(folder: Path) -> AbstractContextManager[Store]:
    """Open a results folder for reading in a ``with`` block.

    The name ``shipped`` opens the shipped results of the suite ``comparison``. Raises the errors of
    :func:`.open_store` or :func:`open_shipped`.
    """
    return open_shipped("comparison") if str(folder) == SHIPPED else open_store(folder)


def shipped_hashes() -> dict[str, str]:
    """Return a dict that maps shipped suites to SHA-256 hashes of their compressed files.

    The hashes are read from ``SHA256SUMS``. Raises OSError or ValueError if that fails.
    """
    lines = (SHIPPED_FOLDER / HASHES).read_text(encoding="ascii").splitlines()
    pairs = (line.split() for line in lines)
    return {name.removesuffix(PACKED): digits for digits, name in pairs}
