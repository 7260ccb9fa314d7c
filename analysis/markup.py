"""Inline markup: what prose is written in, and the one place where it becomes Markdown.

Prose has ``*emphasis*``, ``**strong**``, ```code```, ``[words](address)``, and a backslash
before ``*``, a backtick, ``[`` or ``\\`` for the character itself. Names and other text from
elsewhere enter it through :func:`escaped` or :func:`code`. Titles, headers and cells of tables
are plain text, which needs no escape.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from coartic.text import one_line

_MARKUP = re.compile(
    r"\\(?P<escaped>[*`\[\\])"
    r"|`(?P<code>[^`]+)`"
    r"|\*\*(?=[^\s*])(?P<strong>(?:\\.|[^*\\])+)(?<!\s)\*\*"
    r"|\*(?=[^\s*])(?P<emphasis>(?:\\.|[^*\\])+)(?<!\s)\*"
    # Of addresses there are these; javascript: and the like are none.
    r"|\[(?P<words>[^\]]+)\]\((?P<address>(?:#|https?://)[^)\s]+)\)"
)
_ESCAPED = re.compile(r"\\([*`\[\\])")
_PAIR = r"(?P<open>\[)(?P<inner>[^\[\]]*)\](?![\[(:]|$)"  # no link, no reference
_LITERAL = re.compile(
    r"^\[(?=[ xX]\] )"  # a task, in a list
    rf"|{_PAIR}"
    r"|[\\`~$|#\[\]]"
    r"|(?<![^\W_])(?<!\))\*|\*(?![\s)])|(?<=\))\*(?!\s)"  # but behind a word, as in 20*
    r"|<(?! )"  # HTML, addresses
    r"|^>"
    r"|&(?=#|\w+;|$)"  # a character by its name
    r"|!(?=\[|$)"
    r"|(?<![^\W_])_|_(?![^\W_])"  # but within a word, where it is no mark
    r"|:(?=//)|(?<=\bwww)\."  # addresses become links by themselves
    r"|^[-+](?=[-\s]|$)|^=",
    re.IGNORECASE,
)
_ORDINAL = re.compile(r"^(\d{1,9})([.)])(?=\s|$)")


@dataclass(frozen=True)
class Span:
    """A stretch of text in one style; only links have an address."""

    style: str
    """``text``, ``emphasis``, ``strong``, ``code`` or ``link``."""
    text: str
    address: str = ""


def inline(text: str) -> list[Span]:
    """Inline markup as the spans it consists of; what is no markup is text."""
    spans: list[Span] = []
    plain, at = "", 0
    for match in _MARKUP.finditer(text):
        plain += text[at : match.start()]
        at = match.end()
        kind = match.lastgroup or ""
        if kind == "escaped":
            plain += match[kind]
            continue
        if plain:
            spans.append(Span("text", plain))
            plain = ""
        if kind == "address":
            spans.append(Span("link", match["words"], match[kind]))
        else:
            inner = match[kind]
            spans.append(Span(kind, inner if kind == "code" else _ESCAPED.sub(r"\1", inner)))
    plain += text[at:]
    return [*spans, Span("text", plain)] if plain else spans


def escaped(text: str) -> str:
    """Text from elsewhere as inline markup that shows it as it is, on one line."""
    return re.sub(r"[\\*`\[]", r"\\\g<0>", one_line(text))


def code(text: str) -> str:
    """Text from elsewhere as code, on one line; as text where it has backticks itself."""
    text = one_line(text)
    return escaped(text) if "`" in text or not text.strip() else f"`{text}`"


def words(text: str) -> str:
    """Inline markup without its marks, for where there are no styles."""
    return "".join(span.text for span in inline(text))


def markdown(text: str) -> str:
    """Inline markup as Markdown. Links within a page are words: Markdown has no such places."""
    return "".join(map(_span, inline(text)))


def _span(span: Span) -> str:
    if span.style == "code":
        return f"`{one_line(span.text)}`"
    text = markdown_text(span.text)
    if "*" in span.text:  # emphasis would end there
        return text
    if span.style == "link" and not span.address.startswith("#"):
        return f"[{text}]({span.address})"
    return {"emphasis": f"*{text}*", "strong": f"**{text}**"}.get(span.style, text)


def markdown_text(text: str) -> str:
    """Plain text as one line of Markdown (GitHub's) that shows it as it is.

    What would be no markup, such as the brackets of an interval, stays unescaped.
    """
    return _ORDINAL.sub(r"\1\\\2", _LITERAL.sub(_literal, one_line(text)))


def _literal(match: re.Match[str]) -> str:
    if match["open"]:
        return f"[{_LITERAL.sub(_literal, match['inner'])}]"
    return f"\\{match[0]}"
