"""Hill climbing, CMA-ES and policy gradient against closed forms and their own rules."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from coartic import PAPER, MotionModel, corrective_trial, hand_sequences, load_task
from coartic.baselines.cma_es import CMAES, GoalByGoal, Strategy
from coartic.baselines.hill_climbing import HillClimbing
from coartic.baselines.policy_gradient import PolicyGradient
from coartic.baselines.random_search import RandomSearch, RandomSearchHands
from coartic.method import MethodError, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from tests.support.strategies import failing_task, solve, tiny_task

METHODS = (HillClimbing, CMAES, GoalByGoal, PolicyGradient)


def test_hands_chosen_goal_by_goal():
    task = load_task("two-armed-2")
    result, _, session = solve(GoalByGoal, task, trials=2000)
    assert session.rewards[0] == corrective_trial(task, "RRRR").reward
    assert result.details["sequences"] > 4
    narrow, *_ = solve(GoalByGoal, task, trials=100, epsilon=0.0)
    assert narrow.details["sequences"] == 1  # nothing else is worth more than what was tried
    assert {movement.hand for movement in narrow.solution} == {"right"}
    with pytest.raises(MethodError):  # without exploration the same hands fail again and again
        solve(GoalByGoal, failing_task(hands="L"), trials=100, epsilon=0.0)
    many = task.model_copy(update={"goals": task.goals[:2] * 7, "initial_hands": "R" * 14})
    result, *_ = solve(GoalByGoal, many, trials=400)
    assert result.details["sequences"] > 4  # of 16,384, which are too many to try


def test_the_bandit_exploits_and_explores():
    """Each sequence begins with its corrective trial; LRLR has -532 at first, the next -574."""
    task = load_task("two-armed-1")
    alone = {hands: corrective_trial(task, hands).reward for hands in hand_sequences(task)}
    result, _, session = solve(CMAES, task, trials=300, exploration=0.0)
    assert sorted(session.rewards[:16]) == sorted(alone.values())
    assert result.details["trials"]["LRLR"] == 300 - 15
    even, *_ = solve(CMAES, task, trials=480, exploration=100.0)
    assert min(even.details["trials"].values()) > 18


SECOND_FOR_THE_RIGHT = tiny_task(
    goals=[[2.0, 2.0], [4.3, 0.8]],
    locked_base=["x", "y"],
    start={"left": [1.0, -0.5, -0.2, 0.1], "right": [0.8, 0.2, 0.1, 0.1]},
)
"""The base is locked and the second goal out of the left hand's reach."""


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_sequences_that_cannot_be_completed_are_left(method):
    often = {"epsilon": 1.0} if method is GoalByGoal else {}  # it may choose them again
    result, execution, session = solve(method, SECOND_FOR_THE_RIGHT, trials=150, **often)
    assert session.meter.trials == 150
    assert session.rewards.count(None) == session.meter.failed_trials == 2
    assert session.rewards.index(execution.reward) == result.details["best_trial"]
    assert execution.reward == max(filter(None, session.rewards))
    assert execution.hands[1] == "R"


def trials_of_hill_climbing(monkeypatch, **options):
    """Return hands, targets, reward and postures of each trial of hill climbing, in order."""
    made, trials = [], Session.trials

    def recorded(self, hands, targets, *args, **kwargs):
        results = trials(self, hands, targets, *args, **kwargs)
        names = [hands] * len(targets) if isinstance(hands, str) else hands
        made.extend(zip(names, targets, results.rewards, results.reached))  # noqa: B905 (budget)
        return results

    monkeypatch.setattr(Session, "trials", recorded)
    solve(HillClimbing, "two-armed-1", **{"trials": 600, **options})
    return made


@pytest.mark.parametrize("begin", ["correction", "best"])
def test_where_hill_climbing_begins_a_hand_sequence(begin, monkeypatch):
    """With ``best``: at the best trial's postures where hand and hand before are the same."""
    best, first, shared = (-np.inf, "", None), 0, 0
    known = set()
    for hands, targets, reward, reached in trials_of_hill_climbing(monkeypatch, begin=begin):
        if hands not in known:
            known.add(hands)
            first += 1
            for goal in range(4):
                same = hands[max(goal - 1, 0) : goal + 1] == best[1][max(goal - 1, 0) : goal + 1]
                if begin == "best" and same:
                    shared += 1
                    away = np.nanstd(targets[goal] - best[2][goal])
                    assert 0.01 < away < 0.12  # of nine values with SD 0.05
                else:
                    assert np.isnan(targets[goal]).all()
        if reward > best[0]:
            best = reward, hands, reached
    assert first > 8
    assert (shared > 8) == (begin == "best")


@pytest.mark.parametrize("floor", [0.0, 0.035])
def test_the_one_fifth_rule(floor, monkeypatch):
    """Recomputed from the trials: centres, good trials, and the scatter of targets in a window."""
    centres, spreads, windows = {}, {}, {}
    ratios, kept = [], 0
    options = {"spread": "learned", "window": 50, "floor": floor, "trials": 4000}
    for hands, targets, reward, reached in trials_of_hill_climbing(monkeypatch, **options):
        if hands in centres:
            spread, (scatter, good) = spreads.setdefault(hands, 0.05), windows[hands]
            scatter.extend((targets - centres[hands][1])[~np.isnan(targets)])
            good.append(reward >= centres[hands][0])
            if len(good) == 50:
                ratios.append(np.std(scatter) / spread)
                wanted = spread * (1.5 if sum(good) > 10 else 1.5**-0.25)
                spreads[hands] = max(wanted, floor)
                kept += wanted < floor
                windows[hands] = [], []
        if hands not in centres or reward > centres[hands][0]:
            centres[hands] = reward, reached
            windows.setdefault(hands, ([], []))
    assert len(ratios) > 50  # each is of at least 1,800 normal numbers
    assert max(np.abs(np.array(ratios) - 1.0)) < 0.08
    assert (kept > 10) == (floor > 0.0)
    assert len({*spreads.values()}) > 1


@pytest.mark.parametrize("method", [HillClimbing, CMAES, PolicyGradient])
@pytest.mark.parametrize("world", [PAPER, MotionModel(motor_noise=0.01)])
def test_hands_given(method, world):
    """All trials have them, also if other hands are better."""
    options = {"trials": 300, "sequence": "RLRR", "model": world}
    result, execution, session = solve(method, "two-armed-2", **options)
    assert execution.hands == "RLRR"
    assert session.meter.trials == 300
    if not world.motor_noise:
        assert session.rewards[0] == corrective_trial("two-armed-2", "RLRR").reward
        assert execution.reward == max(session.rewards) > session.rewards[0]
    else:
        assert {movement.kind for movement in result.solution} == {"learned"}
    with pytest.raises(ValueError, match="hands"):
        solve(method, "two-armed-2", trials=300, sequence="RLX")
    with pytest.raises(MethodError):
        solve(method, failing_task(hands="R"), trials=50, sequence="L")


class HalfOfAPlain:
    """A quadratic reward around (1, 1, 1); beyond 0.5 in the first joint trials fail."""

    left, explored = 10**6, np.ones((1, 3), dtype=bool)

    def __init__(self):
        self.sizes = []

    def run_corrective(self, hands):
        return SimpleNamespace(rewards=np.array([-300.0]), reached=np.zeros((1, 1, 3)))

    def around(self, hands, values):
        self.sizes.append(len(values))
        self.failed = values[:, 0] > 0.5
        rewards = -100.0 * ((values - 1.0) ** 2).sum(axis=1)
        return SimpleNamespace(rewards=np.where(self.failed, -np.inf, rewards))


def test_failed_trials_rank_last():
    """The best that does not fail is (0.5, 1, 1), with -25."""
    attempts = HalfOfAPlain()
    session = Session(load_task("ascending"), 0, OPTIMISER_INFORMATION)
    strategy = Strategy(session, attempts, "R", 0.05)
    failed = []
    for _ in range(80):
        strategy.generation()
        failed.append(attempts.failed.mean())
    assert -26.0 < strategy.reward <= -25.0
    assert 0.0 < np.mean(failed) < 0.7
    for _ in range(400):
        strategy.generation()
    assert [*dict.fromkeys(attempts.sizes)][:3] == [7, 14, 28]  # it begins anew with twice as many


@pytest.mark.parametrize("method", [*METHODS, RandomSearch, RandomSearchHands])
def test_without_a_trial_that_hits_every_goal_it_is_infeasible(method):
    for options in ({"trials": 50, "model": MotionModel(max_iterations=2)}, {"budget": 0}):
        with pytest.raises(MethodError) as caught:
            solve(method, "two-armed-2", **options)
        assert caught.value.outcome == "infeasible"


def test_a_single_joint_to_explore():
    task = tiny_task(
        hands=["right"],
        goals=[[0.5, 1.1]],
        locked_base=["x", "y"],
        robot={"right_links": [1.0]},
        start={"left": [0.0] * 4, "right": [0.5]},
    )
    *_, session = solve(CMAES, task, trials=60)
    # Turns by pi/2 - 0.5 less the angle under which half the disc's chord is seen.
    turn = math.pi / 2 - 0.5 - 2 * math.asin(0.1 / 2)
    assert max(session.rewards) == -(math.ceil(turn / 0.01) + 1)
