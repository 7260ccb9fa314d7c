"""Write the tables, the figure and the page of a study, and a suite of its missing controls."""

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
"""File name of the template of a study's page."""
_OF_RUN = [
    *("run_id", "task", "method", "setting", "run", "seed", "status", "trials", "reward", "hands"),
    *("replay_reward", "replay_hands", "initial_reward", "corrective_best", "best_known"),
]
"""Columns of ``study.runs`` that are stored with a study."""


def tabulate_runs(study: Study) -> pd.DataFrame:
    """Return a table of a study's runs with their signatures of coarticulation.

    Parameters
    ----------
    study : Study
        Results of the study.

    Returns
    -------
    DataFrame
        A row for each run, indexed by its id, with columns for the task, the method and its
        setting, the number and the seed of the run, its status, trials, rewards (negative ticks)
        and hands, and the signatures of the solution (``first``, ``arm``, ...). If at least one run
        has a replay, which is a trial without noise after learning, there are also columns for the
        signatures of replays (``replay_first``, ...). Columns without a value are left out.
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
    """Write the tables, the figure and the page of a study into its folder.

    Parameters
    ----------
    folder : str or pathlib.Path
        The study's folder, which must have a template ``README.md.jinja``. The page ``README.md``
        is made from this template and from all files ``*.csv`` of the folder (:func:`fill_page`).
        The name of a file without ``.csv`` is the name of its table in the template.
    tables : dict of str to DataFrame
        Dict that maps the name of each table to the table. Each table is written into a file with
        its name, such as ``results.csv``. Table ``runs`` is compressed into ``runs.csv.xz``, which
        the page does not read. Other CSV files of the folder are kept.
    draw : callable
        Function that returns a Matplotlib figure, which is written as ``figure.svg``. Its argument
        is the table ``results``, as read from its file.

    Raises
    ------
    CoarticError
        The folder has no template, or neither the folder nor ``tables`` has a table ``results``.
        The errors of :func:`fill_page` are raised, too.

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
    """Draw a figure in the font that comes with Matplotlib, and return it as SVG.

    With this font, stored figures do not depend on the fonts of a machine.

    Parameters
    ----------
    draw : callable
        Function that returns a Matplotlib figure.
    *arguments, **options
        Arguments with which ``draw`` is called.

    Returns
    -------
    bytes
        Content of the SVG file.
    """
    with patch.dict(style.RC, {"font.sans-serif": ["DejaVu Sans"]}):
        return picture(draw(*arguments, **options), ".svg")


def fill_page(template: str | Path, **values: Any) -> str:
    """Fill in a Jinja template with tables and numbers, and return the page.

    Parameters
    ----------
    template : str or pathlib.Path
        File of the template. In the template you can

        - call ``interval(row, column, digits, scale)``, which returns a string such as
          ``7.8 [7.3, 8.1]`` (:func:`coartic.analysis.interval`);
        - call ``expect(holds, what)``, which raises ValueError if a condition is false
          (:func:`expect`);
        - use the filters ``number``, ``p_value`` and ``listed`` of :mod:`coartic.analysis.words`;
        - include templates of the same folder.
    **values
        Tables, numbers and functions. The name of each argument is its name in the template.

    Returns
    -------
    str
        The page.

    Raises
    ------
    CoarticError
        The template does not exist, or ``interval`` or ``number`` gets a wrong argument. For
        example, the row lacks one of the numbers of the interval.
    ValueError
        A condition of ``expect`` is false, or ``listed`` gets no words.
    jinja2.TemplateError
        The template has an error, or uses an unknown name.
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
    """Raise ValueError if a condition on which a page relies is false.

    Parameters
    ----------
    holds : bool
        The condition.
    what : str
        The condition in words, for the error message.

    Returns
    -------
    str
        The empty string, which a template can print.

    Raises
    ------
    ValueError
        ``holds`` is false.
    """
    if not holds:
        raise ValueError(f"this no longer holds: {what}")
    return ""


def control_suite(study: Study, *, runs: int = 20) -> str:
    """Return a suite of the random-search runs that a study lacks as controls of signatures.

    The suite contains a block for each method that can select its solution from trials, each task,
    and each hand sequence that occurs in at least a tenth of the method's solved runs on the task.
    In this block, random search uses the hand sequence, makes as many trials as the method, and
    adds noise to the idle arm if the method does so. Blocks whose runs the study already contains
    are left out. The control of the signature ``hand``, which is random search that tries all hand
    sequences, is not in the suite.

    Parameters
    ----------
    study : Study
        Results with runs of learners.
    runs : int
        Number of runs of each cell.

    Returns
    -------
    str
        The suite as TOML; the empty string if no control is missing. Write it into a file and run
        it together with the results of the study: ``coartic run control.toml --include FOLDER``.
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
