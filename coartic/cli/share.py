"""Commands that put results beside results, and hand them on."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say, say_pairs, show_frame
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.text import counted

if TYPE_CHECKING:
    import pandas as pd

GAPS = {"gap": "gap", "low": "gap_low", "high": "gap_high"}
"""Columns of the table of standings, per cent, and those of the report's ranking."""


def merge(
    folders: Annotated[
        list[Path],
        typer.Argument(parser=folder_named, metavar="FOLDER...", help="Results folders."),
    ],
    out: given.OutFolder,
) -> None:
    """Join results folders of one suite into a new one."""
    from coartic.benchmarks.merge import merge as join_folders

    merged = join_folders(folders, out)
    repeats = f" ({merged.repeats} of them in more than one folder)" if merged.repeats else ""
    say(f"{merged.folder}: {counted(merged.runs, 'run')}{repeats}, each scored again.")
    say_pairs([("Next", f"coartic report {merged.folder}")])


def export(
    folder: given.Results,
    out: Annotated[
        Path | None,
        typer.Option(
            parser=given.output_named,
            metavar="FOLDER",
            help="Where to write; FOLDER/ioh if not given.",
        ),
    ] = None,
    ioh: Annotated[bool, typer.Option("--ioh", help="For IOHinspector and IOHanalyzer.")] = False,
) -> None:
    """Write runs in the format of another program."""
    from coartic.analysis.ioh import ioh_files
    from coartic.analysis.study import load
    from coartic.files import publish

    if not ioh:
        raise CoarticError("say in which format: --ioh")
    out = folder / "ioh" if out is None else out
    files = ioh_files(load(folder))
    publish(out, files)
    count = len({name.partition("/")[0] for name in files})
    say(f"{out}: {counted(count, 'method')} in {counted(len(files), 'file')}.")


def standings(
    folder: Annotated[
        Path,
        typer.Argument(
            parser=folder_named, metavar="FOLDER", help="What holds the submitted folders."
        ),
    ] = Path("submissions"),
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Table to write (.csv).")] = None,
    replace: given.Replace = False,
) -> None:
    """Check submitted results and rank their methods."""
    import pandas as pd

    from coartic.files import check_output, write_output

    if out is not None:
        if out.suffix.lower() != ".csv":
            raise CoarticError(f"--out {out}: the name must end in .csv.")
        check_output(out, replace=replace)
    by_suite, refused = submissions(folder)
    tables = []
    for suite, folders in by_suite.items():
        ranking, left_out = rank(suite, folders)
        tables.append(ranking)
        refused |= left_out
    table = pd.concat(tables) if tables else pd.DataFrame()
    shown = table.drop(columns=["knows", "low", "high", "runs"], errors="ignore").round(1)
    show_frame(shown.astype(object).where(shown.notna(), ""))
    for place, reason in refused.items():
        say(f"Refused: {place}: {reason.removeprefix(f'{place}: ')}")
    if out is not None:
        write_output(out, table.to_csv(index=False).encode(), replace=replace)
    if refused:
        sys.exit(1)


def submissions(folder: Path) -> tuple[dict[str, list[Path]], dict[Path, str]]:
    """The results folders in a folder by suite, and why others of them are refused.

    Raises CoarticError where there is none.
    """
    from coartic.analysis.verify import check_runs
    from coartic.runs.store import RUNS_FILE, open_store

    places = sorted(path.parent for path in folder.glob(f"*/{RUNS_FILE}"))
    if not places:
        raise CoarticError(f"{folder} holds no results folders: name what holds the submitted ones")
    by_suite: dict[str, list[Path]] = {}
    refused: dict[Path, str] = {}
    for place in places:
        try:
            with open_store(place) as store:
                suite = store.plan().suite
            if wrong := check_runs(place).wrong:
                raise CoarticError(f"{counted(len(wrong), 'thing')} not as stored: {wrong[0]}")
            by_suite.setdefault(suite, []).append(place)
        except CoarticError as error:
            refused[place] = str(error)
    return by_suite, refused


def rank(suite: str, folders: list[Path]) -> tuple[pd.DataFrame, dict[Path, str]]:
    """The ranking of a suite's released methods and those of folders, gaps in per cent, and why
    some of the folders are left out."""
    import pandas as pd

    from coartic.analysis.report.contents import TABLES
    from coartic.analysis.study import load
    from coartic.benchmarks.merge import gather
    from coartic.benchmarks.released import RELEASED, results_folder
    from coartic.runs.store import open_store

    try:
        with tempfile.TemporaryDirectory() as made, results_folder(RELEASED, suite) as released:
            said = gather(released, folders, Path(made) / "all")
            ranking = TABLES["ranking"](load(Path(made) / "all"))
            with open_store(released) as store:
                known = store.plan().methods
    except CoarticError as error:  # nothing of this suite is released
        return pd.DataFrame(), dict.fromkeys(folders, str(error))
    origin: dict[str, str] = {}
    for folder in folders:
        if not said[folder]:
            with open_store(folder) as store:
                origin |= {name: folder.name for name in store.plan().methods if name not in known}
    gaps = {name: 100 * ranking[column] for name, column in GAPS.items()}
    table = pd.DataFrame({"suite": suite, "method": ranking.method, "knows": ranking.knows, **gaps})
    table["submitted"] = [origin.get(method, "") for method in ranking.method]
    for name in ("better", "worse", "runs"):
        table[name] = ranking[name].astype("Int64")
    table = table[table.gap.notna() | (table.submitted != "")]
    return table, {folder: reason for folder, reason in said.items() if reason}
