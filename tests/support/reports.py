"""Reports without their figures, and what reads them back."""

import shutil
import subprocess
from contextlib import contextmanager
from html.parser import HTMLParser

import pytest

import coartic.cli.reading
from coartic.analysis.figures import Figures, register
from coartic.analysis.report import pictures
from coartic.analysis.report.build import build, write
from coartic.analysis.report.formats import html as page
from coartic.analysis.report.formats.latex import PACKAGES

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"></svg>'


LATEX = r"""\documentclass{article}
\usepackage[T1]{fontenc}\usepackage[utf8]{inputenc}\usepackage[margin=2.5cm]{geometry}
\usepackage{booktabs,siunitx,graphicx,tabularx,longtable}
\hfuzz=1pt
\input{numbers.tex}
\begin{document}
%s
\input{tables.tex}
\end{document}
"""


@contextmanager
def undrawn():
    """Reports whose figures are empty, with none for a narrow page, as is the script of their
    charts, which is not ours: making them takes long, and has tests of its own.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figures, "for_a_phone", lambda figures, section: {})
        patch.setattr(pictures, "svg_text", lambda plot: SVG)
        patch.setattr(pictures, "rendered", lambda plot, endings: {f"{plot.id}.svg": SVG.encode()})
        patch.setattr(page, "vega", str)
        patch.setattr(coartic.cli.reading, "PROCESSES", 1)  # others know no patches
        yield


@contextmanager
def without_figures(but=()):
    """Reports that have no figures, or some by their names in the register."""
    with pytest.MonkeyPatch.context() as patch:
        kept = tuple(row for row in register.REGISTER if row.name in but)
        patch.setattr(register, "REGISTER", kept)
        yield


def document_of(study):
    """The document of a report without figures."""
    with without_figures():
        return build(study).document


def report_of(study, folder):
    """A report with empty figures, written into a folder."""
    with undrawn():
        write(build(study), study, folder)
    return folder


def needs_latex(*packages):
    """Skips where LaTeX or one of these packages is missing."""
    if not shutil.which("pdflatex"):
        pytest.skip("pdflatex is not installed")
    styles = ["kpsewhich", *(f"{name}.sty" for name in packages)]
    if subprocess.run(styles, capture_output=True, check=False).returncode:
        pytest.skip(f"one of {', '.join(packages)} is not installed")


def compiled(folder, body=""):
    """The log of a document with all macros and tables; skips where LaTeX is missing."""
    needs_latex(*PACKAGES, "geometry")
    (folder / "paper.tex").write_text(LATEX % body, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=120)
    log = done.stdout.decode(errors="replace")
    assert done.returncode == 0, log[-2000:]
    return log


class Page(HTMLParser):
    """A strict reader of the page: elements must nest, and nothing may be asked for."""

    EMPTY = frozenset(("meta", "link", "wbr", "path", "use", "input"))

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.texts = [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        assert len(dict(attributes)) == len(attributes), "an attribute given twice"
        self.elements.append((tag, dict(attributes)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag not in self.EMPTY:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def shown(table):
    """By key and column name the values of a table."""
    names = [column.name for column in table.columns]
    return {row.key: dict(zip(names, row.values, strict=True)) for row in table.rows}


def changed_columns(before, after):
    """Table and column of the values that differ between tables; some rows come and go."""
    first, second = (
        {
            (table.id, column.name, row.key): value
            for table in tables
            for row in table.rows
            for column, value in zip(table.columns, row.values, strict=True)
        }
        for tables in (before, after)
    )
    both = first.keys() & second.keys()
    assert len(both) > 0.9 * len(first)
    return {key[:2] for key in both if repr(first[key]) != repr(second[key])}
