"""Random search: noise on target configurations, the best trial is kept.

``guesses`` is the best of uniform guesses around the corrective process with its best
hands. It cannot coarticulate by learning: no guess depends on any reward. Its best trial shows
the effect of selecting one of many noisy trials by the reward of the whole task. A signature of
coarticulation of a method that selects its solution from trials counts if it exceeds this one.
The half width was tuned for reward at 10 000 trials on 24 development instances (twelve for one
arm, four of each of two-armed, aligned and redundancy), two runs each. Mean gain over the
corrective process with the best hands, per cent: 0.06 2.53, 0.08 2.67, 0.10 2.80, 0.12 2.83,
0.15 2.80, 0.20 2.75, 0.25 2.68. Other widths show larger signatures. Means over twelve development
instances each, for 0.06, 0.12, 0.18, 0.25, 0.5 and 1.0: first movement slower by -2.3, -2.2, -2.1,
-0.1, 3.1 and 2.7 ticks with one arm, 0.2, 2.0, 2.4, 3.6, 2.8 and 0 with two; next goal nearer by
5.5, 8.0, 9.6, 14.2, 19.0 and 18.7, and by 2.2, 3.2, 3.1, 2.5, 1.0 and 0; way of the waiting hand
0.06, 0.07, 0.16, 0.24, 0.30 and 0; on four long tasks next goal nearer by 1.6, 1.9 and from 0.18 on
0. So suites have all of these but the last.

``guesses`` has the hands with which the corrective process alone does best, so that its
hands could not come out otherwise. In ``guesses/hands`` every sequence gets as many of the trials,
the first by the corrective process alone, the others around it. The best of all is the solution.

``random-search/climbing`` adds Gaussian noise and draws hands as well: a (1+1) hill climber for
each hand sequence. A sequence has a centre, at first the configurations of the corrective process
**A** alone, which take the first trial of the sequence. A trial perturbs all explored joints of the
centre at once; any better one moves the centre to the configurations in which it hit the goals, as
in the learner (leaving its targets was tried and is no better). Hands are explored as the learner
does, with ε for each goal around the best sequence known. The SD and ε are the learner's, untuned.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic.baselines.uninformed import Attempts, UninformedParameters
from coartic.learner.learning import TRIALS
from coartic.method import BudgetError, Method, MethodError, Parameters, Result, Session
from coartic.optimisers import TOLD, Objective, Optimiser, OptimiserParameters, sequences_of
from coartic.robot import Array
from coartic.tasks.task import letters_of

_GUESSES_AT_ONCE = 500
_EPSILON = 0.2  # probability of a random hand, for each goal
_MOST_DRAWN = 128  # trials that are drawn before they are made, at most


class GuessesParameters(OptimiserParameters):
    """Parameters of guesses."""

    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class Guesses(Optimiser):
    """Uniform guesses in a box around the postures in which the corrective process hits the goals.

    The hands are those with which the corrective process alone does best. The best trial is the
    solution; the first is the corrective process alone.
    """

    name = "guesses"
    title = "Best of random guesses around the corrective process"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    Parameters = GuessesParameters

    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Guess until no trial is left."""
        low, high = objective.bounds.T
        while True:
            objective.many(rng.uniform(low, high, (_GUESSES_AT_ONCE, objective.dim)))


class DrawnHandsParameters(Parameters):
    """Parameters of guesses with every hand sequence."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run, as many for each hand sequence."""
    half_width: Annotated[float, Field(gt=0, le=100)] = 0.12
    """Half the width of the box of targets, length unit (base) and rad (joints)."""


class DrawnHands(Method):
    """Guesses in a box for each hand sequence; the task's own alone, where there are too many."""

    name = "guesses/hands"
    title = "Best of random guesses with every hand sequence"
    citation = Guesses.citation
    told = TOLD
    Parameters = DrawnHandsParameters

    def solve(self, session: Session) -> Result:
        """Guess with one sequence after the other; the solution is the best trial's."""
        sequences = sequences_of(session)
        left = session.trials_left
        trials = self.parameters.trials if left is None else min(self.parameters.trials, left)
        shares = [trials * n // len(sequences) for n in range(len(sequences) + 1)]
        problems: list[Objective] = []
        with session.solving():
            for n, hands in enumerate(sequences):
                share, width = shares[n + 1] - shares[n], self.parameters.half_width
                with suppress(BudgetError, MethodError):
                    problem = Objective(session, hands, half_width=width, trials=share)
                    problems.append(problem)
                    low, high = problem.bounds.T
                    problem.many(session.rng.uniform(low, high, (share - 1, problem.dim)))
        if not problems:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        best = min(problems, key=lambda problem: problem.best_cost)
        return Result(best.solution, {"sequences": len(problems)})


class Climbing(Method):
    """A (1+1) hill climber per hand sequence."""

    name = "random-search/climbing"
    title = "Random search, hill climbing"
    citation = (
        "H.-G. Beyer, H.-P. Schwefel (2002). Evolution strategies: a comprehensive "
        "introduction. Natural Computing."
    )
    told = TOLD
    Parameters = UninformedParameters

    def solve(self, session: Session) -> Result:
        """Draw hands around the best sequence known, make a trial around its centre, draw again."""
        first, rng, letters = session.find_initial_hands(), session.rng, letters_of(session.hands)
        attempts = Attempts(session, self.parameters)
        most, ahead = len(letters) ** session.goals_count, 1
        masks: dict[str, NDArray[np.bool_]] = {}  # explored joints, (G, dof)
        centres: dict[str, Array] = {}  # their values, (G, dof); NaN for the other joints
        rewards: dict[str, float] = {}  # a trial with more moves the centre
        hopeless: set[str] = set()  # A alone does not complete them, ever

        def draw() -> str:
            """Hands around the best; uniformly random where none has succeeded."""
            while True:
                chosen = list(attempts.hands or letters[0] * session.goals_count)
                for goal in range(len(chosen)):
                    if not attempts.hands or rng.random() < _EPSILON:
                        chosen[goal] = letters[rng.integers(len(letters))]
                if (hands := "".join(chosen)) not in hopeless:
                    return hands

        with session.solving():
            while attempts.left > 0 and len(hopeless) < most:
                # The next draws are known until a centre moves, which is rare: they are tried
                # together, and what was drawn beyond the trial that moves one is drawn again.
                drawn, noise, states = list[str](), list[Array](), [rng.bit_generator.state]
                while len(drawn) < min(ahead, attempts.left):
                    hands = draw() if attempts.trials_made else first
                    if hands not in centres:
                        break
                    drawn.append(hands)
                    noise.append(rng.standard_normal(masks[hands].sum()))
                    states.append(rng.bit_generator.state)
                if drawn:
                    than = np.array([rewards[hands] for hands in drawn])
                    targets = np.array([centres[hands] for hands in drawn])
                    explored = np.array([masks[hands] for hands in drawn])
                    targets[explored] += self.parameters.sigma * np.concatenate(noise)
                    attempt = attempts.by_targets(drawn, targets, until=than)
                    tried = len(attempt.rewards)
                    rng.bit_generator.state = states[tried]
                    hands, ahead = drawn[tried - 1], min(2 * ahead, _MOST_DRAWN)
                    if attempt.rewards[-1] > rewards[hands]:
                        ahead = tried
                else:
                    masks[hands], rewards[hands] = attempts.explored(hands), -np.inf
                    attempt = attempts.by_correction(hands)
                    if attempt.rewards[-1] == -np.inf:
                        hopeless.add(hands)
                if attempt.rewards[-1] > rewards[hands]:
                    centres[hands] = np.where(masks[hands], attempt.reached[-1], np.nan)
                    rewards[hands] = float(attempt.rewards[-1])
        return attempts.result(sequences=len(centres))


METHODS: tuple[type[Method], ...] = (Guesses, Climbing, DrawnHands)
