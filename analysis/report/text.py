"""Answers to the questions of the first screen, and the templates beside this file."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from coartic.analysis import words
from coartic.analysis.study import Study, cached
from coartic.analysis.topics import settings
from coartic.analysis.topics.coarticulation import sentences as coarticulation
from coartic.analysis.topics.comparison import sentences as comparison
from coartic.analysis.topics.paper import sentences as paper
from coartic.text import one_line

ANSWERS: tuple[tuple[str, str, dict[str, Callable[[Study], str]]], ...] = (
    ("Which setting is best?", "Best", {"settings": settings.answer_settings}),
    (
        "Does the next goal change the movement?",
        "Coarticulation",
        {
            "coarticulation": coarticulation.answer_contexts,
            "learning": comparison.answer_gain,
        },
    ),
    ("Is the paper reproduced?", "Paper", {"paper": paper.answer_paper}),
    ("Who comes nearest to the optimum?", "Nearest", {"nearest": comparison.answer_nearest}),
    ("What does it cost?", "Cost", {"runtimes": comparison.answer_runtimes}),
)
"""The questions with their words on the terminal, and the functions that answer them.

By the section that says more. The first answer that is not empty counts.
"""


@cache
def templates(*, escape: bool) -> Environment:
    """The templates; ``escape``: for HTML."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        undefined=StrictUndefined,
        autoescape=escape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: shown(value) if type(value) is str else value,
    )
    environment.filters |= {
        "number": words.number,
        "listed": words.listed,
        "capital": words.capital,
    }
    return environment


def shown(text: str) -> str:
    """Text as one printable line, which does not break before a per cent sign."""
    return one_line(text).replace(" %", f"{words.NO_BREAK}%")


@cached
def answers(study: Study) -> list[dict[str, str]]:
    """The answers that a folder gives to the questions, a dozen words each.

    ``id`` of the section that says more, ``question``, ``word``, ``text``.
    """
    answered = []
    for question, word, functions in ANSWERS:
        texts = ((section, shown(answer(study))) for section, answer in functions.items())
        if told := next(((section, text) for section, text in texts if text), None):
            section, text = told
            answered.append({"id": section, "question": question, "word": word, "text": text})
    return answered
