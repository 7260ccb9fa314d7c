"""Every attack on a checkout, and the table of what got through.

``python -m tests.attacks [--root CHECKOUT] [--only edits,forgeries,methods] [--at-once 1]``
prints the attacks that got through, with what they achieved, and the counts. Linux only.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

from .checkout import adopt_orphans
from .methods import ATTACKS
from .trial import clean_run, hold

Outcome = tuple[str, list[str] | str]
"""Id of an attack, and what did not hold; text says why there is nothing to see."""


def methods(root: Path, folder: Path, at_once: int, chosen: str) -> Iterator[Outcome]:
    """Hostile methods, each in a suite of its own."""
    clean = clean_run(root, folder / "clean")
    fork = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(at_once, mp_context=fork, initializer=adopt_orphans) as pool:
        waiting = {
            pool.submit(hold, attack, root, clean, folder / attack.id.replace("/", "-")): attack.id
            for attack in ATTACKS.values()
            if attack.id.startswith(chosen)
        }
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def in_folders(
    kind: str, root: Path, folder: Path, at_once: int, chosen: str
) -> Iterator[Outcome]:
    """Attacks on finished folders: edits, forgeries."""
    module = importlib.import_module(f"tests.attacks.{kind}")
    yield from module.outcomes(root, folder, chosen)


KINDS = {
    "edits": partial(in_folders, "edits"),
    "forgeries": partial(in_folders, "forgeries"),
    "methods": methods,
}


def main() -> None:
    """Run what is asked for and print what got through."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=Path.cwd(), help="checkout to attack")
    parser.add_argument("--only", default=",".join(KINDS), help="kinds, or kind:beginning of id")
    parser.add_argument("--at-once", type=int, default=1, help="hostile methods at one time")
    options = parser.parse_args()
    table = []
    with tempfile.TemporaryDirectory(prefix="coartic-attacks-") as folder:
        for word in options.only.split(","):
            kind, _, chosen = word.partition(":")
            clock = time.monotonic()
            done = through = unseen = 0
            own = Path(folder) / kind
            own.mkdir()
            for name, found in KINDS[kind](options.root.resolve(), own, options.at_once, chosen):
                done += 1
                if isinstance(found, str):
                    unseen += 1
                    print(f"{kind} {name}: not counted, {found}", flush=True)
                elif found:
                    through += 1
                    print(f"{kind} {name}: {'; '.join(found)}", flush=True)
            table.append((kind, done, unseen, done - unseen - through, through))
            print(f"# {kind}: {time.monotonic() - clock:.0f} s\n", flush=True)
    print(f"{'attacks':12}{'tried':>8}{'not counted':>14}{'held':>8}{'got through':>14}")
    for kind, *counts in table:
        print(
            f"{kind:12}"
            + "".join(f"{n:>{w}}" for n, w in zip(counts, (8, 14, 8, 14), strict=True))
        )
    sys.exit(any(row[-1] for row in table))


if __name__ == "__main__":
    main()
