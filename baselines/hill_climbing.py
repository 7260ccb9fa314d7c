"""Hill climbing: a (1+1) search with Gaussian noise for each hand sequence, and random hands.

Each hand sequence has a centre: a configuration for each goal. In the first trial of a sequence
only the corrective process **A** acts (parameter ``begin`` can change this). The configurations in
which this trial hits the goals are the first centre. The targets of each later trial are the centre
plus Gaussian noise on all explored joints. The value of a centre is the reward of the trial that
found it. If a trial has a higher reward, the configurations in which this trial hit the goals
become the new centre, as in the learner. The method would gain more if the targets of the trial
became the new centre: on the paper's tasks, random search with 1,000 ``stages`` gains 0 to 16 ticks
more with targets than with these configurations.

The hands of the first trial are the task's initial hands (parameter ``sequence`` can set the hands
of all trials). Until a trial has succeeded, the hands of the next trials are random. After that,
the hands of a trial are those of the best trial so far, but at each goal, with probability ε, the
hand is replaced by a random hand. The default standard deviation and ε are the learner's; they were
not tuned.

With ``spread="learned"`` each hand sequence has its own standard deviation σ, which follows the
one-fifth rule (Beyer and Schwefel 2002). A trial succeeds if its reward is at least the value of
the centre around which it was drawn. After every W trials around centres of the sequence

- σ is multiplied by 1.5 if more than a fifth of the W trials succeeded;
- otherwise σ is divided by 1.5^(1/4);
- σ is then clipped to the interval from ``floor`` to 0.3.

With motor noise the value of a centre, the reward of a single trial, is partly luck. The learner
has the same bias.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from operator import eq
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from coartic.baselines.uninformed import Attempts, Draw, SequenceParameters
from coartic.method import Facts, Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.motion.solution import Movement, movements_of
from coartic.motion.trials import Trials
from coartic.robot import Array
from coartic.tasks.task import letters_of

_EPSILON = 0.2  # probability of a random hand, for each goal
_GROWTH = 1.5  # factor of the one-fifth rule
_SHRINKAGE = 1.0 / math.sqrt(math.sqrt(_GROWTH))  # square roots round alike on all machines
_MAX_SPREAD = 0.3  # under the one-fifth rule, in length units and rad


class HillClimbingParameters(SequenceParameters):
    """Parameters of hill climbing.

    The defaults of ``trials`` and ``sigma`` are the learner's; the default of ``begin`` is not.
    """

    begin: Literal["correction", "best"] = "correction"
    """Targets of the first trial of a hand sequence:

    - ``"correction"``: there are none; only **A** acts.
    - ``"best"``: similar to the learner's table. If the sequence and the best sequence so far have
      the same hand at a goal and the same hand at the previous goal, the target for this goal is
      the centre of the best sequence plus noise. At all other goals **A** acts. Until a trial has
      succeeded, **A** acts at all goals.
    """
    spread: Literal["fixed", "learned"] = "fixed"
    """``"fixed"`` if the standard deviation is always ``sigma``; ``"learned"`` if it begins with
    ``sigma`` and follows the one-fifth rule."""
    window: Annotated[int, Field(ge=1)] = 100
    """Number W of trials with a hand sequence after which its standard deviation changes under the
    one-fifth rule."""
    floor: Annotated[float, Field(ge=0, le=0.3)] = 0.03
    """Smallest standard deviation under the one-fifth rule, in length units and rad."""


class _Hill:
    """The centre of a hand sequence, and the spread of the trials around it."""

    def __init__(self, spread: float) -> None:
        self.centre: Array = np.empty(0)  # of the explored joints, shape (n,)
        self.value = -math.inf
        self.spread = spread
        self.trials = self.good_trials = 0  # since the spread changed

    def adapt(self, is_good: bool, parameters: HillClimbingParameters) -> None:
        """Count a trial around the centre, and adapt the spread by the one-fifth rule."""
        self.trials += 1
        self.good_trials += is_good
        if self.trials == parameters.window:
            factor = _GROWTH if self.good_trials > parameters.window / 5 else _SHRINKAGE
            self.spread = min(max(self.spread * factor, parameters.floor), _MAX_SPREAD)
            self.trials = self.good_trials = 0


class _Climb:
    """One run of hill climbing: what it knows, how it draws trials, what it learns from them."""

    def __init__(self, session: Session, parameters: HillClimbingParameters) -> None:
        self.parameters, self.rng = parameters, session.rng
        self.given = parameters.told_hands(session)
        self.initial_hands = session.find_initial_hands() if self.given is None else self.given
        self.letters, self.unknown = letters_of(session.hands), "?" * session.goals_count
        self.sequences = 1 if self.given else len(self.letters) ** session.goals_count
        self.attempts = Attempts(session, parameters.trials)
        self.goals = np.nonzero(self.attempts.explored)[0]  # of each explored joint
        self.is_learned = parameters.spread == "learned"
        self.hills: dict[str, _Hill] = {}  # by hand sequence
        self.hopeless: set[str] = set()  # sequences that the corrective process does not complete

    def draw_hands(self) -> str:
        """Draw the hand sequence of a trial."""
        if self.given is not None or not self.attempts.trials_made:
            return self.initial_hands
        letters, rng = self.letters, self.rng
        while True:
            hands = "".join(
                letters[rng.integers(len(letters))]
                if hand == "?" or rng.random() < _EPSILON
                else hand
                for hand in self.attempts.hand_sequence or self.unknown
            )
            if hands not in self.hopeless:
                return hands

    def draw_first(self, hands: str) -> Array:
        """Draw the targets of the first trial of a hand sequence."""
        values, best = np.full(len(self.goals), np.nan), self.attempts.hand_sequence
        if self.parameters.begin == "best" and best:
            pairs, of_best = ([*pairwise(f" {each}")] for each in (hands, best))
            aimed = np.array([*map(eq, pairs, of_best)])[self.goals]
            noise = self.rng.normal(0.0, self.parameters.sigma, aimed.sum())
            values[aimed] = self.hills[best].centre[aimed] + noise
        return values

    def draws(self) -> Iterator[Draw]:
        """Draw trials until the first of a hand sequence, or the last of a window."""
        counts = Counter[str]()
        while (hands := self.draw_hands()) in self.hills:
            hill = self.hills[hands]
            values = hill.centre + self.rng.normal(0.0, hill.spread, len(self.goals))
            yield Draw(hands, values, hill.value)
            counts[hands] += 1
            if self.is_learned and hill.trials + counts[hands] == self.parameters.window:
                return
        yield Draw(hands, self.draw_first(hands), -math.inf)

    def learn(self, drawn: list[Draw], trials: Trials) -> None:
        """Adapt spreads, and move the centre if the last trial is better."""
        if self.is_learned:
            for draw, reward in zip(drawn, trials.rewards, strict=True):
                if draw.hand_sequence in self.hills:
                    is_good = bool(reward >= draw.threshold)
                    self.hills[draw.hand_sequence].adapt(is_good, self.parameters)
        hands, values, threshold = drawn[-1]
        if trials.rewards[-1] > threshold:
            hill = self.hills.setdefault(hands, _Hill(self.parameters.sigma))
            hill.centre = trials.reached[-1, self.attempts.explored]
            hill.value = float(trials.rewards[-1])
        elif np.isnan(values).all():
            self.hopeless.add(hands)

    def recommend(self) -> tuple[Movement, ...]:
        """Return movements to the centre of the hand sequence that the best trial used."""
        hands = self.attempts.hand_sequence
        return movements_of(hands, self.attempts.targets_of(self.hills[hands].centre[None])[0])


class HillClimbing(Method):
    """Hill climbing for each hand sequence, from its best trial so far."""

    name = "hill-climbing"
    tuned_on = "nothing: the paper's values; a learned spread: d000 to d002 of five families"
    title = "hill climbing"
    facts = Facts(works=("beyer2002",))
    information = OPTIMISER_INFORMATION
    Parameters = HillClimbingParameters

    def solve(self, session: Session) -> Result:
        """Make trials until none is left, and return the movements of the best trial.

        With motor noise, movements to a centre are returned instead: the latest centre of the hand
        sequence that the best trial used. A centre consists of the configurations around which
        trials are drawn. The method stops early if the corrective process has failed with each hand
        sequence that the method may use (with parameter ``sequence`` there is only one). The
        details contain the number of the best trial (``best_trial``, from 0) and the number of hand
        sequences with a centre (``sequences``).

        Raises MethodError if no trial hits every goal, NotApplicableError if no initial hands are
        found, and ValueError if parameter ``sequence`` does not fit the task.
        """
        climb = _Climb(session, self.parameters)
        attempts = climb.attempts
        with session.solving():
            while attempts.left > 0 and len(climb.hopeless) < climb.sequences:
                climb.learn(*attempts.run_ahead(climb.draws))
        return attempts.result(climb.recommend, sequences=len(climb.hills))


METHODS: tuple[type[Method], ...] = (HillClimbing,)
