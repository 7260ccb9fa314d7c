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
from collections import Counter, defaultdict
from itertools import pairwise
from operator import eq
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from coartic.baselines.uninformed import Attempts, SequenceParameters
from coartic.method import Facts, Method, Result, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.motion.solution import Movement, movements_of
from coartic.robot import Array
from coartic.tasks.task import letters_of

_EPSILON = 0.2  # probability of a random hand, for each goal
_GROWTH = 1.5  # factor of the one-fifth rule
_SHRINKAGE = 1.0 / math.sqrt(math.sqrt(_GROWTH))  # square roots round alike on all machines
_MAX_SPREAD = 0.3  # under the one-fifth rule, in length units and rad
_MAX_DRAWN_TRIALS = 128  # largest number of trials that are drawn ahead


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
        parameters: HillClimbingParameters = self.parameters
        is_learned, window = parameters.spread == "learned", parameters.window
        given, rng = parameters.told_hands(session), session.rng
        initial_hands = session.find_initial_hands() if given is None else given
        letters = letters_of(session.hands)
        attempts = Attempts(session, parameters.trials)
        sequences, ahead = 1 if given else len(letters) ** session.goals_count, 1
        explored, dim = attempts.explored, attempts.explored.sum()
        centres: dict[str, Array] = {}  # by hand sequence, (G, dof); NaN for joints not explored
        rewards: dict[str, float] = {}  # of the centre, by hand sequence
        spreads = defaultdict[str, float](lambda: parameters.sigma)  # by hand sequence
        since, good = Counter[str](), Counter[str]()  # trials since a spread changed; good ones
        hopeless: set[str] = set()  # sequences that the corrective process does not complete

        def draw(best: str) -> str:
            """Draw a hand sequence with which the corrective process has not failed.

            With parameter ``sequence`` the result is that sequence. Otherwise all hands are random
            if ``best``, the hand sequence of the best trial, is empty. If it is not, the hands are
            those of ``best``, but at each goal, with probability 0.2, the hand is replaced by a
            random hand.
            """
            if given is not None:
                return given
            while True:
                chosen = list(best or letters[0] * session.goals_count)
                for goal in range(len(chosen)):
                    if not best or rng.random() < _EPSILON:
                        chosen[goal] = letters[rng.integers(len(letters))]
                if (hand_sequence := "".join(chosen)) not in hopeless:
                    return hand_sequence

        def adapt(hand_sequence: str, is_good: bool) -> None:
            """Count a trial with a hand sequence, and adapt the sequence's spread.

            The spread follows the one-fifth rule. ``is_good`` is True if the reward of the trial is
            at least the value of the centre around which it was drawn.
            """
            since[hand_sequence] += 1
            good[hand_sequence] += is_good
            if since[hand_sequence] == window:
                factor = _GROWTH if good[hand_sequence] > window / 5 else _SHRINKAGE
                wanted = max(spreads[hand_sequence] * factor, parameters.floor)
                spreads[hand_sequence] = min(wanted, _MAX_SPREAD)
                since[hand_sequence] = good[hand_sequence] = 0

        def begin(hand_sequence: str) -> Array:
            """Return the targets of the first trial of a hand sequence, shape ``(G, dof)``."""
            targets = np.full(explored.shape, np.nan)
            if parameters.begin == "best" and attempts.hand_sequence:
                states, of_best = (
                    [*pairwise(f" {each}")] for each in (hand_sequence, attempts.hand_sequence)
                )
                shared = np.array([*map(eq, states, of_best)])
                aimed = shared[:, None] & explored
                noise = parameters.sigma * rng.standard_normal(aimed.sum())
                targets[aimed] = centres[attempts.hand_sequence][aimed] + noise
            return targets

        with session.solving():
            while attempts.left > 0 and len(hopeless) < sequences:
                # Draws do not depend on rewards until a centre moves, which is rare, or a spread
                # changes. So trials are drawn ahead and made side by side, up to the end of a
                # window. If a trial moves a centre, the later draws are discarded: the generator is
                # set back, and makes the draws up to this trial again.
                drawn, noise = list[str](), list[Array]()
                state, best = rng.bit_generator.state, attempts.hand_sequence
                while len(drawn) < min(ahead, attempts.left):
                    hand_sequence = draw(best) if attempts.trials_made else initial_hands
                    if hand_sequence not in centres:
                        break
                    drawn.append(hand_sequence)
                    noise.append(rng.standard_normal(dim))
                    if is_learned and since[hand_sequence] + drawn.count(hand_sequence) == window:
                        break
                if drawn:
                    thresholds = np.array([rewards[hand_sequence] for hand_sequence in drawn])
                    targets = np.array([centres[hand_sequence] for hand_sequence in drawn])
                    scales = np.array([spreads[hand_sequence] for hand_sequence in drawn])
                    targets[:, explored] += scales[:, None] * np.array(noise)
                    attempt = attempts.run_targets(drawn, targets, until=thresholds)
                    tried = len(attempt.rewards)
                    if tried < len(drawn) or hand_sequence not in centres:
                        rng.bit_generator.state = state
                        for _ in range(tried):
                            draw(best)
                            rng.standard_normal(dim)
                    hand_sequence, ahead = drawn[tried - 1], min(2 * ahead, _MAX_DRAWN_TRIALS)
                    if attempt.rewards[-1] > rewards[hand_sequence]:
                        ahead = tried
                    if is_learned:
                        for each, is_good in zip(
                            drawn[:tried], attempt.rewards >= thresholds[:tried], strict=True
                        ):
                            adapt(each, bool(is_good))
                else:
                    rewards[hand_sequence] = -np.inf
                    targets = begin(hand_sequence)
                    attempt = attempts.run_targets([hand_sequence], targets[None])
                    if attempt.rewards[-1] == -np.inf and np.isnan(targets).all():
                        hopeless.add(hand_sequence)
                if attempt.rewards[-1] > rewards[hand_sequence]:
                    centres[hand_sequence] = np.where(explored, attempt.reached[-1], np.nan)
                    rewards[hand_sequence] = float(attempt.rewards[-1])

        def centre() -> tuple[Movement, ...]:
            return movements_of(attempts.hand_sequence, centres[attempts.hand_sequence])

        return attempts.result(centre, sequences=len(centres))


METHODS: tuple[type[Method], ...] = (HillClimbing,)
