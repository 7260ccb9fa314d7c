"""The corrective process alone, with the task's hands or with the best hands.

The best hands come from the paper's exhaustive strategy (section *Exploration Condition 3*), which
tries all 2^G hand sequences for G goals and two hands. The corrective process **A** finds each
target; no targets are explored.
"""

from __future__ import annotations

from coartic import Execution
from coartic.method import Facts, Information, Method, MethodError, Outline, Result, Session
from coartic.motion.initial_hands import changes_of_hand, sequences_with
from coartic.motion.solution import corrective_movements


class GivenHands(Method):
    """The corrective process with the task's initial hands, as in trial 0 of the learner."""

    name = "corrective-alone/given"
    tuned_on = "nothing: all constants are the paper's"
    title = "corrective process alone"
    facts = Facts(works=("whitney1969", "shah2013"), short="corrective process")
    information = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
    stochastic = False

    def solve(self, session: Session) -> Result:
        """Make one trial with the task's initial hands, and return the movements of the trial.

        Only the corrective process acts in the trial. Raises MethodError if the trial misses a
        goal, and NotApplicableError if no initial hands are found.
        """
        hands = session.find_initial_hands()
        with session.solving():
            execution = session.trial(corrective_movements(hands))
        if not execution.completed:
            raise MethodError("infeasible", execution.reason)
        return Result(execution.movements)


class BestHands(GivenHands):
    """The corrective process with the hand sequence that gets the highest reward."""

    name = "corrective-alone/best-hands"
    title = "corrective process alone, best hands"
    facts = Facts(
        works=("whitney1969", "shah2013"),
        algorithm="corrective process alone",
        short="corrective, best hands",
    )

    def inapplicable_reason(self, task: Outline) -> str | None:
        """Return a sentence if a task has more than 4096 hand sequences; else None."""
        return task.too_many_sequences

    def solve(self, session: Session) -> Result:
        """Make a trial with each hand sequence, and return the movements of the best trial.

        The sequences are tried in alphabetical order, until the trial budget is used up. The best
        trial is the one with the highest reward. Among trials with equal rewards, it is the one
        with the fewest changes of hand, and then the earliest.

        Raises MethodError if no trial hits every goal.
        """
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
        best = min(completed, key=lambda trial: (trial.ticks, changes_of_hand(trial.hands)))
        return Result(best.movements)


METHODS: tuple[type[Method], ...] = (GivenHands, BestHands)
