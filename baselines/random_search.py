"""Random search: the paper's learner without its memory; the best trial is kept.

Every trial draws Gaussian noise, by default with the learner's standard deviation, around the
postures in which the corrective process hits the goals; the first trials are the corrective process
alone. With one stage, the default, no noise depends on earlier rewards, so that random search
cannot coarticulate by learning: its best trial shows the effect of selecting one of many noisy
trials by the reward of the whole task. It is the control of signatures of coarticulation
(:mod:`coartic.analysis.control`).

With ``stages`` above 1 the trials are equal parts, and after each part the centre of the noise
moves to the best trial so far, to the postures that this trial reached or to the targets that it
aimed at (``keep``).

``random-search`` has the hands with which the corrective process alone does best, or hands given.
In ``random-search/hands`` every hand sequence gets as many of the trials; the best of all is the
solution.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from coartic.baselines.uninformed import Attempts
from coartic.internal.validation import sentence_error
from coartic.learner.conditions import MOST_NOISE
from coartic.learner.learning import TRIALS, runs_at_once
from coartic.method import Method, MethodError, Parameters, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION, sequences_of
from coartic.robot import HANDS
from coartic.tasks.task import hands_of

_POINTS_AT_ONCE = 500


class RandomSearchHandsParameters(Parameters):
    """Parameters of random search with every hand sequence."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run, trials of the corrective process alone among them."""
    sigma: Annotated[float, Field(gt=0, le=MOST_NOISE)] = 0.05
    """SD of the noise on each explored joint, length unit (base) and rad (joints); the default is
    the learner's."""
    stages: Annotated[int, Field(ge=1)] = 1
    """Number r of equal parts of the T trials with a hand sequence: part k ends after ⌊kT/r⌋
    trials, and then noise is drawn around the best trial so far. 1: nothing is kept."""
    keep: Literal["postures", "targets"] = "postures"
    """Centre of the noise after a part: the postures in which the best trial hit its goals, or the
    targets that it aimed at. No effect with one stage."""
    idle_arm: bool = True
    """True if an arm gets noise also at goals that the other hand is to hit. If False, it keeps
    still there, as under the learner's condition EC3."""

    @model_validator(mode="after")
    def _check_stages(self) -> Self:
        if self.stages > self.trials:
            raise sentence_error(
                f"stages is {self.stages}; it may be at most the number of trials, {self.trials}"
            )
        return self


class RandomSearchParameters(RandomSearchHandsParameters):
    """Parameters of random search."""

    hands: str | None = None
    """Hand sequence, such as ``"RRLR"``; by default the sequence with which the corrective process
    alone gets the highest reward (of as many as there are trials), or the task's initial sequence
    where more than 4096 exist."""


def draw_trials(
    session: Session, hands: str | None, parameters: RandomSearchHandsParameters
) -> tuple[Attempts, int]:
    """Make a trial of the corrective process alone with one or more hand sequences, then trials
    with noise with the best of them until none is left; return an account of the trials, which
    keeps the best trial of all, and the number of trials with noise.

    ``hands``: a hand sequence, or None for the sequence with which the process alone does best,
    among as many as there are trials; where more than 4096 exist, the task's initial sequence.
    ``parameters.trials``: most trials, both kinds together. Raises MethodError without a single
    trial, and if the process completes none of the sequences; ValueError for ``hands`` that do not
    fit the task.
    """
    attempts = Attempts(session, parameters.trials)
    trials = attempts.left
    if trials <= 0:
        raise MethodError("infeasible", "the budget leaves no trial to make")
    attempts.by_correction(*(sequences_of(session) if hands is None else [hands])[:trials])
    if not (chosen := attempts.hands):
        raise MethodError("infeasible", "the corrective process completes no hand sequence")
    explored = attempts.explored.copy()
    for goal, hand in enumerate(hands_of(chosen)):
        for other in HANDS:
            if other != hand and not parameters.idle_arm:
                explored[goal, session.joints(other)] = False
    centre, alone = attempts.reached[explored], attempts.trials_made
    targets = np.full((_POINTS_AT_ONCE, *explored.shape), np.nan)
    stage, more = 0, True
    while more:
        more = attempts.left >= _POINTS_AT_ONCE
        noise = session.rng.normal(0.0, parameters.sigma, (_POINTS_AT_ONCE, len(centre)))
        while len(noise) and attempts.left > 0:
            while (ends := trials * (stage + 1) // parameters.stages) <= attempts.trials_made:
                stage += 1
                if attempts.best_trial >= alone:
                    kept = attempts.reached if parameters.keep == "postures" else attempts.targets
                    centre = kept[explored]
            part, noise = np.split(noise, [ends - attempts.trials_made])
            targets[: len(part), explored] = centre + part
            attempts.by_targets(chosen, targets[: min(len(part), attempts.left)])
    return attempts, attempts.trials_made - alone


class RandomSearchHands(Method):
    """Random search that divides its trials evenly among all hand sequences; if more than 4096
    exist, it has the task's initial hand sequence alone."""

    name = "random-search/hands"
    tuned_on = "nothing: the paper's values"
    title = "Random search with every hand sequence"
    citation = (
        "L. A. Rastrigin (1963). The convergence of the random search method in the extremal "
        "control of a many parameter system. Automation and Remote Control."
    )
    information = OPTIMISER_INFORMATION
    Parameters = RandomSearchHandsParameters

    def max_batch(self) -> int:
        """Return the largest number of sessions for one call of :meth:`solve_together`: 72, or
        fewer if their runs have more than 4,000,000 trials together; at least 1. The runs are made
        one after the other."""
        return runs_at_once(self.parameters.trials)

    def solve(self, session: Session) -> Result:
        """Give one hand sequence after the other an equal share of the trials, to a trial; if the
        corrective process fails there, only the first is made. Return the movements of the best
        trial. Raises MethodError if that process completes no hand sequence that has a trial.
        """
        parameters: RandomSearchHandsParameters = self.parameters
        sequences, left = sequences_of(session), session.trials_left
        trials = parameters.trials if left is None else min(parameters.trials, left)
        ends = [trials * n // len(sequences) for n in range(len(sequences) + 1)]
        completed: list[Attempts] = []
        with session.solving():
            for hands, (begin, end) in zip(sequences, pairwise(ends), strict=True):
                share = parameters.model_copy(update={"trials": end - begin})
                with suppress(MethodError):
                    completed.append(draw_trials(session, hands, share)[0])
        if not completed:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        best = max(completed, key=lambda attempts: attempts.reward)
        return Result(best.solution, {"sequences": len(completed)})


class RandomSearch(RandomSearchHands):
    """Random search with one hand sequence."""

    name = "random-search"
    title = "Random search around the corrective process"
    Parameters = RandomSearchParameters

    def solve(self, session: Session) -> Result:
        """Make a trial of the corrective process alone with parameter ``hands``, or by default with
        each of the sequences that :func:`draw_trials` names, then trials with noise with the best
        of them until none is left; return the movements of the best trial. Raises MethodError if
        there is no trial to make, or if that process completes no sequence tried; ValueError for
        ``hands`` that do not fit the task."""
        parameters: RandomSearchParameters = self.parameters
        with session.solving():
            best, evaluations = draw_trials(session, parameters.hands, parameters)
        return Result(best.solution, {"evaluations": evaluations})


METHODS: tuple[type[Method], ...] = (RandomSearch, RandomSearchHands)
