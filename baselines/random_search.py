"""Random search: the paper's learner without its table.

In the first trials only the corrective process acts. The targets of each later trial are the
postures in which the corrective process hits the goals, plus Gaussian noise, by default with the
learner's standard deviation. The solution is the best trial.

With one stage, the default, the noise does not depend on earlier rewards. So random search cannot
learn to coarticulate. Its best trial shows what selection alone does: one of many noisy trials is
selected by the reward of the whole task. Therefore random search is the control for the signatures
of coarticulation (:mod:`coartic.analysis.control`). Random search stores only its best trial. So
the targets of its solution are those of the best trial, also with motor noise.

With ``stages`` above 1 the trials are divided into equal parts. After each part, the centre of the
noise moves to the best trial so far. Parameter ``keep`` decides whether the new centre consists of
the postures that the best trial reached, or of its targets.

``random-search`` uses the hands of parameter ``hands`` or, by default, the hands with which the
corrective process on its own gets the highest reward. ``random-search/hands`` divides its trials
equally among all hand sequences. Its solution is the best trial over all sequences.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from coartic.baselines.uninformed import Attempts
from coartic.internal.validation import described_error
from coartic.learner.conditions import MAX_NOISE
from coartic.learner.learning import runs_at_once
from coartic.method import TRIALS, Facts, Method, MethodError, Parameters, Result, Session
from coartic.method.as_method import HandsOrMethod
from coartic.method.optimisers import OPTIMISER_INFORMATION, sequences_of
from coartic.robot import HANDS
from coartic.tasks.task import hands_of

_POINTS_AT_ONCE = 500


class RandomSearchHandsParameters(Parameters):
    """Parameters of random search over all hand sequences."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Largest number of trials of a run, including those in which only the corrective process
    acts."""
    sigma: Annotated[float, Field(gt=0, le=MAX_NOISE)] = 0.05
    """Standard deviation of the noise on each explored joint, in length units (base) and rad
    (joints). The default is the learner's."""
    stages: Annotated[int, Field(ge=1)] = 1
    """Number r of equal parts into which T trials are divided. T is the number of trials of the run
    (in ``random-search/hands``, of trials with one hand sequence), including those in which only
    the corrective process acts. Part k (from 1) ends after ⌊kT/r⌋ trials; in the next part the
    noise is centred on the best trial so far. With one stage the centre does not move."""
    keep: Literal["postures", "targets"] = "postures"
    """Centre of the noise after a part: the postures in which the best trial hit the goals
    (``"postures"``), or the targets of the best trial (``"targets"``). This parameter has no effect
    with one stage."""
    idle_arm: bool = True
    """True if the idle arm (the arm of the hand that is not chosen for a goal) gets noise as well.
    If False, the idle arm does not move, as under the learner's condition EC3. The arm of a hand
    that the task does not use never moves."""

    @model_validator(mode="after")
    def _check_stages(self) -> Self:
        if self.stages > self.trials:
            raise described_error(
                f"stages is {self.stages}; it must be at most the number of trials, {self.trials}"
            )
        return self


class RandomSearchParameters(RandomSearchHandsParameters):
    """Parameters of random search."""

    hands: HandsOrMethod | None = None
    """Hand sequence, such as ``"RRLR"``, or ``"as METHOD"`` for the hands of the answer of another
    method, such as ``"as dual-process/EC4"``. By default the method first makes one trial with each
    sequence (while trials are left), in which only the corrective process acts. Then it uses the
    sequence with the highest reward. If there are more than 4096 sequences, it uses the task's
    initial sequence."""


def draw_trials(
    session: Session, hands: str | None, parameters: RandomSearchHandsParameters
) -> tuple[Attempts, int]:
    """Make trials with Gaussian noise around a centre, until the trial budget is used up.

    The first centre consists of the postures in which the corrective process hit the goals.

    Parameters
    ----------
    session : Session
        Session in which the trials are made and counted.
    hands : str or None
        Hand sequence, or None for the default of :class:`RandomSearchParameters`.
    parameters : RandomSearchHandsParameters
        Parameters; ``trials`` counts trials of the corrective process and trials with noise.

    Returns
    -------
    Attempts
        The number of trials that were made, and the best trial.
    int
        Number of trials with noise.

    Raises
    ------
    MethodError
        No trial is left to make, or the corrective process completes none of the sequences tried.
    NotApplicableError
        ``hands`` is None, there are more than 4096 sequences, and no initial one is found.
    ValueError
        ``hands`` do not fit the task.
    """
    attempts = Attempts(session, parameters.trials)
    trials = attempts.left
    if trials <= 0:
        raise MethodError("infeasible", "the trial budget is used up, so that no trial can be made")
    attempts.run_corrective(*(sequences_of(session) if hands is None else [hands])[:trials])
    if not (chosen := attempts.hand_sequence):
        raise MethodError("infeasible", "the corrective process completes no hand sequence")
    explored = attempts.explored.copy()
    for goal, hand in enumerate(hands_of(chosen)):
        for other in HANDS:
            if other != hand and not parameters.idle_arm:
                explored[goal, session.joints(other)] = False
    centre, corrective_trials = attempts.reached[explored], attempts.trials_made
    targets = np.full((_POINTS_AT_ONCE, *explored.shape), np.nan)
    stage, goes_on = 0, True
    while goes_on:
        goes_on = attempts.left >= _POINTS_AT_ONCE
        noise = session.rng.normal(0.0, parameters.sigma, (_POINTS_AT_ONCE, len(centre)))
        while len(noise) and attempts.left > 0:
            while (ends := trials * (stage + 1) // parameters.stages) <= attempts.trials_made:
                stage += 1
                if attempts.best_trial >= corrective_trials:
                    is_posture = parameters.keep == "postures"
                    best = attempts.reached if is_posture else attempts.targets
                    centre = best[explored]
            part, noise = np.split(noise, [ends - attempts.trials_made])
            targets[: len(part), explored] = centre + part
            attempts.run_targets(chosen, targets[: min(len(part), attempts.left)])
    return attempts, attempts.trials_made - corrective_trials


class RandomSearchHands(Method):
    """Random search that divides its trials equally among all hand sequences.

    If the task has more than 4096 sequences, the method uses only the task's initial sequence.
    """

    name = "random-search/hands"
    tuned_on = "nothing: the paper's values"
    title = "random search, every hand sequence"
    facts = Facts(
        works=("rastrigin1963",),
        algorithm="random search",
        short="random search, hands",
        headline=False,
    )
    information = OPTIMISER_INFORMATION
    Parameters = RandomSearchHandsParameters

    def max_batch(self) -> int:
        """Return the largest number of sessions for one call of :meth:`solve_together`.

        The number is from 1 to 72. If it is above 1, the sessions together make at most 4,000,000
        trials.
        """
        return runs_at_once(self.parameters.trials)

    def solve(self, session: Session) -> Result:
        """Divide the trials among the hand sequences, and return the movements of the best trial.

        The numbers of trials of two sequences differ by at most one. If the corrective process
        fails with a sequence, the other trials of this sequence are not made. The details contain
        the number of sequences with which the corrective process hit every goal (``sequences``).
        Raises MethodError if there is no such sequence.
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
    title = "random search"
    facts = Facts(works=("rastrigin1963",))
    Parameters = RandomSearchParameters

    def solve(self, session: Session) -> Result:
        """Make trials until none is left, and return the movements of the best trial.

        The details contain the number of trials with noise (``evaluations``). Raises MethodError if
        no trial is left to make, or if the corrective process completes the task with none of the
        sequences tried.
        """
        parameters: RandomSearchParameters = self.parameters
        with session.solving():
            best, evaluations = draw_trials(session, parameters.hands, parameters)
        return Result(best.solution, {"evaluations": evaluations})


METHODS: tuple[type[Method], ...] = (RandomSearch, RandomSearchHands)
