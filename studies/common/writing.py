"""Write the tables and the page of a study, and a suite of its missing control runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import jinja2
import pandas as pd

from coartic import CoarticError
from coartic.analysis import SIGNATURES, Study, interval, number
from coartic.analysis.control import MIN_SHARE, control_of, explores_idle_arm, selects
from coartic.analysis.figures import picture, style
from coartic.analysis.study import solved
from coartic.analysis.words import listed, p_value

PAGE = "README.md.jinja"
"""Name of the template of a study's page."""
_OF_RUN = [
    *("run_id", "task", "method", "setting", "run", "seed", "status", "trials", "reward", "hands"),
    *("replay_reward", "replay_hands", "initial_reward", "corrective_best", "best_known"),
]
"""Columns of runs that are stored with a study."""


def tabulate_runs(study: Study) -> pd.DataFrame:
    """Return a table of a study's runs and their signatures of coarticulation.

    Parameters
    ----------
    study : Study
        Results of the study.

    Returns
    -------
    DataFrame
        One row for each run: task, method, seed, rewards (in negative ticks), hands, and signatures
        of the solution (``first``, ``arm``, ...). If runs have a replay, a noiseless trial after
        learning, the frame also has its signatures (``replay_first``, ...). Columns without a value
        are left out.
    """
    runs = study.runs[_OF_RUN].assign(
        **{each.column: study.signature(name) for name, each in SIGNATURES.items()}
    )
    if runs.replay_reward.notna().any():
        for name, each in SIGNATURES.items():
            runs[f"replay_{each.column}"] = study.signature(name, replay=True)
    tabulated: pd.DataFrame = runs.set_index("run_id").dropna(axis="columns", how="all")
    return tabulated


def write_study(
    folder: str | Path, tables: dict[str, pd.DataFrame], draw: Callable[[pd.DataFrame], Any]
) -> None:
    """Write tables, figure and page of a study into its folder.

    Parameters
    ----------
    folder : str or pathlib.Path
        The study's folder, with a template ``README.md.jinja``. :func:`fill_page` makes the page
        ``README.md`` from it and from all CSV files of the folder, each a table named like its
        file.
    tables : dict
        Tables by name. Table ``results`` becomes ``results.csv``. Table ``runs``, which the page
        does not read, becomes ``runs.csv.xz``. Other CSV files of the folder stay as they are.
    draw : callable
        Function of table ``results``, as read from its file, that returns the figure (Matplotlib)
        to be written as ``figure.svg``.

    Raises
    ------
    CoarticError
        If the folder has no template, or there is neither ``results.csv`` nor a table ``results``.

    Examples
    --------
    The last lines of a ``study.py`` whose function ``measure`` makes the tables::

        if __name__ == "__main__":
            study = coartic.analysis.load(sys.argv[1])
            write_study(Path(__file__).parent, measure(study), draw)
    """
    folder = Path(folder)
    if not (folder / PAGE).is_file():
        raise CoarticError(f"{folder} has no template {PAGE}; the study's folder needs it")
    for name, table in tables.items():
        file = f"{name}.csv{'.xz' if name == 'runs' else ''}"
        table.to_csv(folder / file, float_format="%.6g")
    stored = {path.stem: pd.read_csv(path, index_col=0) for path in folder.glob("*.csv")}
    if "results" not in stored:
        raise CoarticError(
            f"{folder} has no results.csv, and tables has no 'results'; one of the two is needed"
        )
    (folder / "figure.svg").write_bytes(stored_picture(draw, stored["results"]))
    page = fill_page(folder / PAGE, **stored)
    (folder / "README.md").write_text(page, encoding="utf-8")


def stored_picture(draw: Callable[..., Any], *arguments: Any, **options: Any) -> bytes:
    """Return a figure as SVG in the font that Matplotlib brings along.

    Stored figures have this font, so that they are the same on every machine.

    Parameters
    ----------
    draw : callable
        Function that returns the figure (Matplotlib).
    *arguments, **options
        Arguments of ``draw``.

    Returns
    -------
    bytes
        Content of the SVG file.
    """
    with patch.dict(style.RC, {"font.sans-serif": ["DejaVu Sans"]}):
        return picture(draw(*arguments, **options), ".svg")


def fill_page(template: str | Path, **values: Any) -> str:
    """Return a page that a Jinja template makes from tables and numbers.

    Parameters
    ----------
    template : str or pathlib.Path
        A Jinja template. The template can call ``interval(row, column, digits, scale)``, which
        writes ``7.8 [7.3, 8.1]``, and ``expect(holds, what)``, use the filters ``number``,
        ``p_value`` and ``listed``, and include templates of the same folder.
    **values
        Tables, numbers and functions, by the names that the template uses.

    Returns
    -------
    str
        The page.

    Raises
    ------
    CoarticError
        If there is no such template, or ``interval`` or ``number`` gets a wrong argument, such as
        a row without the numbers.
    ValueError
        If a condition of ``expect`` is false, or ``listed`` gets no words.
    jinja2.TemplateError
        If the template is wrong or uses an unknown name.
    """
    template = Path(template)
    if not template.is_file():
        raise CoarticError(f"template {template} does not exist")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals |= {"interval": interval, "expect": expect, **values}
    environment.filters |= {"number": number, "p_value": p_value, "listed": listed}
    return environment.get_template(template.name).render()


def expect(holds: bool, what: str) -> str:
    """Return an empty string if the condition ``holds`` of a sentence of the page is true.

    Raises ValueError with the words ``what`` if it is false.
    """
    if not holds:
        raise ValueError(f"this no longer holds: {what}")
    return ""


def control_suite(study: Study, *, runs: int = 20) -> str:
    """Return a suite with the runs of random search that a study lacks as controls of signatures.

    The suite has random search for each method that can select its solution by rewards, on each
    task, with as many trials as the method. The idle arm has noise if the method adds noise to it.
    There is a block for each hand sequence that at least a tenth of the method's solved runs have.
    Controls that the study already has are left out. The control of signature ``hand`` (random
    search that tries all hand sequences) is not in the suite.

    Parameters
    ----------
    study : Study
        Results with learners.
    runs : int
        Runs of each cell.

    Returns
    -------
    str
        The suite as TOML; empty if nothing is missing. Write it to a file and run it with the
        results of the study: ``coartic run control.toml --include FOLDER``.
    """
    blocks = dict[tuple[str, str, int, bool], None]()
    for (task, label), of_method in study.cells.items():
        if not selects(study, label):
            continue
        trials = int(of_method.trials.fillna(0).max())
        explored = explores_idle_arm(study, task, label)
        for hands, share in solved(of_method).hands.value_counts(normalize=True).items():
            if share >= MIN_SHARE and not control_of(study, task, label, str(hands), alike=True):
                blocks[task, str(hands), trials, explored] = None
    lines = [
        'title = "Random search with the hands of learners"',
        'description = "The control of signatures where results lack it."',
        f"runs = {runs}",
    ]
    lines += [
        f'\n[[blocks]]\ntasks = ["{task}"]\nmethods = ["random-search"]\n'
        f'parameters = {{ hands = "{hands}", trials = {trials}'
        f"{'' if explored else ', idle_arm = false'} }}"
        for task, hands, trials, explored in blocks
    ]
    return "\n".join(lines) + "\n" if blocks else ""
