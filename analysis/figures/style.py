"""Define the style of all figures: sizes, colours and markers.

The colours of ``PALETTE`` are those of Okabe & Ito (2008), Color Universal Design, without black
and yellow. Methods have their own colours (:data:`.COLORS`), markers and dashes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_params_from_file, style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from coartic import estimates
from coartic.analysis.frames import checked
from coartic.analysis.methods import COLORS, LOOKS, MARKS

INCH = 25.4  # mm
ONE = 89 / INCH
"""Width of one journal column, in inches."""
TWO = 183 / INCH
"""Width of two journal columns, in inches."""
TALLEST = 225 / INCH
"""Largest height (in inches) of a figure that leaves room for a caption on the page."""
_STYLE = Path(__file__).with_name("paper.mplstyle")
RC: Any = dict(rc_params_from_file(_STYLE, use_default_template=False))
"""Settings of Matplotlib (rcParams) for all figures."""
MIN_PANEL, MIN_SMALL_PANEL, MIN_DOTS = 2.2, 1.6, 0.8
"""Smallest widths, in inches, of panels that are side by side in a figure whose width is set
(:func:`drawn_at`): of panels with names to their left, of panels without such names, and of the
panels of a dot plot, which share the names of their rows."""
_width: ContextVar[float | None] = ContextVar("width", default=None)
COVERAGE = f"{100 * estimates.CONFIDENCE:.0f} %"
"""Coverage of the confidence intervals, for captions."""
BACKGROUND = "#ffffff"
TIP = "tip:"
"""Prefix of the group id (gid) of a mark that has a :func:`tip`."""
BLUE, SKY, GREEN, ORANGE = "#0072b2", "#56b4e9", "#009e73", "#e69f00"
VERMILLION, PURPLE, GREY, INK = COLORS["rust"], "#cc79a7", "#6b6b6b", COLORS["ink"]
PALETTE = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY)
OPTIMUM: Any = {"color": INK, "linewidth": 0.8, "linestyle": (0, (1, 1.2))}
INITIAL: Any = {"color": GREY, "linewidth": 0.8, "linestyle": (0, (5, 1.2, 1, 1.2))}
"""Looks of the line at the best known reward, and of the line at the reward of the corrective
process alone with its best hands: arguments of Matplotlib."""
styled = style.context(["default", RC])
"""Decorator of a drawing function. The function then draws with Matplotlib's defaults and the
settings :data:`RC`, whatever the settings of the user are."""


Look = dict[str, Any]
"""Look of a method's lines and markers: arguments of Matplotlib's ``plot``."""


def look_of(method: str) -> Look:
    """Return the colour, the marker and the line style of a built-in method.

    Parameters
    ----------
    method : str
        Id of a built-in method, such as ``"cma-es/bandit"``. Only the methods that represent their
        algorithms (column ``headline`` of :attr:`.Study.methods`) have a look.

    Returns
    -------
    dict
        ``color``, ``marker`` and ``linestyle``: arguments of Matplotlib's ``plot``.

    Raises
    ------
    KeyError
        The method has no look.

    Examples
    --------
    >>> look = look_of("cma-es/bandit")
    >>> look["color"], look["marker"]
    ('#5bb8ea', 'o')
    """
    color, mark = LOOKS[method]
    return {"color": COLORS[color], "marker": MARKS[mark][0], "linestyle": MARKS[mark][1]}


def grid(panels: int) -> tuple[int, int]:
    """Return the numbers of rows and columns in which panels are arranged.

    ``panels`` is the number of panels. A single panel has one column, two to six panels have two
    columns, and more panels have three columns.
    """
    columns = min(2 if panels <= 6 else 3, panels)
    return -(-panels // columns), columns


@contextmanager
def drawn_at(width: float | None) -> Iterator[None]:
    """Set the width (in inches) of the figures that :func:`panels` makes in a ``with`` block.

    If ``width`` is None, each figure has the width that is passed to :func:`panels` as ``size``.
    """
    before = _width.set(width)
    try:
        yield
    finally:
        _width.reset(before)


def is_narrow() -> bool:
    """Return True if figures are drawn with a width below five inches (:func:`drawn_at`)."""
    return (_width.get() or TWO) < 5


def panels(
    shape: tuple[int, int],
    size: tuple[float, float],
    used: int | None = None,
    least: float = MIN_PANEL,
    **subplots: Any,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels.

    If :func:`drawn_at` has set a width, the figure has this width. If the panels would then be
    narrower than ``least``, they are arranged in fewer columns. The height of the figure is
    proportional to the number of rows.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns of panels.
    size : (float, float)
        Width and height, in inches. ``ONE`` and ``TWO`` are the widths of one and two columns of a
        journal.
    used : int, optional
        Number of panels that are used, by default all. The other panels are not drawn.
    least : float
        Smallest width (in inches) of panels side by side, if a width is set.
    **subplots
        Arguments of Matplotlib's ``Figure.subplots``, such as ``sharey=True``.

    Returns
    -------
    (Figure, list of Axes)
        The figure, and the panels that are used, row by row.
    """
    used = used or shape[0] * shape[1]
    if (width := _width.get()) is not None:
        columns = min(shape[1], max(1, int(width // least)))
        rows = -(-used // columns)
        shape, size = (rows, columns), (width, size[1] * rows / shape[0])
    figure = Figure(figsize=size, layout="constrained")
    all_axes = figure.subplots(*shape, squeeze=False, **subplots).ravel().tolist()
    for axes in all_axes[used:]:
        axes.set_axis_off()
    return figure, all_axes[:used]


def name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Write names to the left of rows at y = 0, -1, -2, ..."""
    axes.set_yticks([-place for place in range(len(names))], names)
    axes.set_ylim(-len(names) + 0.4, 0.6)
    axes.tick_params(axis="y", length=0)


def legend(figure: Figure, handles: Sequence[Artist], columns: int, **more: Any) -> None:
    """Draw a legend below all panels of a figure.

    If the legend has more than two lines, the figure becomes taller.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    handles : sequence of matplotlib.artist.Artist
        Entries of the legend: artists with labels.
    columns : int
        Number of columns of the legend. If the figure is too narrow for the labels, there are
        fewer columns.
    **more
        Arguments of Matplotlib's ``Figure.legend``.
    """
    widths = [0.45 + 0.06 * len(str(handle.get_label())) for handle in handles]  # inches
    while columns > 1:
        if (
            sum(max(column, default=0) for column in np.array_split(widths, columns))
            <= figure.get_figwidth()
        ):
            break
        columns -= 1
    lines = -(-len(handles) // columns)
    figure.set_figheight(figure.get_figheight() + 0.15 * max(0, lines - 2))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, **more)


def means(
    axes: Axes,
    frame: pd.DataFrame,
    *,
    x: str,
    y: str,
    by: str = "",
    scale: float = 1.0,
    shift: float = 0.0,
    bars: float | None = 0.8,
    **line: Any,
) -> None:
    """Draw means as points with intervals, and a line for each group.

    No legend is drawn (:func:`legend`).

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes to draw on.
    frame : DataFrame
        A row for each mean, such as the table of :func:`coartic.analysis.means`. Intervals are
        drawn if the ends of the intervals of column ``y`` are in columns whose names are ``y`` with
        the endings ``_low`` and ``_high``.
    x, y : str
        Names of the columns with the x coordinates and with the means.
    by : str
        Name of the column that says to which group a row belongs. Each group is drawn as a line
        with a label of its own; a row with NaN in this column is not drawn. The lines have the
        colours of ``PALETTE`` in turn, unless ``line`` contains ``color``. If ``by`` is empty, all
        rows belong to one line without a label.
    scale : float
        Factor by which means and intervals are multiplied: 100 turns a fraction into per cent.
    shift : float
        Distance of each line to the right of the previous line, in units of ``x``.
    bars : float, optional
        Line width of the intervals, in points; None for Matplotlib's line width.
    **line
        Look of the lines and their markers: arguments of Matplotlib's ``plot``.

    Raises
    ------
    CoarticError
        The frame is not a DataFrame or has no rows, a column is missing, or a value in ``x``, ``y``
        or an end of an interval is neither a finite number nor NaN.
    """
    ends = [f"{y}_low", f"{y}_high"] if f"{y}_low" in getattr(frame, "columns", ()) else []
    checked(frame, numbers=[x, y, *ends], others=([by] if by else []))
    frame = frame.reset_index(drop=True)
    groups = frame.groupby(by, sort=False) if by else [("", frame)]
    for number, (color, (name, rows)) in enumerate(
        zip(itertools.cycle(PALETTE), groups, strict=False)
    ):
        looks: Look = {"color": color, "marker": "o", "markersize": 3, "linewidth": 1.2}
        looks |= ({"label": str(name)} if by else {}) | line
        places = rows[x] + number * shift
        if ends:
            low, high = (scale * rows[end] for end in ends)
            axes.vlines(places, low, high, looks["color"], linewidth=bars)
        axes.plot(places, scale * rows[y], **looks)


def dots(
    rows: pd.DataFrame,
    quantities: Mapping[str, str],
    lines: Mapping[str, float | Sequence[float]],
) -> Figure:
    """Return a dot plot: a row for each name, a panel for each quantity.

    Parameters
    ----------
    rows : DataFrame
        A row for each row of the plot, from top to bottom, with the columns

        - ``name``: name that is written to the left of the row;
        - ``color`` and ``marker``: colour and marker in the form that Matplotlib accepts;
        - ``bold``: True to write the name in bold type;
        - a column for each quantity. If the quantity has intervals, their ends are in columns whose
          names have the endings ``_low`` and ``_high``. NaN stands for a missing dot or interval.
    quantities : mapping of str to str
        Maps the column of each quantity to the label of the axis of its panel.
    lines : mapping of str to float or sequence of float
        Maps columns of quantities to the values at which their panels have dashed vertical lines.
        NaN, and names that are not in ``quantities``, are ignored.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.
    """
    height = 0.55 + (0.135 if is_narrow() else 0.165) * len(rows)
    size = TWO, height + 0.1 * sum(name.count("\n") for name in rows.name)
    drawing, all_axes = panels((1, len(quantities)), size, None, MIN_DOTS, sharey=True)
    for axes, (name, label) in zip(all_axes, quantities.items(), strict=True):
        axes.axvline(0, color=GREY, linewidth=0.5)
        axes.grid(axis="y", color=GREY, alpha=0.3, linewidth=0.5)
        for value in np.atleast_1d(lines.get(name, math.nan)):
            if not math.isnan(value):
                axes.axvline(value, color=INK, linewidth=0.8, linestyle=(0, (4, 2)))
        for place, row in enumerate(rows.to_dict("records")):
            look: Any = {"color": row["color"], "clip_on": False}
            ends = row.get(f"{name}_low", math.nan), row.get(f"{name}_high", math.nan)
            axes.hlines(-place, *ends, linewidth=2, alpha=0.6, color=row["color"])
            (dot,) = axes.plot(row[name], -place, row["marker"], **look, markersize=4.2)
            tip(dot, f"{row['name']}: {row[name]:.2f}".replace("\n", " "))
        axes.set_xlabel(label.partition("\n")[0] if is_narrow() else label)
        axes.tick_params(axis="y", length=0)
    name_rows(all_axes[0], [*rows.name])
    for text, is_bold in zip(all_axes[0].get_yticklabels(), rows.bold, strict=True):
        text.set_fontweight("bold" if is_bold else "normal")
    if len(all_axes) > 1:
        letters(all_axes)
    return drawing


def tip(artist: Artist, text: str) -> None:
    """Set the text that HTML pages show when the pointer rests on a mark.

    Matplotlib stores the text as the mark's group id (gid), which is replaced.
    """
    artist.set_gid(f"{TIP}{text}")


def legend_line(label: str, **line: Any) -> Line2D:
    """Return an entry for a legend: a line or marker with its label.

    ``line`` are arguments of Matplotlib's ``Line2D``, which set the look of the entry.
    """
    return Line2D([], [], label=label, **line)


def log_axis(axes: Axes) -> None:
    """Make the x axis logarithmic, with labels such as 1, 100, 1k and 1M.

    A label of 100m stands for 0.1. Minor ticks are at 2 and 5 times each power of ten.
    """
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(LogLocator(subs=(2, 5)))


def letters(panels: Iterable[Axes], pad: float | None = None) -> None:
    """Write the letters a, b, ... z before the left-aligned titles of panels.

    ``pad`` is the distance of the titles from the axes, in points; None stands for Matplotlib's
    setting. Panels after the 26th get no letter.
    """
    for letter, axes in zip(ascii_lowercase, panels, strict=False):
        axes.set_title(f"{letter}  {axes.get_title(loc='left')}", loc="left", pad=pad)
