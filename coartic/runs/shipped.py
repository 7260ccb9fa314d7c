"""Open the shipped results.

``benchmarks/shipped/SUITE.sqlite.xz`` is the compressed file of the results folder of a suite. The
script ``docs/scripts/pack_shipped.py`` writes it.
"""

from __future__ import annotations

import hashlib
import lzma
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from pathlib import Path

import coartic
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.runs.store import RUNS_FILE, Store, open_content, open_store

SHIPPED = "shipped"
"""Name that stands for the shipped results of suite ``comparison`` in place of a folder."""
SHIPPED_SUITES = {SHIPPED: "comparison", f"{SHIPPED}-families": "families"}
"""Maps each name that stands for shipped results to its suite."""
SHIPPED_FOLDER = Path(coartic.__file__).parent / "benchmarks" / "shipped"
HASHES = "SHA256SUMS"
PACKED = ".sqlite.xz"


def results_folder(name: str | Path) -> Path:
    """Return the results folder that a user names, in a command or in Python.

    The strings ``shipped`` and ``shipped-families`` stand for shipped results
    (:data:`SHIPPED_SUITES`), and the result is then the same word as a path. A folder of this name
    can be named ``./shipped``, or by a :class:`pathlib.Path`; its path is then absolute, so that it
    cannot be mistaken. The folder need not exist. Raises CoarticError if the name is empty or
    blank.
    """
    folder = folder_named(name)
    return folder.absolute() if str(folder) in SHIPPED_SUITES and name != str(folder) else folder


def own_folder(name: str | Path, what: str = "the name of a folder") -> Path:
    """Return the results folder that a user names for writing (:func:`results_folder`).

    Raises CoarticError, whose message begins with ``what``, if the name is empty, or if it stands
    for shipped results.
    """
    folder_named(name, what)
    if name in SHIPPED_SUITES:
        raise CoarticError(
            f"{what} is {name}, which stands for results that come with coartic: choose another "
            f"name, or write ./{name}"
        )
    return results_folder(name)


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
    """Open a results folder (:func:`results_folder`) for reading in a ``with`` block.

    A word of :data:`SHIPPED_SUITES` opens shipped results. Raises the errors of
    :func:`.open_store` or :func:`open_shipped`.
    """
    suite = SHIPPED_SUITES.get(str(folder))
    return open_shipped(suite) if suite else open_store(folder)


@contextmanager
def unpacked(folder: Path) -> Iterator[Path]:
    """Return a folder with the file ``runs.sqlite`` of a results folder, in a ``with`` block.

    It is the folder itself; for the shipped results it is a temporary folder.
    """
    if str(folder) not in SHIPPED_SUITES:
        yield folder
        return
    with tempfile.TemporaryDirectory() as place:
        with open_results(folder) as store:
            Path(place, RUNS_FILE).write_bytes(store.content or b"")
        yield Path(place)


def shipped_hashes() -> dict[str, str]:
    """Return a dict that maps shipped suites to SHA-256 hashes of their compressed files.

    The hashes are read from ``SHA256SUMS``. Raises OSError or ValueError if that fails.
    """
    lines = (SHIPPED_FOLDER / HASHES).read_text(encoding="ascii").splitlines()
    pairs = (line.split() for line in lines)
    return {name.removesuffix(PACKED): digits for digits, name in pairs}
