"""Sentences with their numbers put in, from the templates beside this file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic.analysis import words
from coartic.analysis.comparisons.reached import Crossing
from coartic.analysis.report import facts
from coartic.analysis.study import Study
from coartic.text import one_line


@cache
def environment(*, escape: bool) -> Environment:
    """The templates; ``escape``: for HTML."""
    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        autoescape=escape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: one_line(value) if type(value) is str else value,
    )
    made.filters |= {
        "number": words.number,
        "two_figures": words.two_figures,
        "p_value": words.p_value,
        "listed": words.listed,
        "capital": lambda text: text[:1].upper() + text[1:],
        "crossing": lambda found: _trials_interval(found),
    }
    return made


def _trials_interval(found: Crossing) -> str:
    return words.in_brackets(found.low, found.high, 0)


def sentence(name: str, of: Any) -> str:
    """A macro of ``sentences.jinja`` with its facts, as one line of plain text."""
    module = environment(escape=False).get_template("sentences.jinja").module
    return " ".join(str(getattr(module, name)(of)).split())


ANSWERS = (
    ("coarticulation", "Does the next goal change the movement?", "Coarticulation"),
    ("paper", "Is the paper reproduced?", "Paper"),
    ("nearest", "Who comes nearest to the optimum?", "Nearest"),
    ("price", "What does it cost?", "Cost"),
)
"""The four answers: name of the facts and of the section, question, and word on the terminal."""


def answers(study: Study) -> list[dict[str, str]]:
    """The four answers that a folder gives, a dozen words each.

    ``id`` of the section that says more, ``question``, ``word``, ``text``.
    """
    found = []
    for name, question, word in ANSWERS:
        of = getattr(facts, name)(study)
        text = "" if of is None else sentence(f"{name}_short", of)
        section = name
        if of is None and name == "coarticulation":
            if moved := facts.moved(study):
                text, section = sentence("moved_short", moved), "slopes"
            elif gain := facts.gain(study):
                text, section = sentence("gain_short", gain), "learning"
        if text:
            found.append({"id": section, "question": question, "word": word, "text": text})
    return found
