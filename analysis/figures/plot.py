"""A figure with what belongs to it, and its files."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from coartic import CoarticError, Task
from coartic.analysis.figures.style import CONFIDENCE, GREY, INK, PAPER, RC, dagger
from coartic.analysis.figures.svg import compact
from coartic.analysis.methods import short_name
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.words import stated
from coartic.files import write_atomically
from coartic.text import one_line, printed

FORMATS = (".png", ".svg", ".pdf")
FILES = (*FORMATS, ".csv")
DPI = 300
_NO_DATE = {
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
    ".png": {"Software": None},
}
_NO_LAYOUT: Any = {"figure.autolayout": False, "figure.constrained_layout.use": False}
_COLOURS = 256
_FAMILY = "'DejaVu Sans', Verdana, sans-serif"  # the latter as wide as the first
_WORDS: dict[str, dict[str, str]] = stated(__file__, "words")
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


def worded(
    name: str,
    figure: Figure,
    data: pd.DataFrame,
    of_tasks: Iterable[Task] = (),
    *,
    id: str | None = None,  # noqa: A002
    **of: object,
) -> Plot:
    """A figure with its words from ``words.toml``, names in them filled in.

    ``of_tasks``: what a dagger means is said where one of them is reconstructed; ``id``: where it
    is not ``name``.
    """
    words = {
        part: text.format(confidence=CONFIDENCE, seed=SEED, **of)
        for part, text in _WORDS[name].items()
    }
    words["caption"] += dagger(of_tasks)
    return Plot(id or name, figure=figure, data=data, **words)


def spoken(rows: pd.DataFrame, template: str) -> str:
    """Each row in words, for an alternative text: names in ``{}`` are columns."""
    named = rows.assign(method=rows.method.map(short_name))
    return "; ".join(template.format_map(row) for row in named.to_dict("records"))


def picture(plot: Plot, ending: str) -> bytes:
    """The figure as a file with this ending, one of :data:`FORMATS`.

    The same figure gives the same bytes: ids are salted, no date is written.
    """
    with rc_context(RC):
        _settle(plot.figure)
        stream = io.BytesIO()
        plot.figure.savefig(stream, format=ending[1:], dpi=DPI, metadata=_NO_DATE[ending])
    return _smaller(stream, ending)


def rendered(plot: Plot, endings: Collection[str] = FILES) -> dict[str, bytes]:
    """The figure's files by their names, ``<id>.png`` (300 dpi), ``.svg``, ``.pdf`` and
    ``<id>.csv``, those of ``endings``.
    """
    files = {
        f"{plot.id}{ending}": picture(plot, ending) for ending in FORMATS if ending in endings
    }
    if ".csv" in endings:
        table = plot.data.to_csv(index=False, lineterminator="\n", float_format="%.8g")
        files[f"{plot.id}.csv"] = table.encode()
    return files


def save(plot: Plot, folder: Path) -> list[Path]:
    """Write the figure's files (:func:`rendered`) into ``folder``, over those of these names.

    The folder is made if it is not there. Raises CoarticError where they cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files = rendered(plot)
        for name, data in files.items():
            write_atomically(folder / name, data)
    except OSError as error:
        raise CoarticError(f"cannot write to {folder}: {error.strerror or error}") from None
    return [folder / name for name in files]


def svg_text(plot: Plot) -> str:
    """The figure as one ``<svg>`` element for a page of HTML.

    It scales with its container, its background is transparent and its ink is the page's
    ``currentColor``; open marks are filled with the custom property ``--paper`` where the
    page has one, and its grey is ``--grey``. Ids begin with the plot's id, so that several can
    share a page. Text stays text, in Verdana or the page's own sans-serif where DejaVu Sans is
    missing.
    """
    stream = io.StringIO()
    with rc_context({**RC, "svg.fonttype": "none"}):
        _settle(plot.figure)
        plot.figure.savefig(stream, format="svg", transparent=True, metadata=_NO_METADATA)
    text = compact(stream.getvalue())
    text = text[text.index("<svg") :]
    text = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{plot.id}-", text)
    # The backend leaves black fills out: they inherit the root's.
    text = text.replace(INK, "currentColor").replace(PAPER, "var(--paper, none)")
    text = text.replace(GREY, f"var(--grey, {GREY})")
    head, body = text.split(">", 1)
    head = re.sub(r' (width|height|version|xmlns:xlink)="[^"]*"', "", head)
    # What the backend says for all elements would go for all of the page.
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\s*", "", body, flags=re.DOTALL)
    head += ' stroke-linejoin="round" stroke-linecap="butt"'
    head += f' font-family="{_FAMILY}" fill="currentColor"'
    head = f'{head} role="img" aria-label="{html.escape(one_line(plot.alt))}"'
    return f"{head}>{body.replace('xlink:href', 'href')}".strip() + "\n"


def _smaller(stream: io.BytesIO, ending: str) -> bytes:
    """A picture in fewer bytes: PNGs with 256 colours, which is more than are told apart."""
    if ending == ".svg":
        return compact(stream.getvalue().decode()).encode()
    if ending == ".png":
        picture = Image.open(stream).convert("RGB")
        picture = picture.quantize(_COLOURS, Image.Quantize.FASTOCTREE)
        stream = io.BytesIO()
        picture.save(stream, "PNG", optimize=True, dpi=(DPI, DPI))
    return stream.getvalue()


def _settle(figure: Figure) -> None:
    """Lay the figure out once, for all formats, with words that print.

    It has no layout engine then: with one, every file would draw all twice.
    """
    for text in _texts(figure):
        text.set_text("\n".join(map(printed, text.get_text().split("\n"))))
    if (engine := figure.get_layout_engine()) is not None:
        for _ in range(2):  # the first time does not know how tall titles are
            engine.execute(figure)
        with rc_context(_NO_LAYOUT):
            figure.set_layout_engine(None)


def _texts(artist: Artist) -> Iterator[Text]:
    """All words but those at ticks, which are written when they are drawn."""
    for child in artist.get_children():
        if isinstance(child, Axis):
            yield child.label
        elif isinstance(child, Text):
            yield child
        else:
            yield from _texts(child)
