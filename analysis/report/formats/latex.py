"""A document's tables for LaTeX: booktabs and siunitx, for pdfLaTeX with T1 and UTF-8.

Columns that are not for print are left out, methods have the names that figures show. Columns of
many words share what the others leave of the line (tabularx); a table of few words that is wider
than the line is scaled down to it. Tables longer than a page are longtables, which need one
column of text; their columns of many words share two fifths of the line.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence

from coartic.analysis.markup import inline
from coartic.analysis.report.document import DataTable, Document, Value
from coartic.analysis.report.formats.templates import LATEX, template
from coartic.analysis.report.tables.main import MAIN
from coartic.analysis.report.text import Part, parts
from coartic.analysis.words import NO_SPREAD, NONE, stated
from coartic.text import one_line

_TABLE = stated(__file__)
_ESCAPES: dict[str, str] = _TABLE["characters"] | {
    character: form.replace("@", said)
    for form, pairs in _TABLE["forms"].items()
    for character, said in re.findall(r"(\S) (\S+)", pairs)
}
MOST_ROWS = 38
"""Lines of a float, notes among them; a table with more is continued on the next page."""
PACKAGES = ("booktabs", "siunitx", "graphicx", "tabularx", "longtable")
"""What the tables need."""
_LINE, _NARROW = 105, 70  # characters of small print that a line holds, and a narrow one
_WIDE, _SHORT_LINE = 82, 420  # characters from which on a longtable is too wide for so many pt
_LEAST_SHARE = 0.3  # of the line, for columns of many words
_MANY = 10  # columns from which on the print is smaller
_WORD, _WORDS = 12, 45  # characters: up to one a column stays whole, as all do up to the other
_COMMANDS = {"emphasis": "emph", "strong": "textbf", "code": "texttt"}
_WAITING = 30  # tables that float without text between them: LaTeX gives up at some fifty
_NUMBER = re.compile(r"(?P<sign>-?)(?P<whole>\d+)(\.(?P<decimals>\d+))?")


def latex_inputs(document: Document) -> str:
    """A file that inputs all tables from ``tables/``."""
    tables = {table.id: table for table in document.tables()}
    main = [name for name in MAIN if name in tables]
    parts = [_input(tables[name]) for name in main]
    rest = [table for name, table in tables.items() if name not in main]
    if main and rest:
        parts.append("\\clearpage % the supplement, in the order of its numbers\n")
    waiting = 0
    for table in rest:
        waiting = 0 if is_long(table) else waiting + 1
        if waiting > _WAITING:
            parts.append("\\clearpage\n")
            waiting = 1
        parts.append(_input(table))
    inputs = "".join(parts)
    return (
        f"% Needs \\usepackage{{{','.join(PACKAGES)}}}, \\usepackage[T1]{{fontenc}} and UTF-8;\n"
        f"% tables of more than {MOST_ROWS} rows are longtables, for one column of text.\n"
        + inputs
    )


def _input(table: DataTable) -> str:
    # A table over several pages does not float: those before it are set first.
    return ("\\clearpage\n" if is_long(table) else "") + f"\\input{{tables/{table.id}.tex}}\n"


def latex_table(table: DataTable) -> str:
    """A ``table`` float, or a ``longtable``, with label ``tab:ID``.

    Numbers are in S columns as wide as they need, text and intervals beside them.
    """
    shown = [part for part in parts(table) if part.column.printed]
    broken, long = _broken(shown, table), is_long(table)
    widths = _widths(shown, broken, table) if long else {}
    return template("table.tex.jinja", **LATEX).render(
        id=table.id,
        caption=_spans(table.caption),
        kinds="".join(
            rf">{{\raggedright\arraybackslash}}{widths.get(part, 'X')}"
            if part in broken
            else _kind(part, table)
            for part in shown
        ),
        head=" & ".join(_head(part, table) for part in shown),
        rows=[
            " & ".join(_cell(part, row.values[part.index]) for part in shown) for row in table.rows
        ],
        notes=map(_spans, table.notes),
        size="scriptsize" if len(shown) >= _MANY else "footnotesize",
        gap="1.5pt" if len(shown) >= _MANY else "3pt",
        broken=broken,
        long=long,
        wide=long and _width(shown, broken, table) > _WIDE,
        narrow=_SHORT_LINE,
    )


def _widths(shown: Sequence[Part], broken: Sequence[Part], table: DataTable) -> dict[Part, str]:
    """Of columns of many words in a longtable: what the others leave, the more the longer."""
    used = sum(_longest(part, table) + 3 for part in shown if part not in broken)
    share = min(max(0.85 - used / _NARROW, _LEAST_SHARE), 0.8)
    weights = {part: math.sqrt(_longest(part, table)) for part in broken}
    whole = sum(weights.values())
    return {
        part: f"p{{{share * weight / whole:.2f}\\linewidth}}" for part, weight in weights.items()
    }


def _width(shown: Sequence[Part], broken: Sequence[Part], table: DataTable) -> float:
    """Characters of a longtable's line, as far as is known before it is set."""
    whole = (
        max(_longest(part, table), min(7, max(map(len, part.header.split()), default=0))) + 2
        for part in shown
        if part not in broken
    )
    return sum(whole) + _LEAST_SHARE * _NARROW * bool(broken)


def is_long(table: DataTable) -> bool:
    """Whether it has more lines than a float holds, as far as is known before it is set."""
    shown = [part for part in parts(table) if part.column.printed]
    broken = _broken(shown, table)
    used = sum(_longest(part, table) + 2 for part in shown if part not in broken)
    each = max((_LINE - used) / max(len(broken), 1), _WORD)
    lines = sum(
        max((-(-len(part.named(row.values[part.index])) // each) for part in broken), default=1)
        for row in table.rows
    )
    notes = sum(len(note) / _LINE for note in table.notes)
    return lines + notes > MOST_ROWS


def _broken(shown: Sequence[Part], table: DataTable) -> list[Part]:
    """Columns of text that share the line: the longer ones, of a table with many words."""
    longest = {part: _longest(part, table) for part in shown if part.column.kind == "text"}
    if sum(longest.values()) <= _WORDS:
        return []
    return [part for part, length in longest.items() if length > _WORD]


def _longest(part: Part, table: DataTable) -> int:
    return max((len(part.named(row.values[part.index])) for row in table.rows), default=0)


def _head(part: Part, table: DataTable) -> str:
    """The header, in as many lines as make it no wider than what stands below."""
    text = part.header.replace(" %", "\N{NO-BREAK SPACE}%")  # which a line does not begin with
    lines = textwrap.wrap(text, max(_longest(part, table), 7), break_long_words=False)
    if len(lines) < 2:
        return f"{{{latex_text(text)}}}"
    place = "l" if part.column.kind == "text" else "r" if part.kind == "interval" else "c"
    stacked = r" \\ ".join(map(latex_text, lines))
    return f"{{\\shortstack[{place}]{{{stacked}}}}}"


def latex_text(text: str) -> str:
    """Plain text in LaTeX, on one line; characters that T1 lacks are written by their code."""
    # Two hyphens in a row would become a dash; no line begins with a per cent sign.
    characters = "".join(map(_character, one_line(text)))
    return re.sub(
        "-(?=-)|<(?=<)|>(?=>)|,(?=,)", r"\g<0>{}", re.sub(r"(?<=\d) (?=\\%)", "~", characters)
    )


def _character(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    # Letters of Latin-1 and Latin Extended-A are in T1, but for a few.
    if character.isascii() or ("À" <= character <= "ž" and character not in "ĦħĸĿŀŊŋŦŧ"):
        return character
    return f"[U+{ord(character):04X}]"


def _spans(text: str) -> str:
    pieces = []
    for span in inline(text):
        words = latex_text(span.text)
        if span.style in _COMMANDS:
            words = f"\\{_COMMANDS[span.style]}{{{words}}}"
        elif span.address.startswith(("http://", "https://")):
            words = f"{words} (\\texttt{{{latex_text(span.address)}}})"
        pieces.append(words)
    return "".join(pieces)


def _kind(part: Part, table: DataTable) -> str:
    """S with the sign and digits of the column's numbers; right or left of what has none."""
    if not part.numeric:
        return "l" if part.column.kind == "text" else "r"
    texts = [text for row in table.rows for text in part.numbers(row.values[part.index])]
    numbers = list(filter(None, map(_NUMBER.fullmatch, texts)))
    if not numbers:
        return "r"
    sign = "-" if any(number["sign"] for number in numbers) else ""
    wholes, decimals = (max(len(n[of] or "") for n in numbers) for of in ("whole", "decimals"))
    return f"S[table-format={sign}{wholes}.{decimals}]"


def _cell(part: Part, value: Value) -> str:
    if part.column.kind == "text":
        return latex_text(part.named(value))
    numbers = part.numbers(value)
    if not numbers:
        return f"{{{latex_text(NONE)}}}"
    if part.point(value):
        return f"{{{NO_SPREAD}}}"
    if part.kind == "interval":
        return f"{{[{_inline(numbers[0])}, {_inline(numbers[1])}]}}"
    return numbers[0] if _NUMBER.fullmatch(numbers[0]) else f"{{{_inline(numbers[0])}}}"


def _inline(number: str) -> str:
    """A number outside an S column's alignment."""
    if number.endswith("inf"):
        return f"${number.replace('inf', chr(92) + 'infty')}$"
    than = f"${number[0]}$" if number[0] in "<>" else ""
    return f"{than}\\num{{{number.lstrip('<>')}}}"
