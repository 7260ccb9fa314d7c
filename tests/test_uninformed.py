"""Hill climbing, CMA-ES and policy gradient against closed forms and their own rules."""

import math
from collections import namedtuple
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from coartic import MotionModel, corrective_trial, execute_noisy, hand_sequences, load_task
from coartic.baselines import cma_es
from coartic.baselines.cma_es import CMAES, GoalByGoal, Strategy
from coartic.baselines.cma_strategy import EvolutionStrategy
from coartic.baselines.hill_climbing import HillClimbing
from coartic.baselines.policy_gradient import PolicyGradient
from coartic.baselines.random_search import RandomSearch, RandomSearchHands
from coartic.baselines.uninformed import Attempts, Draw
from coartic.method import MethodError, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.motion.solution import movements_of
from coartic.tasks.task import letters_of
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


Trial = namedtuple("Trial", "hands targets reward reached")


def trials_of(method, monkeypatch, **options):
    """Return hands, targets, reward and postures of each trial of a method, in order."""
    made, trials = [], Session.trials

    def recorded(self, hands, targets, *args, **kwargs):
        results = trials(self, hands, targets, *args, **kwargs)
        names = [hands] * len(targets) if isinstance(hands, str) else hands
        rows = zip(names, targets.copy(), results.rewards, results.reached)  # noqa: B905 (budget)
        made.extend(map(Trial._make, rows))
        return results

    with monkeypatch.context() as patch:
        patch.setattr(Session, "trials", recorded)
        solve(method, "two-armed-1", **options)
    return made


def draw_one(rng, hills, made):
    """Draw hands at random, and targets around their centre.

    The spread becomes smaller after every 40 trials. The first trial with hands has no targets.
    """
    hands = "".join(rng.choice(["L", "R"], 4))
    if hands not in hills:
        return Draw(hands, np.full(36, np.nan), -np.inf)
    centre, value = hills[hands]
    return Draw(hands, centre + 0.1 / (1 + made // 40) * rng.standard_normal(36), value)


@pytest.mark.parametrize("world", [MotionModel(), MotionModel(motor_noise=0.01)])
@pytest.mark.parametrize("seed", range(3))
def test_trials_drawn_ahead_are_those_of_a_loop_that_makes_one_at_a_time(seed, world):
    task, trials = load_task("two-armed-1"), 600
    moves = np.tile([True, False, *[True] * 8], (4, 1))  # the base is locked in y

    def new_session():
        return Session(task, seed, OPTIMISER_INFORMATION, model=world, trial_budget=trials)

    session, hills, slow = new_session(), {}, []
    for made in range(trials):
        draw = draw_one(session.rng, hills, made)
        targets = np.full((1, 4, 10), np.nan)
        targets[:, moves] = draw.values
        results = session.trials([draw.hand_sequence], targets)
        slow.append((draw, results.rewards[0]))
        if results.rewards[0] > draw.threshold:
            hills[draw.hand_sequence] = results.reached[0][moves], results.rewards[0]

    ahead, hills, fast, calls = new_session(), {}, [], 0
    attempts = Attempts(ahead, 10 * trials)

    def draws():
        for made in count(attempts.trials_made):
            draw = draw_one(ahead.rng, hills, made)
            yield draw
            if draw.hand_sequence not in hills or made % 40 == 39:
                return

    while attempts.left > 0:
        calls += 1
        drawn, results = attempts.run_ahead(draws)
        fast += zip(drawn, results.rewards, strict=True)
        last, reward = fast[-1]
        if reward > last.threshold:
            hills[last.hand_sequence] = results.reached[-1][moves], reward

    assert ahead.rewards == session.rewards
    assert ahead.rng.bit_generator.state == session.rng.bit_generator.state
    for (one, one_reward), (other, other_reward) in zip(slow, fast, strict=True):
        assert (one.hand_sequence, one.threshold) == (other.hand_sequence, other.threshold)
        np.testing.assert_array_equal(one.values, other.values)
        assert one_reward == other_reward
    best, best_reward = max(slow, key=lambda trial: trial[1])
    assert (attempts.reward, attempts.hand_sequence) == (best_reward, best.hand_sequence)
    assert attempts.best_trial == [reward for _, reward in slow].index(best_reward)
    assert calls < trials / 3


@pytest.mark.parametrize("begin", ["correction", "best"])
def test_where_hill_climbing_begins_a_hand_sequence(begin, monkeypatch):
    """With ``best``: at the best trial's postures where hand and hand before are the same."""
    best, first, shared = (-np.inf, "", None), 0, 0
    known = set()
    for hands, targets, reward, reached in trials_of(
        HillClimbing, monkeypatch, trials=600, begin=begin
    ):
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


NOISY = MotionModel(motor_noise=0.02)


def test_hill_climbing_answers_the_point_round_which_it_would_draw_next(monkeypatch):
    """With next to no perturbation: the next trial with these hands is at their centre."""
    options = {"model": NOISY, "sigma": 1e-9}
    made = trials_of(HillClimbing, monkeypatch, trials=900, **options)
    for trials in (60, 150, 300):
        result, *_ = solve(HillClimbing, "two-armed-1", trials=trials, **options)
        hands = letters_of([movement.hand for movement in result.solution])
        rewards = [trial.reward for trial in made[:trials]]
        assert hands == made[int(np.argmax(rewards))].hands
        following = next(trial for trial in made[trials:] if trial.hands == hands)
        targets = [movement.target for movement in result.solution]
        np.testing.assert_allclose(targets, following.targets, atol=1e-7)


@pytest.mark.parametrize("method", [RandomSearch, RandomSearchHands])
def test_random_search_answers_the_targets_of_its_best_trial(method, monkeypatch):
    made = trials_of(method, monkeypatch, trials=400, model=NOISY, idle_arm=False)
    result, *_ = solve(method, "two-armed-1", trials=400, model=NOISY, idle_arm=False)
    best = made[int(np.argmax([trial.reward for trial in made]))]
    assert result.solution == movements_of(best.hands, best.targets)


@pytest.mark.parametrize("method", [CMAES, GoalByGoal])
def test_cma_es_answers_the_mean_with_the_best_last_generation(method, monkeypatch):
    """Of all restarts and hand sequences, each with the mean after its last generation."""
    lasts = {}

    class Recorded(EvolutionStrategy):
        def tell(self, points, costs):
            super().tell(points, costs)
            lasts[id(self)] = costs.mean(), self.mean, self  # kept, so that ids stay its own

    monkeypatch.setattr(cma_es, "EvolutionStrategy", Recorded)
    result, *_ = solve(method, "two-armed-1", trials=2500, model=NOISY)
    cost, mean, _ = min(lasts.values(), key=lambda last: last[0])
    assert len(lasts) > 3
    targets = np.array([movement.target for movement in result.solution])
    np.testing.assert_array_equal(targets[~np.isnan(targets)], mean)
    assert execute_noisy("two-armed-1", [result.solution], 0.02, 50, 0).mean() < cost + 10


def test_cma_es_without_a_generation_answers_postures_of_the_corrective_process(monkeypatch):
    (made,) = trials_of(CMAES, monkeypatch, trials=1, model=NOISY)
    result, *_ = solve(CMAES, "two-armed-1", trials=1, model=NOISY)
    targets = np.array([movement.target for movement in result.solution])
    moves = ~np.isnan(targets)
    np.testing.assert_array_equal(targets[moves], made.reached[moves])
    assert moves.sum() == 4 * 9  # the base is locked in y


def test_a_mean_is_nearer_to_the_optimum_than_the_luckiest_point():
    """Of a planted quadratic cost, of which one trial in 50 is lucky by 100 ticks."""

    class Noisy(HalfOfAPlain):
        def __init__(self, seed):
            super().__init__()
            self.rng, self.reward, self.point = np.random.default_rng(seed), -math.inf, None

        def around(self, hands, values):
            exact = -300.0 - 1000.0 * ((values - 0.3) ** 2).sum(axis=1)
            rewards = exact + 100.0 * (self.rng.random(len(values)) < 0.02)
            if rewards.max() > self.reward:
                self.reward, self.point = rewards.max(), values[rewards.argmax()]
            return SimpleNamespace(rewards=rewards)

    away = []
    for seed in range(10):
        attempts = Noisy(seed)
        session = Session(load_task("ascending"), seed, OPTIMISER_INFORMATION)
        strategy = Strategy(session, attempts, "R", 0.05)
        for _ in range(60):
            strategy.generation()
        _, mean = strategy.answer
        away.append([np.linalg.norm(point - 0.3) for point in (mean, attempts.point)])
    mean_away, luckiest_away = np.mean(away, axis=0)
    assert 10 * mean_away < luckiest_away < 0.1


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


@pytest.mark.parametrize("floor", [0.0, 0.035])
def test_the_one_fifth_rule(floor, monkeypatch):
    """Recomputed from the trials: centres, good trials, and the scatter of targets in a window."""
    centres, spreads, windows = {}, {}, {}
    ratios, first_ratios, kept = [], [], 0
    options = {"spread": "learned", "window": 50, "floor": floor, "trials": 4000}
    for hands, targets, reward, reached in trials_of(HillClimbing, monkeypatch, **options):
        if hands in centres:
            spread, (scatter, good) = spreads.setdefault(hands, 0.05), windows[hands]
            scatter.extend((targets - centres[hands][1])[~np.isnan(targets)])
            if not good:
                first_ratios.append(np.mean(np.square(scatter)) / spread**2)
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
    assert np.mean(first_ratios) == pytest.approx(1.0, abs=0.1)  # it changes with the window
    assert (kept > 10) == (floor > 0.0)
    assert len({*spreads.values()}) > 1


@pytest.mark.parametrize("method", [HillClimbing, CMAES, PolicyGradient])
@pytest.mark.parametrize("world", [MotionModel(), MotionModel(motor_noise=0.01)])
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
    task = load_task("two-armed-1").model_copy(update={"initial_hands": "LLRR"})
    assert solve(method, task, trials=60, sequence="given")[1].hands == "LLRR"
    with pytest.raises(ValueError, match="hands"):
        solve(method, "two-armed-2", trials=300, sequence="RLX")
    with pytest.raises(MethodError):
        solve(method, failing_task(hands="R"), trials=50, sequence="L")
