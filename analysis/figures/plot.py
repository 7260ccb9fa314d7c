"""A figure with what belongs to it, and its files."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rc_context
from matplotlib.figure import Figure

from coartic import CoarticError, Task
from coartic.analysis.figures.style import GREY, INK, PAPER, RC, TIP, styled
from coartic.analysis.methods import name_of
from coartic.analysis.study import Study
from coartic.analysis.words import RECONSTRUCTED
from coartic.files import write_atomically
from coartic.text import one_line

FORMATS = (".svg", ".pdf", ".png")
DPI = 300
_FONTS = "'DejaVu Sans', Verdana, sans-serif"  # the latter as wide as the first
_NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))
_NO_DATE: Mapping[str, Mapping[str, Any]] = {
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
    ".png": {"Software": None},
}


@dataclass(frozen=True)
class Plot:
    """A figure with its words and numbers."""

    id: str
    """Name of its files: letters, digits, dashes, dots, underscores."""
    title: str
    caption: str
    alt: str
    """What is seen, for those who cannot see it."""
    figure: Figure
    data: pd.DataFrame
    """What is drawn, tidy: enough to draw it again."""

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        return picture(self.figure, ".png")


FIGURES: dict[str, Callable[[Study], Plot]] = {}
"""Every figure by its id: a function of a study. It raises CoarticError where the folder's runs do
not allow its figure."""
Parts = tuple[Figure, pd.DataFrame, str, Iterable[Task]]
"""A figure, the table that it shows, its alternative text, and the tasks that it is about."""


def figure(
    name: str, title: str, caption: str
) -> Callable[[Callable[[Study], Parts]], Callable[[Study], Plot]]:
    """A decorator: what draws a study becomes a figure with this id, title and caption.

    It is drawn in the style of all figures. The caption says what a dagger means where one of the
    tasks is reconstructed.
    """

    def as_figure(draw: Callable[[Study], Parts]) -> Callable[[Study], Plot]:
        @styled
        def plot(study: Study) -> Plot:
            drawing, data, alt, tasks = draw(study)
            return Plot(name, title, caption + dagger(tasks), alt, drawing, data)

        plot.__doc__ = draw.__doc__
        FIGURES[name] = plot
        return plot

    return as_figure


def dagger(tasks: Iterable[Task]) -> str:
    """What the dagger means, for a caption; empty where no task is reconstructed."""
    return f" {RECONSTRUCTED}" if any(task.reconstructed for task in tasks) else ""


def missing(study: Study, what: str) -> CoarticError:
    """The error of a figure that the folder's runs do not allow."""
    return CoarticError(f"{study.folder}: {what}")


def spoken(rows: pd.DataFrame, template: str) -> str:
    """Each row in words, for an alternative text: names in ``{}`` are columns."""
    named = rows.assign(method=rows.method.map(name_of))
    return "; ".join(template.format_map(row) for row in named.to_dict("records"))


def picture(drawing: Figure, ending: str) -> bytes:
    """A figure as a file with this ending, one of :data:`FORMATS`.

    The same figure gives the same bytes: ids are salted, no date is written.
    """
    stream = io.BytesIO()
    with rc_context(RC):
        drawing.savefig(stream, format=ending[1:], dpi=DPI, metadata=_NO_DATE[ending])
    return stream.getvalue()


def save(plot: Plot, folder: Path) -> list[Path]:
    """Write the figure as SVG, PDF and PNG into ``folder``, over files of these names.

    The folder is made if it is not there. Raises CoarticError where they cannot be written.
    """
    paths = [folder / f"{plot.id}{ending}" for ending in FORMATS]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in paths:
            write_atomically(path, picture(plot.figure, path.suffix))
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None
    return paths


def svg_for_page(plot: Plot) -> str:
    """The figure as one ``<svg>`` element for a page of HTML.

    It scales with its container, its background is transparent and its ink is the page's
    ``currentColor``; open marks are filled with the custom property ``--paper`` where the page has
    one, and its grey is ``--grey``. Marks with a :func:`~.style.tip` show it. Ids begin with the
    plot's id, so that several can share a page.
    """
    stream = io.StringIO()
    with rc_context({**RC, "svg.fonttype": "none"}):
        plot.figure.savefig(stream, format="svg", transparent=True, metadata=_NO_METADATA)
    plot.figure.set_layout_engine("none")  # its file has the layout that it now has
    text = stream.getvalue()
    text = re.sub(rf'<g id="{TIP}([^"]*)">', r"<g><title>\1</title>", text[text.index("<svg") :])
    text = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{plot.id}-", text)
    text = re.sub(r"\n\s*", "\n", text)
    # The backend leaves black fills out: they inherit the root's.
    text = text.replace(INK, "currentColor").replace(PAPER, "var(--paper, none)")
    text = text.replace(GREY, f"var(--grey, {GREY})")
    head, body = text.split(">", 1)
    head = re.sub(r' (width|height|version|xmlns:xlink)="[^"]*"', "", head)
    # Styles that the backend gives to all elements would apply to the whole page.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", body, flags=re.DOTALL)
    head += ' stroke-linejoin="round" stroke-linecap="butt"'
    head += f' font-family="{_FONTS}" fill="currentColor"'
    head += f' role="img" aria-label="{html.escape(one_line(plot.alt))}"'
    return f"{head}>{body.replace('xlink:href', 'href')}".strip()
