"""A figure with what belongs to it, and its files."""

from __future__ import annotations

import html
import io
import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from matplotlib import rc_context
from matplotlib.figure import Figure

from analysis.figures.style import INK, PAPER, RC
from coartic import CoarticError

FORMATS = (".png", ".svg", ".pdf")
DPI = 300
_NO_DATE = {
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
    ".png": {"Software": None},
}
_NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))


@dataclass(frozen=True)
class Plot:
    """A figure for a paper, with its words and numbers."""

    id: str
    """Name of its files: letters, digits, dashes, dots, underscores."""
    title: str
    caption: str
    alt: str
    """What is seen, for those who cannot see it."""
    figure: Figure
    data: pd.DataFrame
    """What is drawn, tidy: enough to draw it again."""


def write(plot: Plot, path: Path) -> None:
    """Write the figure alone to ``path`` in the format of its ending (:data:`FORMATS`).

    The same figure gives the same bytes: ids are salted, no date is written. Raises
    CoarticError for other endings and OSError where it cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise CoarticError(f"{path}: the name of a figure must end in {', '.join(FORMATS)}")
    with rc_context(RC):
        _settle(plot.figure)
        plot.figure.savefig(path, dpi=DPI, metadata=_NO_DATE[ending])


def save(plot: Plot, folder: Path) -> list[Path]:
    """Write ``<id>.png`` (300 dpi), ``.svg``, ``.pdf`` and ``<id>.csv`` into ``folder``.

    The folder is made if it is not there. Raises CoarticError where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        paths = [folder / f"{plot.id}{ending}" for ending in FORMATS]
        for path in paths:
            write(plot, path)
        table = folder / f"{plot.id}.csv"
        plot.data.to_csv(table, index=False, lineterminator="\n")
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None
    return [*paths, table]


def svg_text(plot: Plot) -> str:
    """The figure as one ``<svg>`` element for a page of HTML.

    It scales with its container, its background is transparent and its ink is the page's
    ``currentColor``; open marks are filled with the custom property ``--paper`` where the
    page has one. Ids begin with the plot's id, so that several can share a page. Text stays
    text, in the page's own sans-serif where DejaVu Sans is missing.
    """
    stream = io.StringIO()
    with rc_context({**RC, "svg.fonttype": "none"}):
        _settle(plot.figure)
        plot.figure.savefig(stream, format="svg", transparent=True, metadata=_NO_METADATA)
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', text))

    def own(match: re.Match[str]) -> str:
        return f' id="{plot.id}-{match[1]}"' if match[1] in used else ""

    text = re.sub(r' id="([^"]*)"', own, text)
    text = re.sub(r'(href="|url\()#', rf"\g<1>#{plot.id}-", text)
    text = re.sub(r' d="[^"]*"', _rounded, text, flags=re.DOTALL)
    # The backend leaves black fills out: they inherit the root's.
    text = text.replace(INK, "currentColor").replace(PAPER, "var(--paper, none)")
    head, body = text.split(">", 1)
    head = re.sub(r' (width|height|version|xmlns:xlink)="[^"]*"', "", head)
    head = f'{head} fill="currentColor" role="img" aria-label="{html.escape(plot.alt)}"'
    body = re.sub(r"\s*\n\s*", "\n", body.replace("xlink:href", "href"))
    return f"{head}>{body}".strip() + "\n"


def _settle(figure: Figure) -> None:
    """Lay the figure out once, for all formats."""
    if figure.get_layout_engine() is not None:
        figure.draw_without_rendering()
        figure.set_layout_engine("none")


def _rounded(match: re.Match[str]) -> str:
    """Coordinates to a hundredth of a point."""
    return re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}", match[0]).replace("\n", "")
