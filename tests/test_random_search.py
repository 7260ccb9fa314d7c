"""Random search in stages against a loop over single trials, and its runs of version 4.0.0."""

import numpy as np
import pytest

from coartic import load_task
from coartic.baselines.random_search import RandomSearch, RandomSearchHands
from coartic.method import Session
from coartic.method.optimisers import OPTIMISER_INFORMATION, explored_joints
from tests.support.strategies import solve

HANDS = {"descending": "RRR", "two-armed-1": "RRLR"}


def one_by_one(name, seed, trials, ends, keep="postures", idle_arm=True):
    """Random search as it is defined, one trial after the other; ``ends``: trials after which the
    centre moves to the best trial. Returns the rewards of all trials."""
    task, hands = load_task(name), HANDS[name]
    session = Session(task, seed, OPTIMISER_INFORMATION)
    explored = np.tile(explored_joints(session), (len(hands), 1))
    for goal, letter in enumerate(hands if not idle_arm else ""):
        explored[goal, session.joints("left" if letter == "R" else "right")] = False
    made = [session.trials(hands, np.full((1, *explored.shape), np.nan))]
    centre = made[0].reached[0]
    while len(made) < trials:
        if len(made) in ends:
            best = made[int(np.argmax([trial.rewards[0] for trial in made]))]
            centre = (best.reached if keep == "postures" or best is made[0] else best.targets)[0]
        targets = np.full((1, *explored.shape), np.nan)
        noise = session.rng.normal(0.0, 0.05, explored.sum())
        targets[0, explored] = centre[explored] + noise
        made.append(session.trials(hands, targets))
    return [trial.rewards[0] for trial in made]


ENDS = {
    (40, 1): [],
    (40, 4): [10, 20, 30],
    (40, 7): [5, 11, 17, 22, 28, 34],  # 40 k / 7, rounded down
    (13, 13): range(1, 13),  # a hill climber: the centre is the best trial so far
    (1_030, 2): [515],  # more than are made at once
}


@pytest.mark.parametrize(
    ("task", "keep", "idle_arm", "trials", "stages"),
    [
        *(("two-armed-1", "postures", True, *each) for each in ENDS),
        ("two-armed-1", "targets", False, 40, 4),
        ("descending", "postures", False, 40, 4),
        ("two-armed-1", "targets", True, 40, 4),
        ("descending", "targets", True, 13, 13),
    ],
)
def test_trials_in_stages_are_those_made_one_by_one(task, keep, idle_arm, trials, stages):
    options = {"hands": HANDS[task], "stages": stages, "keep": keep, "idle_arm": idle_arm}
    result, execution, session = solve(RandomSearch, task, trials=trials, **options)
    rewards = one_by_one(task, 0, trials, ENDS[trials, stages], keep, idle_arm)
    assert session.rewards == rewards
    assert execution.reward == max(rewards)
    assert result.details == {"evaluations": trials - 1}


def test_every_hand_sequence_has_stages_of_its_own_share():
    task = load_task("two-armed-1")
    *_, session = solve(RandomSearchHands, task, trials=160, stages=3)
    *_, alone = solve(RandomSearchHands, task, trials=160)
    assert session.meter.trials == alone.meter.trials == 160
    first = load_task("two-armed-1").initial_hands
    *_, given = solve(RandomSearch, task, trials=10, stages=3, hands=first)
    assert session.rewards[:10] == given.rewards
    few, *_ = solve(RandomSearchHands, task, trials=20, stages=20)  # a trial or two a sequence
    assert few.details == {"sequences": 16}
