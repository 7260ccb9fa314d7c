"""Sentences with their numbers put in, from the templates beside this file."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic.analysis import words
from coartic.analysis.report import facts
from coartic.analysis.study import Study
from coartic.analysis.topics.coarticulation import sentences as coarticulation
from coartic.analysis.topics.paper import sentences as paper
from coartic.text import one_line

QUESTIONS = {
    "coarticulation": ("Does the next goal change the movement?", "Coarticulation"),
    "paper": ("Is the paper reproduced?", "Paper"),
    "nearest": ("Who comes nearest to the optimum?", "Nearest"),
    "price": ("What does it cost?", "Cost"),
}
"""The four questions with their words on the terminal, by the facts that answer them."""
INSTEAD = {"slopes": "slopes", "gain": "learning"}
"""Facts that answer the first question where no two tasks share a goal, with their sections."""
ANSWERS = {
    "coarticulation": coarticulation.answer,
    "slopes": coarticulation.answer_by_slopes,
    "paper": paper.answer,
}
"""Answers by the names in :data:`QUESTIONS`; the others are still macros with facts."""


@cache
def environment(*, escape: bool) -> Environment:
    """The templates; ``escape``: for HTML."""
    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        autoescape=escape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: shown(value) if type(value) is str else value,
    )
    templates.filters |= {
        "number": words.number,
        "two_figures": words.two_figures,
        "p_value": words.p_value,
        "listed": words.listed,
        "brackets": words.in_brackets,
        "capital": lambda text: text[:1].upper() + text[1:],
    }
    return templates


def shown(text: str) -> str:
    """Text as one printable line, which does not break before a per cent sign."""
    return one_line(text).replace(" %", f"{words.NO_BREAK}%")


def sentence(name: str, of: Any) -> str:
    """A macro of ``sentences.jinja`` with its facts, as one line of plain text."""
    macros = environment(escape=False).get_template("sentences.jinja").module
    text = str(getattr(macros, name)(of)).replace("\n", " ")
    return shown(" ".join(part for part in text.split(" ") if part).replace(" ,", ","))


def answers(study: Study) -> list[dict[str, str]]:
    """The answers that a folder gives to the four questions, a dozen words each.

    ``id`` of the section that says more, ``question``, ``word``, ``text``.
    """
    answered = []
    for name, (question, word) in QUESTIONS.items():
        sections = {name: name} | (INSTEAD if name == "coarticulation" else {})
        for of, section in sections.items():
            if of in ANSWERS:
                text = shown(ANSWERS[of](study))
            else:
                values = getattr(facts, of)(study)
                text = "" if values is None else sentence(f"{of}_short", values)
            if text:
                answered.append({"id": section, "question": question, "word": word, "text": text})
                break
    return answered
