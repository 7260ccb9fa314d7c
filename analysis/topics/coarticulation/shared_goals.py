"""Goals that two tasks of a study share before they differ."""

from __future__ import annotations

from collections.abc import Iterator

from coartic.analysis.methods import LEARNERS, main_methods
from coartic.analysis.signatures.two_contexts import TwoContexts, context_pairs
from coartic.analysis.solutions import Solutions
from coartic.analysis.study import Study, cached, one_by_one
from coartic.robot import HANDS


def shared_goals(study: Study) -> Iterator[TwoContexts]:
    """Every goal that two tasks share, for every method and hand that hit it in both."""
    alone, pairs = one_by_one(study), context_pairs(study.tasks)
    for task, label in study.cells:
        for first, second, shared in pairs:
            both = {first, second} <= alone and (second, label) in study.cells
            if first == task and both:
                runs = study.executed(first, label), study.executed(second, label)
                for goal in range(1, shared + 1):
                    yield from contexts_at(*runs, goal)


def contexts_at(first: Solutions, second: Solutions, goal: int) -> list[TwoContexts]:
    """A goal in two contexts, for every hand that hit it in both."""
    by_hand = [TwoContexts(first, second, goal, hand) for hand in HANDS]
    return [contexts for contexts in by_hand if contexts.in_both]


@cached
def shared_goal(study: Study) -> TwoContexts | None:
    """The first goal that two tasks share before they differ, by the paper's learner if it ran.

    None where no method has solved runs on two such tasks.
    """
    labels = [label for _, label in study.cells]
    for label in dict.fromkeys([*LEARNERS, *main_methods(labels), *labels]):
        for *names, _ in context_pairs(study.tasks):
            keys = [(name, label) for name in names]
            if all(key in study.cells and len(study.cells[key].good) for key in keys):
                first, second = (study.executed(*key) for key in keys)
                for contexts in contexts_at(first, second, 1):
                    return contexts
    return None
