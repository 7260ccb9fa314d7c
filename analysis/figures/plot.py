"""Make figures with their words and numbers, and write them to files."""

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
from coartic.analysis.methods import COLORS, KINDS, MARK, MARKS, default_name, values_in_words
from coartic.analysis.standings import reference
from coartic.analysis.study import Study, check_study
from coartic.analysis.words import RECONSTRUCTED, capital, ending_of, id_of, number
from coartic.errors import CoarticError
from coartic.internal.files import errors_in_words
from coartic.internal.limits import brief_value
from coartic.internal.text import one_line
from coartic.internal.threads import environment
from coartic.runs.plan import world_title

FORMATS = (".svg", ".pdf", ".png")
_LONGEST_NAME = 48  # longest line of a name, in characters; half as many in a narrow figure
_NO_DATE = {"SOURCE_DATE_EPOCH": "0"}  # replaces the user's value, so that no date is written


@dataclass(frozen=True)
class Plot:
    """A figure with its words and numbers."""

    id: str
    """Name of the figure's files without suffix."""
    title: str
    caption: str
    alt: str
    """Alternative text: a description for people who cannot see the figure."""
    figure: Figure
    data: pd.DataFrame
    """The numbers that are drawn, as a tidy frame."""

    def save(self, path: str | Path) -> None:
        """Write the picture into a file ``.svg``, ``.pdf`` or ``.png``, or replace the file.

        Raises CoarticError for another suffix, and if the file cannot be written.
        """
        path = Path(path)
        with errors_in_words(path):
            path.write_bytes(picture(self.figure, path.suffix))

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows: the picture, with title and caption."""
        words = html.escape(one_line(f"{self.title}. {self.caption}"))
        return f"<figure>{for_page(self)}<figcaption>{words}</figcaption></figure>"


Parts = tuple[Figure, pd.DataFrame, str, str]
"""Parts of a :class:`Plot`: the figure, its numbers, its alternative text, and sentences for the
end of the caption that depend on the study."""
DrawsFigure = Callable[..., Plot | None]
"""Function of a study that draws a figure of the report, or returns None if the folder has no runs
for it.

Further arguments: ``width`` in inches, such as 3.4, 5.5 or 7.2; ``style``: settings of Matplotlib,
as ``matplotlib.style.use`` accepts them, that override the project's.
"""


FIGURES: dict[str, DrawsFigure] = {}
"""Figures by id, in the order of :mod:`coartic.analysis.figures.drawings`."""


def figure(title: str, caption: str) -> Callable[[Callable[[Study], Parts | None]], DrawsFigure]:
    """Return a decorator that makes a figure of the report from a drawing function.

    The decorator enters the figure in :data:`FIGURES`.

    - The figure has the style of all figures.
    - Its id is the part of the function's name after the first underscore, with dashes for
      underscores, and :func:`.ending_of` in another world than the paper's, which its title names.
    - The caption is followed by the sentences that the function returns, and by an explanation of
      the dagger if one is drawn.
    - In the caption ``{n}`` stands for the range of column ``runs`` of the drawn numbers (empty if
      there is no such column), and ``{reference}`` for the name of the rewards from which gaps are
      measured.
    """

    def as_figure(draw: Callable[[Study], Parts | None]) -> DrawsFigure:
        @wraps(draw)
        def plot(study: Study, /, *, width: float | None = None, style: Any = ()) -> Plot | None:
            check_study(study)
            with styles.context(["default", RC, *([style] if style else [])]), drawn_at(width):
                if (parts := draw(study)) is None:
                    return None
                drawing, data, alt, more = parts
            texts = [text.get_text() for axes in drawing.axes for text in axes.texts]
            for axes in drawing.axes:
                texts += [axes.get_xlabel(), axes.get_title(), axes.get_title(loc="left")]
            has_dagger = any("†" in text for text in texts)
            words = f"{caption}{more}{f' {RECONSTRUCTED}' * has_dagger}"
            ends = (data.runs.min(), data.runs.max()) if "runs" in data else ()
            to = reference(study, study.optima)
            n = " to ".join(dict.fromkeys(map(number, ends)))
            name = id_of(draw) + ending_of(study)
            heading = f"{title}, in {world_title(study.world)}" if study.world else title
            return Plot(name, heading, words.format(n=n, reference=to), alt, drawing, data)

        FIGURES[id_of(draw)] = plot
        return plot

    return as_figure


def looks_in(study: Study, labels: Iterable[str]) -> dict[str, style.Look]:
    """Return the looks of the lines and markers of methods, by label.

    They are the same in all figures of a study. Methods from a user's method file have wider lines
    and larger markers.
    """
    looks: dict[str, style.Look] = {}
    for label, row in study.methods.loc[[*labels]].iterrows():
        color, mark = row.look
        width, size = (1.2, 4.2) if row.built_in else (2.4, 7.0)
        looks[str(label)] = {
            "color": COLORS[color], "marker": MARKS[mark][0], "linestyle": MARKS[mark][1],
            "linewidth": width, "markersize": size, "markeredgewidth": 0,
            "markevery": 0.2,  # a marker at each fifth of the diagonal
        }  # fmt: skip
    return looks


def looks_by_kind(study: Study, labels: Iterable[str]) -> dict[str, style.Look]:
    """Return the looks of methods in figures with a row for each method, by label.

    Colour and marker say which use of the reward a method makes (:data:`.KINDS`). Methods from a
    user's method file keep the looks of :func:`looks_in`.
    """
    looks = looks_in(study, labels)
    for label, look in looks.items():
        row = study.methods.loc[label]
        if row.built_in:
            color, mark, _ = KINDS[str(row.information)]
            look |= {"color": COLORS[color], "marker": MARKS[mark][0]}
    return looks


def kinds_in_words(study: Study, labels: Iterable[str], *, with_marks: bool = False) -> str:
    """Return a sentence for a caption that says what the colours of :func:`looks_by_kind` mean.

    ``with_marks``: it also names the markers.
    """
    rows = study.methods.loc[[*labels]]
    kinds = {*rows.information[rows.built_in.astype(bool)]}
    words = [
        f"{word}{f' {mark}s' * with_marks}: methods {kind}"
        for kind, (_, mark, word) in KINDS.items() if kind in kinds
    ]  # fmt: skip
    return f" {capital('; '.join(words))}." if len(words) > 1 else ""


def name_in_figure(study: Study, method: str, longest: int = _LONGEST_NAME) -> str:
    """Return the name of a method (a label) for the figure that is being drawn.

    It is the method's title, or its short name in a narrow figure. A name of more than ``longest``
    letters, or of 24 in a narrow figure, has several lines. In a study that varies parameters the
    name is their values alone, because all settings are of one method.
    """
    if method in study.varied.index:
        row = study.methods.loc[method]
        values = study.varied.loc[method].items()
        words = values_in_words({str(name): value for name, value in values})
        words += f", {default_name(str(row.base))}" * (not row.setting) + MARK * row.title.endswith(
            MARK
        )
        return "\n".join(textwrap.wrap(words, _LONGEST_NAME // 2 if style.is_narrow() else longest))
    if style.is_narrow():
        return "\n".join(textwrap.wrap(study.methods.short[method], _LONGEST_NAME // 2))
    return "\n".join(textwrap.wrap(study.methods.title[method], longest))


def spoken(study: Study, rows: pd.DataFrame, template: str) -> str:
    """Return rows in words, for an alternative text.

    The template is filled in for each row, and the results are joined by ``; ``. Names in ``{}``
    are columns; ``{title}`` is the title of the method whose label is in column ``method``.
    """
    rows = rows.assign(title=rows.method.map(study.methods.title))
    return "; ".join(template.format_map(row) for row in rows.to_dict("records"))


def picture(drawing: Figure, ending: str) -> bytes:
    """Return a figure as the bytes of a file with this suffix, one of :data:`FORMATS`.

    With the same fonts and the same version of Matplotlib, the same figure gives the same bytes:
    ids in SVG are not random, and no date is written. SVG and PDF files name the version. Raises
    CoarticError for another suffix.
    """
    if ending not in FORMATS:
        raise CoarticError(
            f"the name of a picture must end in one of {', '.join(FORMATS)}, not in "
            f"{brief_value(ending)}"
        )
    dated = {".pdf": "CreationDate", ".svg": "Date", ".png": "Software"}[ending]
    return _saved(drawing, style.RC, format=ending[1:], dpi=300, metadata={dated: None})


def _saved(drawing: Figure, settings: Any, **how: Any) -> bytes:
    """Return a figure as the bytes of a file, and keep its layout engine.

    ``settings`` are rcParams of Matplotlib; ``how`` are arguments of ``Figure.savefig``. Parts of
    the figure are laid out only once.
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
    - Ink is the page's ``currentColor``. Open markers are filled with the custom property
      ``--paper``, if the page has it. Grey is ``--grey``, blue ``--blue``, and colours of methods
      have their names.
    - Marks with a :func:`~.style.tip` show its text.
    - Ids begin with the plot's id, so that a page can have several figures. The id of the whole
      drawing ends in ``-drawing``.
    - Each ``style`` attribute becomes a class, named by a hash of the style.
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
    """Return a path of SVG whose points have at most one decimal, its lines as differences.

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
    """Return the panels and legends of a figure as ``<svg>`` elements, for a narrow page.

    They show parts of :func:`for_page`, which must be on the page, and be called before. The list
    is empty if there is only one panel, or a panel lacks the names of its rows.
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
        label = html.escape(one_line(f"{plot.title}, part {place}. {plot.alt * (place == 1)}"))
        views.append(
            f'<svg viewBox="{view}" xmlns="http://www.w3.org/2000/svg" role="img" '
            f'aria-label="{label}"><use href="#{plot.id}-drawing"/></svg>'
        )
    return views
