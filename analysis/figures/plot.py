"""Make figures of the report with their captions and numbers, and write them to files."""

from __future__ import annotations

import html
import io
import re
import textwrap
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rc_context
from matplotlib import style as styles
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from coartic.analysis.figures import style
from coartic.analysis.figures.style import RC, drawn_at
from coartic.analysis.methods import (
    COLORS,
    KINDS,
    MARK,
    MARKS,
    default_name,
    describe_values,
)
from coartic.analysis.standings import reference
from coartic.analysis.study import Study, check_study, ending_of, when_of
from coartic.analysis.words import RECONSTRUCTED, capital, id_of, number
from coartic.errors import CoarticError
from coartic.internal.files import describe_os_errors
from coartic.internal.limits import brief_value
from coartic.internal.text import one_line
from coartic.internal.threads import environment
from coartic.runs.plan import world_title

FORMATS = (".svg", ".pdf", ".png")
_MAX_NAME_LENGTH = 48  # longest line of a name, in characters; half as many in a narrow figure
_NO_DATE = {"SOURCE_DATE_EPOCH": "0"}  # replaces the user's value, so that no date is written


@dataclass(frozen=True)
class Plot:
    """A figure with its title, caption, alternative text and numbers."""

    id: str
    """Id of the figure. It is the name of the figure's files, without suffix."""
    title: str
    caption: str
    alt: str
    """Alternative text: a description for people who cannot see the figure."""
    figure: Figure
    data: pd.DataFrame
    """The numbers that the figure shows."""

    def save(self, path: str | Path) -> None:
        """Write the figure into a file, which is replaced if it exists.

        Parameters
        ----------
        path : str or pathlib.Path
            Name of the file. Its suffix decides the format: ``.svg``, ``.pdf`` or ``.png``.

        Raises
        ------
        CoarticError
            The suffix is another one, or the file cannot be written.
        """
        path = Path(path)
        with describe_os_errors(path):
            path.write_bytes(picture(self.figure, path.suffix))

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows: the picture, with title and caption."""
        words = html.escape(one_line(f"{self.title}. {self.caption}"))
        return f"<figure>{for_page(self)}<figcaption>{words}</figcaption></figure>"


Parts = tuple[Figure, pd.DataFrame, str, str]
"""Result of a drawing function: the figure, its numbers, its alternative text, and text that is
added at the end of the caption."""
DrawsFigure = Callable[..., Plot | None]
"""Function that draws a figure of the report.

Its argument is a study of one world. It returns a :class:`Plot`, or None if the study has no runs
for this figure. There are two optional arguments:

- ``width``: width of the figure in inches, such as 3.4, 5.5 or 7.2;
- ``style``: settings of Matplotlib that override those of the project. It is a dict, the name of a
  style of Matplotlib, or the path of a style file.
"""


FIGURES: dict[str, DrawsFigure] = {}
"""Maps the id of each figure to the function that draws it, in the order of
:mod:`coartic.analysis.figures.drawings`."""


def figure(
    title: str, caption: str, *, of_folder: bool = False
) -> Callable[[Callable[[Study], Parts | None]], DrawsFigure]:
    """Return a decorator that makes a figure of the report from a drawing function.

    The decorator adds the decorated function to :data:`FIGURES`, with the id of the figure as the
    key: the name of the drawing function after its first underscore, with dashes instead of
    underscores. The decorated function returns a :class:`Plot` with

    - a figure in the style of all figures;
    - the id, followed by the suffix of the world (:func:`.ending_of`);
    - the title, followed by the name of the world if it is not the paper's, and by the number of
      trials after which the study looks (:attr:`.Study.after`), except for a figure of tasks;
    - the caption, followed by the text that the drawing function returns. If the figure has a
      dagger, a sentence that explains the dagger follows.

    Parameters
    ----------
    title : str
        Title of the figure.
    caption : str
        Beginning of the caption. ``{n}`` stands for the smallest and the largest number in column
        ``runs`` of the figure's numbers, such as ``20 to 50``, or for one number if they are equal.
        It is empty if there is no such column. ``{reference}`` stands for the name of the rewards
        from which gaps are measured (:func:`.reference`).
    of_folder : bool
        True for a figure about all worlds of a folder at once.
    """

    def as_figure(draw: Callable[[Study], Parts | None]) -> DrawsFigure:
        @wraps(draw)
        def plot(study: Study, /, *, width: float | None = None, style: Any = ()) -> Plot | None:
            if not of_folder:
                check_study(study)
            with styles.context(["default", RC, *([style] if style else [])]), drawn_at(width):
                if (parts := draw(study)) is None:
                    return None
                drawing, data, alt, more = parts
            texts = [text.get_text() for axes in drawing.axes for text in axes.texts]
            for axes in drawing.axes:
                texts += [axes.get_xlabel(), axes.get_title(), axes.get_title(loc="left")]
            has_dagger = any("†" in text for text in texts)
            words = f"{caption}{more}{f' {RECONSTRUCTED}' if has_dagger else ''}"
            ends = (data.runs.min(), data.runs.max()) if "runs" in data else ()
            to = "" if of_folder else reference(study, study.optima)
            n = " to ".join(dict.fromkeys(map(number, ends)))
            name = id_of(draw) + ending_of(study)
            heading = title
            if not of_folder and study.world:
                heading = f"{title}, in {world_title(study.world)}"
            if id_of(draw) != "tasks":
                heading += when_of(study)
            words = words.replace("{n}", n).replace("{reference}", to)
            return Plot(name, heading, words, alt, drawing, data)

        FIGURES[id_of(draw)] = plot
        return plot

    return as_figure


def looks_in(study: Study, labels: Iterable[str]) -> dict[str, style.Look]:
    """Return a dict that maps each label to the look of its line and markers.

    A look is a dict of arguments of Matplotlib's ``plot``. The colour and the marker of a method
    are those in column ``style`` of :attr:`.Study.methods`. Methods from files have wider lines and
    larger markers than built-in methods.
    """
    looks: dict[str, style.Look] = {}
    for label, row in study.methods.loc[[*labels]].iterrows():
        color, mark = row["style"]
        width, size = (1.2, 4.2) if row.built_in else (2.4, 7.0)
        looks[str(label)] = {
            "color": COLORS[color], "marker": MARKS[mark][0], "linestyle": MARKS[mark][1],
            "linewidth": width, "markersize": size, "markeredgewidth": 0,
            "markevery": 0.2,  # a marker at each fifth of the diagonal
        }  # fmt: skip
    return looks


def looks_by_kind(study: Study, labels: Iterable[str]) -> dict[str, style.Look]:
    """Return a dict that maps each label to a look, for figures with a row for each method.

    Colour and marker of a built-in method say how the method uses the reward (:data:`.KINDS`).
    Methods from files have the looks of :func:`looks_in`.
    """
    looks = looks_in(study, labels)
    for label, look in looks.items():
        row = study.methods.loc[label]
        if row.built_in:
            color, mark, _ = KINDS[str(row.information)]
            look |= {"color": COLORS[color], "marker": MARKS[mark][0]}
    return looks


def describe_kinds(study: Study, labels: Iterable[str], *, with_marks: bool = False) -> str:
    """Return a sentence for a caption that says what the colours of :func:`looks_by_kind` mean.

    If ``with_marks`` is True, the sentence also names the markers. The result is the empty string
    unless the built-in methods in ``labels`` use the reward in at least two ways.
    """
    rows = study.methods.loc[[*labels]]
    kinds = {*rows.information[rows.built_in.astype(bool)]}
    words = [
        f"{word}{f' {mark}s' if with_marks else ''}: methods {kind}"
        for kind, (_, mark, word) in KINDS.items() if kind in kinds
    ]  # fmt: skip
    return f" {capital('; '.join(words))}." if len(words) > 1 else ""


def name_in_figure(study: Study, method: str, longest: int = _MAX_NAME_LENGTH) -> str:
    """Return the name of a method for the figure that is being drawn.

    ``method`` is a label. The name is the title of the method, or its short title in a narrow
    figure. The name is broken into lines of at most ``longest`` characters, or 24 characters in a
    narrow figure. In a study that varies parameters, all settings belong to the same method. The
    name then consists of the values of the parameters, followed by :func:`.default_name` for the
    default setting.
    """
    if method in study.varied.index:
        row = study.methods.loc[method]
        values = study.varied.loc[method].items()
        words = describe_values({str(name): value for name, value in values})
        words += "" if row.setting else f", {default_name(str(row.method_id))}"
        words += MARK if row.title.endswith(MARK) else ""
        return "\n".join(
            textwrap.wrap(words, _MAX_NAME_LENGTH // 2 if style.is_narrow() else longest)
        )
    if style.is_narrow():
        return "\n".join(textwrap.wrap(study.methods.short_title[method], _MAX_NAME_LENGTH // 2))
    return "\n".join(textwrap.wrap(study.methods.title[method], longest))


def spoken(study: Study, rows: pd.DataFrame, template: str) -> str:
    """Describe the rows of a frame in words, for an alternative text.

    The template is filled in for each row (``str.format``), and the results are joined by
    semicolons. The name of a column in braces stands for the value in this column. ``{title}``
    stands for the title of the method whose label is in column ``method``.
    """
    rows = rows.assign(title=rows.method.map(study.methods.title))
    return "; ".join(template.format_map(row) for row in rows.to_dict("records"))


def picture(drawing: Figure, ending: str) -> bytes:
    """Return a figure as the bytes of a picture file.

    With the same fonts and the same version of Matplotlib, the same figure gives the same bytes:
    ids in SVG are not random, and no date is written. SVG and PDF files name the version of
    Matplotlib.

    Parameters
    ----------
    drawing : matplotlib.figure.Figure
        The figure.
    ending : {".svg", ".pdf", ".png"}
        Suffix of the file, which decides the format.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    CoarticError
        ``ending`` is another suffix.
    """
    if ending not in FORMATS:
        raise CoarticError(
            f"suffix of a picture is {brief_value(ending)}; it must be one of {', '.join(FORMATS)}"
        )
    dated = {".pdf": "CreationDate", ".svg": "Date", ".png": "Software"}[ending]
    return _saved(drawing, style.RC, format=ending[1:], dpi=300, metadata={dated: None})


def _saved(drawing: Figure, settings: Any, **how: Any) -> bytes:
    """Return a figure as the bytes of a file.

    ``settings`` are rcParams of Matplotlib, and ``how`` are arguments of ``Figure.savefig``. The
    layout engine of the figure arranges its parts once, before the figure is written. The figure
    has the same layout engine afterwards.
    """
    stream, layout, dpi = io.BytesIO(), drawing.get_layout_engine(), drawing.dpi
    canvas = drawing.canvas
    try:
        with environment(_NO_DATE), rc_context(settings):  # also its lock
            if layout is not None:
                FigureCanvasSVG(drawing)  # measures its fonts
                layout.execute(drawing)
                drawing.set(layout_engine=None, dpi=dpi)
            drawing.savefig(stream, **how)
    finally:
        drawing.set_canvas(canvas)
        drawing.set_layout_engine(layout)
    return stream.getvalue()


def for_page(plot: Plot) -> str:
    """Return a figure as one ``<svg>`` element for a page of HTML.

    - The element scales with its container and has a transparent background.
    - Black is replaced by the page's ``currentColor``, so that a dark page can have light ink.
    - White, grey, blue and the colours of methods (:data:`.COLORS`) are custom properties of CSS,
      which the page can define: ``--paper`` (white, such as the inside of open markers),
      ``--grey``, ``--blue``, and the names of the colours of methods. Other colours stay as they
      are.
    - A mark with a :func:`~.style.tip` shows the text of the tip when the pointer rests on it.
    - All ids begin with the id of the plot, so that a page can have several figures. The id of the
      element with the whole drawing is the id of the plot followed by ``-drawing``.
    - Each ``style`` attribute is replaced by a class, whose name is a hash of the style.
    """

    def shorten(attribute: re.Match[str]) -> str:  # lengths to tenths of a point
        cut = re.sub(r"\.0\b", "", re.sub(r"(\.\d)\d+", r"\1", attribute[0]))
        if not cut.startswith("d="):
            return cut
        return _with_short_lines(re.sub(r"\s*\b([MLQCzZ])\s*", r"\1", cut))

    none = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    settings = {**style.RC, "svg.fonttype": "none"}
    text = _saved(plot.figure, settings, format="svg", transparent=True, metadata=none).decode()
    text = re.sub(r'\b(?:d|x|y|transform)="[^"]*"', shorten, text)
    text = re.sub(r"\n\s*", "\n", text[text.index("<svg") :])
    text = re.sub(rf' id=(["\']){style.TIP}(.*?)\1>', r"><title>\2</title>", text)
    text = re.sub(r' id="[\w.]+_\d+"', "", text)  # nothing refers to these elements
    text = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{plot.id}-", text)
    # The backend does not write black fills, so they inherit the fill of the root.
    text = text.replace(style.INK, "currentColor").replace(style.BACKGROUND, "var(--paper, none)")
    names = {"grey": style.GREY, "blue": style.BLUE, **COLORS}
    for name, color in names.items():
        text = text.replace(color, f"var(--{name}, {color})")
    head, body = text.split(">", 1)
    view = re.search(r'viewBox="[^"]*"', head)
    assert view is not None
    # Styles that the backend gives to all elements would apply to the whole page.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", body, flags=re.DOTALL)
    looks: dict[str, str] = {}

    def as_class(style: re.Match[str]) -> str:
        name = looks.setdefault(style[1], f"s{zlib.crc32(style[1].encode()):x}")
        return f'class="{name}"'

    body = re.sub(r'style="([^"]*)"', as_class, body)
    rules = "".join(f".{name}{{{look}}}" for look, name in looks.items())
    return (
        f'<svg {view[0]} xmlns="http://www.w3.org/2000/svg" role="img" '
        f'aria-label="{html.escape(one_line(plot.alt))}"><g id="{plot.id}-drawing" '
        'stroke-linejoin="round" stroke-linecap="butt" fill="currentColor">'
        f"<style>{rules}</style>"
        f"{body.replace('xlink:href', 'href').strip().removesuffix('</svg>')}</g></svg>"
    )


def _with_short_lines(path: str) -> str:
    """Return an SVG path in which lines after a move have relative coordinates.

    Lines after curves stay absolute.

    The coordinates of the path must have at most one decimal.

    Examples
    --------
    >>> _with_short_lines("M10 20.5L11.5 20.5L12 19.5L10 20.5z")
    'M10 20.5l1.5 0 .5 -1 -2 1z'
    """

    def shorten(lines: re.Match[str]) -> str:
        points = [[round(10 * float(x)) for x in p.split()] for p in lines[0].split("L")]
        steps = [(b - a) / 10 for p, q in pairwise(points) for a, b in zip(p, q, strict=True)]
        words = (re.sub(r"^(-?)0\.", r"\1.", f"{step:g}") for step in steps)
        return f"{lines[0].partition('L')[0]}l{' '.join(words)}"

    return re.sub(r"(?<=M)[-\d. ]+(?:L[-\d. ]+)+", shorten, path)


def panels_for_page(plot: Plot) -> list[str]:
    """Return an ``<svg>`` element for each panel and each legend of a figure, for a narrow page.

    The elements refer to the element that :func:`for_page` returns. Call :func:`for_page` first,
    and put its element on the same page. The list is empty if the figure has only one panel. It is
    also empty if a panel has no labels on its y axis because it shares those of another panel.
    """
    drawing, canvas = plot.figure, plot.figure.canvas
    panels = [axes for axes in drawing.axes if axes.has_data()]
    named = [axes.yaxis.get_tick_params()["labelleft"] for axes in panels if axes.axison]
    if len(panels) < 2 or not all(named):
        return []
    FigureCanvasSVG(drawing)  # measures its fonts
    boxes = filter(None, [part.get_tightbbox() for part in (*panels, *drawing.legends)])
    drawing.set_canvas(canvas)
    points, height = 72 / drawing.dpi, 72 * drawing.get_figheight()
    views = []
    for place, box in enumerate(boxes, 1):
        x, y = points * box.x0 - 1, height - points * box.y1 - 1
        view = f"{x:.1f} {y:.1f} {points * box.width + 2:.1f} {points * box.height + 2:.1f}"
        label = html.escape(
            one_line(f"{plot.title}, part {place}. {plot.alt if place == 1 else ''}")
        )
        views.append(
            f'<svg viewBox="{view}" xmlns="http://www.w3.org/2000/svg" role="img" '
            f'aria-label="{label}"><use href="#{plot.id}-drawing"/></svg>'
        )
    return views
