"""Pack shipped results from results folders.

    python docs/scripts/pack_shipped.py FOLDER

A folder whose runs have other results than the shipped runs is only packed with ``--changed``. The
rewards of trials are downsampled (:meth:`coartic.runs.record.Run.downsample`), so that the files
have 5 MB instead of 150 MB.
"""

from __future__ import annotations

import argparse
import hashlib
import lzma
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_runs
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.runs import shipped
from coartic.runs.record import Row
from coartic.runs.store import RUNS_FILE, Store, open_store, open_store_for_writing


def changed_runs(folder: Path) -> Iterator[str]:
    """Yield a sentence for each shipped run that a folder lacks or changes.

    A folder changes a run if the run has another result there. Raises CoarticError if the
    folder has a method whose version is not the one installed here.
    """
    with open_store(folder) as made:
        plan = made.plan()
        for method in (job.cell.method for job in plan):
            here = built_in()[method.name].code if method.name in built_in() else "missing"
            if here != method.code:
                raise CoarticError(
                    f"{folder} has version {method.code} of {method.name}, whose version here is "
                    f"{here}: run the suite again"
                )
        if (suite := plan[0].suite) not in shipped.shipped_hashes():
            return
        ids = {run_id.partition("-")[0]: run_id for run_id in made.runs().run_id}
        with shipped.open_shipped(suite) as before:
            for run_id in before.runs().run_id:
                if (asked := run_id.partition("-")[0]) not in ids:
                    yield f"run {run_id} is missing"
                    continue
                for change in compare_runs(before.run(run_id), made.run(ids[asked])):
                    yield f"run {run_id}: {change}"


def pack(source: Store, runs: Iterable[Row], out: Path) -> None:
    """Pack runs, with downsampled rewards and the plan of ``source``, into the folder ``out``.

    The file with the hashes of all packed results in this folder is written, too.
    """
    with tempfile.TemporaryDirectory() as made:
        plan = source.plan()
        with open_store_for_writing(Path(made)) as target:
            target.replace_plan(plan, source.made_with())
            target.write(run.downsample() for run in runs)
        content = lzma.compress((Path(made) / RUNS_FILE).read_bytes(), preset=9)
    (out / f"{plan[0].suite}{shipped.PACKED}").write_bytes(content)
    packed = sorted(out.glob(f"*{shipped.PACKED}"))
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in packed]
    (out / shipped.HASHES).write_text("".join(lines), encoding="ascii")


def main() -> int:
    """Pack the folders that the command line names, unless shipped results would change.

    With ``--changed``, folders are also packed if results change. Returns 1 if nothing was packed,
    otherwise 0.
    """
    parser = argparse.ArgumentParser(prog="python docs/scripts/pack_shipped.py")
    parser.add_argument("--changed", action="store_true", help="pack results that have changed")
    parser.add_argument("folders", nargs="+", type=folder_named, metavar="FOLDER")
    options = parser.parse_args()
    try:
        changes = {folder: list(changed_runs(folder)) for folder in options.folders}
    except CoarticError as error:
        parser.error(str(error))
    for folder, sentences in changes.items():
        print(f"{folder}: {len(sentences) or 'no'} differences from the shipped results")
        for sentence in sentences[:20]:
            print(f"- {sentence}")
    if any(changes.values()) and not options.changed:
        print("Nothing was packed. If the results should change, add --changed.")
        return 1
    for folder in options.folders:
        with open_store(folder) as source:
            runs = map(source.run, source.runs().run_id)
            pack(source, runs, shipped.SHIPPED_FOLDER)
    return 0


if __name__ == "__main__":
    sys.exit(main())
