"""A document's tables for LaTeX: booktabs and siunitx, for pdfLaTeX with T1 and UTF-8.

A table wider than the line is scaled down to it; columns that are not for print are left out.
"""

from __future__ import annotations

import re
import unicodedata

from analysis.report.document import DataTable, Document, Value
from analysis.report.text import NO_SPREAD, Part, inline, parts
from analysis.table import NONE

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "%": r"\%",
    "#": r"\#",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "`": r"\textasciigrave{}",
    "[": "{[}",  # \\ would read these as its own
    "*": "{*}",
    "–": r"\textendash{}",
    "—": r"\textemdash{}",
    "−": "$-$",
    "±": r"$\pm$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "÷": r"$\div$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "≠": r"$\neq$",
    "≈": r"$\approx$",
    "∞": r"$\infty$",
    "→": r"$\rightarrow$",
    "←": r"$\leftarrow$",
    "∈": r"$\in$",
    "√": r"$\surd$",
    "°": r"$^{\circ}$",
    "′": r"$'$",
    "†": r"\textdagger{}",
    "‡": r"\textdaggerdbl{}",
    "…": r"\ldots{}",
    "•": r"\textbullet{}",
    "‘": "`",
    "’": "'",
    "“": "``",
    "”": "''",
    "µ": r"$\mu$",
    "\N{NO-BREAK SPACE}": "~",
    "\N{NARROW NO-BREAK SPACE}": r"\,",
    "\N{THIN SPACE}": r"\,",
}
_GREEK = {
    letter: unicodedata.name(letter).split()[-1].replace("LAMDA", "LAMBDA")
    for letter in "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΥΦΨΩ"
}
_RAISED = {"⁻": "-", **dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789", strict=True))}
_LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
MOST_ROWS = 32
"""Of a table that fits on a page in footnotesize."""
_NUMBER = re.compile(r"-?\d+(\.\d+)?")


def latex_tables(document: Document) -> dict[str, str]:
    """Every table by id, each a ``table`` float with label ``tab:ID``."""
    return {table.id: latex_table(table) for table in document.tables()}


def latex_inputs(document: Document) -> str:
    """A file that inputs all tables from ``tables/``."""
    inputs = "".join(f"\\input{{tables/{table.id}.tex}}\n" for table in document.tables())
    return (
        "% Needs \\usepackage{booktabs,siunitx,graphicx}, \\usepackage[T1]{fontenc} and UTF-8.\n"
        + inputs
    )


def latex_table(table: DataTable) -> str:
    """One table: numbers in S columns as wide as they need, text and intervals beside them."""
    shown = [part for part in parts(table) if part.column.printed]
    kinds = [_kind(part, table) for part in shown]
    head = " & ".join(f"{{{latex_text(part.header)}}}" for part in shown)
    rows = "\n".join(
        " & ".join(_cell(part, row.values[part.index]) for part in shown) + r" \\"
        for row in table.rows
    )
    size = "footnotesize" if len(table.rows) <= MOST_ROWS else "scriptsize"
    notes = "".join(
        f"\\par\\smallskip\\parbox{{\\linewidth}}{{{_spans(note)}}}\n" for note in table.notes
    )
    return f"""\\begin{{table}}[htbp]
\\centering
\\{size}
\\setlength{{\\tabcolsep}}{{4pt}}
\\caption{{{_spans(table.caption)}}}
\\label{{tab:{table.id}}}
\\resizebox{{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}}{{!}}{{%
\\begin{{tabular}}{{{"".join(kinds)}}}
\\toprule
{head} \\\\
\\midrule
{rows}
\\bottomrule
\\end{{tabular}}}}
{notes}\\end{{table}}
"""


def latex_text(text: str) -> str:
    """Plain text in LaTeX; characters that T1 lacks are written by their code."""
    # Two hyphens in a row would become a dash; no line begins with a per cent sign.
    characters = "".join(map(_character, text))
    return re.sub("-(?=-)", "-{}", re.sub(r"(?<=\d) (?=\\%)", "~", characters))


def _character(character: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    if character in _GREEK:
        name = _GREEK[character]
        return f"$\\{name.lower() if character.islower() else name.capitalize()}$"
    if character in _RAISED:
        return f"$^{{{_RAISED[character]}}}$"
    if character in _LOWERED:
        return f"$_{{{_LOWERED[character]}}}$"
    # Letters of Latin-1 and Latin Extended-A are in T1, but for a few.
    if character.isascii() or ("À" <= character <= "ž" and character not in "ĦħĸĿŀŊŋŦŧ"):
        return character
    return f"[U+{ord(character):04X}]"


def _spans(text: str) -> str:
    pieces = []
    for span in inline(text):
        words = latex_text(span.text)
        if span.style == "emphasis":
            words = f"\\emph{{{words}}}"
        elif span.style == "code":
            words = f"\\texttt{{{words}}}"
        elif span.address.startswith(("http://", "https://")):
            words = f"{words} (\\texttt{{{latex_text(span.address)}}})"
        pieces.append(words)
    return "".join(pieces)


def _kind(part: Part, table: DataTable) -> str:
    if not part.numeric:
        return "l" if part.column.kind == "text" else "r"
    numbers = [
        number
        for row in table.rows
        for number in part.numbers(row.values[part.index])
        if _NUMBER.fullmatch(number)
    ]
    if not numbers:
        return "r"
    sign = "-" if any(number.startswith("-") for number in numbers) else ""
    wholes, decimals = zip(
        *(number.removeprefix("-").partition(".")[::2] for number in numbers), strict=True
    )
    width = f"{max(map(len, wholes))}.{max(map(len, decimals))}"
    return f"S[table-format={sign}{width}]"


def _cell(part: Part, value: Value) -> str:
    if part.column.kind == "text":
        return latex_text(part.text(value))
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
    return f"$<$\\num{{{number[1:]}}}" if number.startswith("<") else f"\\num{{{number}}}"
