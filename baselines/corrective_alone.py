"""The corrective process alone: with given hands, and with the best hands.

The best hands come from the paper's exhaustive strategy (section *Exploration Condition 3*):
try all 2^G hand sequences, each target from **A**, without further exploration.
"""

from __future__ import annotations

from coartic import Execution
from coartic.method import Information, Method, MethodError, Outline, Result, Session
from coartic.motion.initial_hands import changes_of_hand, sequences_with
from coartic.motion.solution import corrective_movements


class GivenHands(Method):
    """The corrective process with the task's initial hands: trial 0 of a learner with all hands."""

    name = "corrective-alone/given"
    tuned_on = "nothing: all constants are the paper's"
    title = "Corrective process alone, the task's hands"
    citation = (
        "D. E. Whitney (1969). Resolved motion rate control of manipulators and human "
        "prostheses. IEEE Transactions on Man-Machine Systems; as used by Shah, Barto & Fagg "
        "(2013)."
    )
    information = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
    stochastic = False

    def solve(self, session: Session) -> Result:
        """Make one trial in which the corrective process alone goes to each goal with the task's
        initial hands; return its movements. Raises MethodError if the trial misses a goal,
        NotApplicableError if no initial hands are found, and BudgetError if no trial is left."""
        hands = session.find_initial_hands()
        with session.solving():
            execution = session.trial(corrective_movements(hands))
        if not execution.completed:
            raise MethodError("infeasible", execution.reason)
        return Result(execution.movements)


class BestHands(GivenHands):
    """The corrective process with every hand sequence; the best sequence is kept."""

    name = "corrective-alone/best-hands"
    title = "Corrective process alone, best hands"

    def why_not(self, task: Outline) -> str | None:
        """Return a sentence that a task has more than 4096 hand sequences; else None."""
        return task.too_many_sequences

    def solve(self, session: Session) -> Result:
        """Make one trial for each hand sequence while trials are left; return the movements of the
        best trial, of equal rewards the trial with the fewest changes of hand. Raises MethodError
        if no trial hit every goal."""
        completed: list[Execution] = []
        for hands in sequences_with(session.hands, session.goals_count, session.task_name):
            if session.trials_left == 0:
                break
            with session.solving():
                execution = session.trial(corrective_movements(hands))
            if execution.completed:
                completed.append(execution)
        if not completed:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        best = min(completed, key=lambda each: (each.ticks, changes_of_hand(each.hands)))
        return Result(best.movements)


METHODS: tuple[type[Method], ...] = (GivenHands, BestHands)
