"""Results that are shipped: ``shipped/SUITE.sqlite.xz``, each a results folder of one file.

``python -m coartic.benchmarks.shipped FOLDER`` makes one of a results folder. The rewards of
trials are thinned (:meth:`coartic.runs.run.Run.thin`), which takes it from 30 to 2 MB.
"""

from __future__ import annotations

import hashlib
import lzma
import sys
import tempfile
from contextlib import AbstractContextManager
from pathlib import Path

from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.runs.store import RUNS_FILE, Store, open_content, open_store, writing

SHIPPED = "shipped"
"""Stands for the shipped results in place of a folder."""
_FOLDER = Path(__file__).with_name("shipped")
_HASHES = "SHA256SUMS"
_ENDING = ".sqlite.xz"


def open_shipped(suite: str) -> AbstractContextManager[Store]:
    """The shipped results of a suite, unpacked in memory. Raises CoarticError where there are none,
    or they were changed."""
    path = _FOLDER / f"{suite}{_ENDING}"
    try:
        hashes = shipped_hashes()
        content = path.read_bytes() if suite in hashes else b""
    except (OSError, ValueError) as error:
        raise CoarticError(f"{path} cannot be read: install coartic again ({error})") from None
    if suite not in hashes:
        raise CoarticError(f"no results of suite {suite!r} are shipped, but of {', '.join(hashes)}")
    if hashlib.sha256(content).hexdigest() != hashes[suite]:
        raise CoarticError(f"{path} is not as it was shipped: install coartic again")
    return open_content(lzma.decompress(content), SHIPPED)


def shipped_hashes() -> dict[str, str]:
    """SHA-256 of the shipped results of each suite."""
    lines = (_FOLDER / _HASHES).read_text(encoding="ascii").splitlines()
    pairs = (line.split() for line in lines)
    return {name.removesuffix(_ENDING): digits for digits, name in pairs}


def pack(folder: Path, out: Path) -> None:
    """Write the results of a folder, thinned, and their hash to where they are shipped."""
    with open_store(folder) as source, tempfile.TemporaryDirectory() as made:
        plan, made_with = source.plan(), source.made_with()
        ran, date = made_with.pop("command"), made_with.pop("date")
        with writing(Path(made)) as target:
            target.replace_plan(plan, made_with, ran, date)
            target.write(source.run(run_id).thin() for run_id in source.runs().run_id)
        content = lzma.compress((Path(made) / RUNS_FILE).read_bytes(), preset=9)
    (out / f"{plan.suite}{_ENDING}").write_bytes(content)
    packed = sorted(out.glob(f"*{_ENDING}"))
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in packed]
    (out / _HASHES).write_text("".join(lines), encoding="ascii")


if __name__ == "__main__":
    pack(folder_named(sys.argv[1]), _FOLDER)
