"""Markdown pages with numbers from tables, and the files of a study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from coartic.analysis.signatures.measures import SIGNATURES
from coartic.analysis.study import Study
from coartic.analysis.words import interval, listed, number, p_value
from coartic.errors import CoarticError
from coartic.internal.arguments import checked_arguments

PAGE = "README.md.jinja"
"""Name of the template of a study's page."""
_OF_RUN = [
    *("run_id", "task", "method", "setting", "run", "seed", "status", "trials", "reward", "hands"),
    *("replay_reward", "replay_hands", "initial_reward", "corrective_best", "best_known"),
]
"""Columns of runs that a study ships."""


@checked_arguments
def tabulate_runs(study: Study) -> pd.DataFrame:
    """Return a row for each run of a study, by ``run_id``, with its task, method, seed, rewards
    (minus ticks), hands and signatures of coarticulation: of the solution (``first``, ``arm``, ...)
    and, if runs have a replay, of the noiseless trial after learning (``replay_first``, ...).
    Columns without a value are left out.
    """
    runs = study.runs[_OF_RUN].assign(
        **{name.replace(" ", "_"): study.signature(name) for name in SIGNATURES}
    )
    if runs.replay_reward.notna().any():
        for name in SIGNATURES:
            runs[f"replay_{name}".replace(" ", "_")] = study.signature(name, replay=True)
    return runs.set_index("run_id").dropna(axis="columns", how="all")


@checked_arguments
def write_study(
    folder: str | Path, tables: dict[str, pd.DataFrame], draw: Callable[[pd.DataFrame], Any]
) -> None:
    """Write tables, figure and page of a study into its folder.

    Parameters
    ----------
    folder : str or pathlib.Path
        The study's folder, with a template ``README.md.jinja``. :func:`fill_page` makes the page
        ``README.md`` from it and all CSV files of the folder, each a table named like its file.
    tables : dict
        Tables by name; table ``results`` becomes ``results.csv``, and ``runs``, which the page does
        not read, ``runs.csv.xz``. Other CSV files of the folder stay as they are.
    draw : callable
        Function of table ``results``, as read from its file, that returns the figure (Matplotlib)
        to be written as ``figure.svg``.

    Raises
    ------
    CoarticError
        The folder has no template, or no ``results.csv`` and no table ``results`` for it.

    Examples
    --------
    The last lines of a ``study.py`` whose function ``measure`` makes the tables::

        if __name__ == "__main__":
            study = coartic.analysis.load(sys.argv[1])
            write_study(Path(__file__).parent, measure(study), draw)
    """
    from coartic.analysis.figures import picture

    folder = Path(folder)
    if not (folder / PAGE).is_file():
        raise CoarticError(f"{folder} is no folder of a study: it has no {PAGE}")
    for name, table in tables.items():
        file = f"{name}.csv{'.xz' if name == 'runs' else ''}"
        table.to_csv(folder / file, float_format="%.6g")
    stored = {path.stem: pd.read_csv(path, index_col=0) for path in folder.glob("*.csv")}
    if "results" not in stored:
        raise CoarticError(f"{folder} has no results.csv: give a table 'results'")
    (folder / "figure.svg").write_bytes(picture(draw(stored["results"]), ".svg"))
    page = fill_page(folder / PAGE, **stored)
    (folder / "README.md").write_text(page, encoding="utf-8")


@checked_arguments
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
        There is no such template, or ``interval`` or ``number`` gets a wrong argument, such as a
        row without the numbers or, for ``number``, an unknown name.
    ValueError
        A sentence that the template expects of the results does not hold, or ``listed`` gets no
        words.
    jinja2.TemplateError
        The template is wrong, or otherwise uses an unknown name.
    """
    import jinja2

    template = Path(template)
    if not template.is_file():
        raise CoarticError(f"there is no file {template}")

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
    """Return an empty text if ``holds``, a condition of a sentence of the page, is True. Raises
    ValueError with the words ``what`` if it is False."""
    if not holds:
        raise ValueError(f"this no longer holds: {what}")
    return ""
