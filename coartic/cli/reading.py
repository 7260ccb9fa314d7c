"""Commands that read what stored runs say."""

from __future__ import annotations

import time
from dataclasses import replace as replace_field
from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.arguments import endings_in, labels_in
from coartic.cli.terminal import if_interrupted, say, show_data, show_table, writing
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.text import counted

GROUP = "Read"
PROCESSES = -1
"""That draw the figures of a report: one a core."""


def analyse(folder: given.ResultsFolder) -> None:
    """Signatures, claims, methods compared, and the reward-compute frontier of a folder."""
    if_interrupted(f"nothing is written in {folder}")  # also not while this is imported
    from coartic.analysis.report.analyses import analyse as pages_of
    from coartic.analysis.study import load
    from coartic.files import publish

    study = load(folder)
    files = pages_of(study)
    writing(folder)
    publish(folder, files, owner="analyse", alone=False)
    if_interrupted(f"all files are written in {folder}")
    show_table(
        "Claims",
        ("claim", "verdict", "statement"),
        [
            (entry.claim.id, entry.verdict + " †" * entry.claim.fitted, entry.claim.statement)
            for entry in study.judged
        ],
    )
    untold = sum(entry.verdict == "cannot tell" for entry in study.judged)
    say(
        f"{untold} of {counted(len(study.judged), 'claim')} cannot be told by these runs; why is "
        "in claims.md. † rests on a reconstructed task.",
        f"In {folder}: {', '.join(files)}.",
    )


_Other = Annotated[
    Path | None,
    typer.Argument(
        parser=folder_named, metavar="[DIR_B]", help="A second one, to stand beside it."
    ),
]
_ReportFolder = Annotated[
    Path | None,
    typer.Option(parser=folder_named, help="Folder to write; DIR/report by default."),
]
_Shown = Annotated[
    str | None,
    typer.Option(
        help="Methods that the figures show, labels as in the tables: a,b, "
        "'\"a x=1, y=2\",b' with parameters."
    ),
]
_Formats = Annotated[str, typer.Option(help="Files of each figure: svg and any of pdf, png, csv.")]
_Printed = Annotated[
    bool, typer.Option("--pdf", help="Also the page as report.pdf, by a browser that is here.")
]


def report(
    folder: given.Results,
    other: _Other = None,
    out: _ReportFolder = None,
    methods: _Shown = None,
    formats: _Formats = "pdf,svg,png,csv",
    pdf: _Printed = False,
) -> None:
    """Write a report: page with player, tables, figures, numbers for LaTeX, traces.

    A folder that holds anything else than an earlier report, unchanged, is refused. With a
    second results folder, or an archive, the page begins with both side by side.
    """
    if out is None:
        out = (folder.with_suffix("") if folder.is_file() else folder) / "report"
    if_interrupted(f"nothing is written in {out}")  # also not while this is imported
    from coartic.analysis.figures.plot import FILES
    from coartic.analysis.report.beside import beside
    from coartic.analysis.report.build import build, write
    from coartic.analysis.report.write import check_report_folder
    from coartic.analysis.results.archive import opened
    from coartic.analysis.study import load

    started = time.monotonic()
    endings = endings_in(formats, FILES)
    labels = None if methods is None else labels_in(methods, "--methods")
    with opened(folder) as first, opened(folder if other is None else other) as second:
        study, against = load(first), None if other is None else load(second)
        check_report_folder(out, first)
        made = build(study, labels, endings, processes=PROCESSES)
        if against is not None:
            made = replace_field(made, document=beside(made.document, study, against))
        write(made, study, out, printed=pdf, begin=lambda: writing(out))
    if_interrupted(f"the report is written in {out}")
    took, tables = time.monotonic() - started, counted(len(made.document.tables()), "table")
    say(
        f"{out / 'report.html'} is the report, made in {took:.0f} s. Beside it: report.md, "
        f"{'report.pdf, ' * pdf}{tables} (tables/, CSV and LaTeX), "
        f"{counted(len(made.pictures.plots), 'figure')} (figures/, as {formats}), numbers.tex."
    )


def pack(
    folder: given.ResultsFolder,
    out: Annotated[
        Path | None, typer.Option(help="Archive to write (.zip); DIR.zip by default.")
    ] = None,
    replace: given.Replace = False,
) -> None:
    """Write a results folder into one file, with checksums, for others to read and compare.

    It holds tables and records alone, and nothing that runs when it is opened.
    """
    from coartic.analysis.results.archive import pack as packed

    named = folder if folder.name.strip(".") else folder.resolve()  # not . or ..
    path = named.parent / f"{named.name}.zip" if out is None else out
    if not path.name.lower().endswith(".zip"):
        raise CoarticError(f"--out {path}: the name must end in .zip")
    if_interrupted(f"nothing is written in {path}")
    digest = packed(folder, path, replace=replace)
    size = path.stat().st_size / 1e6
    say(f"{path} holds the results ({size:.1f} MB). SHA-256 of its list: {digest}.")
    say(f"`coartic verify {path}` checks it, `coartic report {path}` reports it.")


def verify(folder: given.Results) -> None:
    """Check a results folder or an archive: checksums, tables, every solution executed again."""
    from coartic.analysis.results.archive import opened
    from coartic.analysis.results.folder import load_results

    with opened(folder) as found:
        results = load_results(found)
        runs, cells = counted(len(results.runs), "run"), counted(len(results.cells), "cell")
        suite = results.manifest.specification.suite
    say(
        f"{folder} agrees with itself: {runs} of suite {suite}, {cells}. Tables follow from the "
        "records, and every solution, executed again, gets the reward that is stored."
    )
    say("That the runs were made as they say, only doing them again shows: `coartic reproduce`.")


def trace(
    name: Annotated[
        str, typer.Argument(help="Macro of numbers.tex, id of a table, or a file as pareto.csv.")
    ],
    row: Annotated[
        str | None, typer.Argument(help="Row: its key, as `coartic trace NAME` lists them.")
    ] = None,
    column: Annotated[str | None, typer.Argument(help="Column of the table's CSV.")] = None,
    folder: Annotated[
        Path, typer.Option("--in", help="Report, its results folder, or a folder above.")
    ] = Path("results"),
) -> None:
    """Say which runs, code and command are behind a number of a report, or of a CSV file."""
    from coartic.analysis.report.trace import find_trace, trace_text

    where = [part for part in (row, column) if part is not None]
    say(*trace_text(find_trace(folder, name, where)).split("\n"))


def compare(
    first: Annotated[
        Path, typer.Argument(parser=folder_named, metavar="DIR_A", help="Results folder A.")
    ],
    second: Annotated[
        Path, typer.Argument(parser=folder_named, metavar="DIR_B", help="Results folder B.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Page to write (.md), with a table beside it (.csv).")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Table to write (.csv).")] = None,
    replace: given.Replace = False,
) -> None:
    """Compare two results folders cell by cell: versions, machines, parameters."""
    from coartic.analysis.comparisons.versions import compare_versions, load_pair
    from coartic.analysis.report.formats.markdown import markdown
    from coartic.analysis.report.pages.versions import versions_document
    from coartic.analysis.report.tables.files import csv_text
    from coartic.analysis.report.tables.layout import LAYOUTS
    from coartic.analysis.results.archive import opened
    from coartic.files import check_outputs, write_outputs

    for path, option, ending in ((out, "--out", ".md"), (csv, "--csv", ".csv")):
        if path is not None and path.suffix.lower() != ending:
            raise CoarticError(f"{option} {path}: the name must end in {ending}")
    if out is not None and csv is None:
        csv = out.with_suffix(".csv")
    check_outputs(filter(None, (out, csv)), replace=replace)
    with opened(first) as a, opened(second) as b:
        found = replace_field(compare_versions(*load_pair(a, b)), folders=(first, second))
    document = versions_document(found)
    texts = {out: markdown(document, tables=""), csv: csv_text(LAYOUTS["versions"], found.cells)}
    written = {path: text.encode() for path, text in texts.items() if path is not None}
    write_outputs(written, replace=replace)
    show_data(document.tables(), f"see {out}" if out else "--out PAGE.md has all")
    say(*found.summary)
    if written:
        say(f"In {' and '.join(map(str, written))}.")


def cite(
    folder: Annotated[
        Path | None,
        typer.Argument(parser=folder_named, help="Results folder; all built-in methods without."),
    ] = None,
    style: Annotated[str, typer.Option("--format", help="Only bibtex.")] = "bibtex",
    analysis: Annotated[
        bool, typer.Option("--analysis", help="Also works behind statistics and signatures.")
    ] = False,
) -> None:
    """Print what to cite: the software, the paper, and the methods of a results folder."""
    from coartic.analysis.citations import MethodSource, bibliography
    from coartic.benchmarks.registry import CLASSES
    from coartic.record import BUILT_IN

    if style != "bibtex":
        raise CoarticError(f"--format {style}: the one format is bibtex")
    environment = None
    if folder is None:
        methods = [
            MethodSource(item.name, item.title, item.citation, True) for item in CLASSES.values()
        ]
    else:
        from coartic.analysis.results.folder import load_results  # and pandas

        manifest = load_results(folder).manifest
        environment = manifest.environment.model_dump(mode="json")
        methods = [
            MethodSource(name, item.title, item.citation, item.origin == BUILT_IN)
            for name, item in manifest.specification.methods.items()
        ]
    text = bibliography(methods, analysis=analysis, environment=environment)
    say(*text.rstrip("\n").split("\n"))


COMMANDS = (analyse, report, trace, compare, pack, verify, cite)
