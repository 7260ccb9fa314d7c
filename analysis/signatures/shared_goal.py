"""The plainest sight of coarticulation: one goal, hit in another posture before another goal."""

from __future__ import annotations

from coartic.analysis.methods import CONDITIONS, main_methods
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.context import context_pairs
from coartic.analysis.signatures.locus import families, variants
from coartic.analysis.study import Study, cached
from coartic.robot import HANDS


def pairs_of_contexts(study: Study) -> list[tuple[str, str, int]]:
    """Pairs of tasks that differ only after their first goals, and how many they share.

    Tasks that differ in one moved goal only are left out: slopes say how postures follow it.
    """
    moved = variants(families(study.tasks))
    pairs = context_pairs(study.tasks)
    return [pair for pair in pairs if not any({*pair[:2]} <= names for names in moved)]


@cached
def shared_goal(study: Study) -> TwoContexts | None:
    """The first goal that two tasks share before they differ, by the paper's learner if it ran.

    None where no method has solved runs on two such tasks.
    """
    labels = [label for _, label in study.cells]
    for label in dict.fromkeys([*CONDITIONS, *main_methods(labels), *labels]):
        for *names, _ in pairs_of_contexts(study):
            keys = [(name, label) for name in names]
            if all(key in study.cells and len(study.cells[key].good) for key in keys):
                first, second = (study.trajectories(*key) for key in keys)
                both = [TwoContexts(first, second, 1, hand) for hand in HANDS]
                for contexts in both:
                    if all(contexts.runs):
                        return contexts
    return None
