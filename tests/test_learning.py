"""The learner against the paper's loop, the published results, and itself beside other runs."""

import functools
import itertools
import math
from dataclasses import replace
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import numpy.testing as npt
import pytest

from coartic import (
    ABLATIONS,
    CONDITIONS,
    PAPER,
    CoarticError,
    ExplorationCondition,
    MotionModel,
    SolutionError,
    execute,
    learn,
    learn_many,
    load_task,
    movements_of,
)
from coartic.learner.conditions import EVERY_CONDITION
from coartic.learner.method import METHODS
from coartic.method import Information, Session
from coartic.motion.kernels.slots import SLOTS
from coartic.robot import HANDS, Robot
from tests.support import reference
from tests.support.strategies import (
    STUCK,
    changed,
    failing_task,
    make_trials,
    solve,
    tiny_task,
    uneven_task,
)
from tests.support.suites import suite_of
from tests.support.worlds import WORLDS, named


def _tenths(values):
    part = np.arange(len(values)) * 10 // max(1, len(values))
    return [values[part == number] for number in range(10)]


ZERO = np.zeros(Robot().dof)
SOON_FAILED = MotionModel(max_iterations=400)  # soon enough for the slow side


def assert_equals_reference(task, condition, trials, seed=11, model=SOON_FAILED, start=()):
    options = {"trials": trials, "model": model, "start": start}
    (fast,) = learn_many(task, condition, seeds=[seed], jobs=1, **options)
    slow = reference.learn(task, condition, seed=seed, **options)
    npt.assert_array_equal(fast.rewards.data, slow.rewards)
    counters = fast.counters
    assert counters.movement_ticks == -slow.rewards.sum()
    assert counters.corrections == slow.corrections.sum()
    parts = [slow.corrections[:1], *_tenths(slow.corrections[1:])]
    assert fast.corrections.tolist() == [part.sum() for part in parts]
    assert counters.failed_trials == (~slow.completed).sum()
    assert counters.trials == trials
    assert (
        slow.corrective_iterations
        < counters.forward_kinematics
        < counters.movement_ticks + (2 * slow.corrective_iterations + 8 * trials * len(task.goals))
    )
    npt.assert_array_equal(fast.completed, slow.completed)
    if slow.completed.any():  # the first of the best
        rewards = np.where(slow.completed, slow.rewards, -math.inf)
        assert fast.best_trial == rewards.argmax()
    values, targets = np.full_like(fast.values, -np.inf), np.full_like(fast.targets, np.nan)
    for ((goal, before), hand), value in slow.values.items():
        place = goal, (*HANDS, None).index(before), HANDS.index(hand)
        values[place], targets[place] = value, slow.targets[(goal, before), hand]
    npt.assert_array_equal(fast.values, values)
    npt.assert_allclose(fast.targets, targets, atol=1e-9)
    replayed = None
    if slow.replay is not None:
        hands, ticks = slow.replay
        replayed = -sum(ticks)
        made = [[m for m in fast.replay if m.goal == goal] for goal in range(1, len(hands) + 1)]
        assert [{m.hand for m in each} for each in made] == [{hand} for hand in hands]
        assert [sum(m.ticks for m in each) for each in made] == ticks
    assert (fast.replay_reward, fast.replay == ()) == (replayed, slow.replay is None)
    best = slow.rewards[slow.completed].max(initial=-(10**9)) if slow.completed.any() else None
    assert fast.reward == (replayed if condition.learned == "replay" else best)
    return slow


@pytest.mark.parametrize("world", WORLDS, ids=named)
@pytest.mark.parametrize(("name", "condition"), [("ascending", "EC1"), ("two-armed-2", "EC4")])
def test_equals_the_loop_in_every_world(name, condition, world):
    assert_equals_reference(load_task(name), CONDITIONS[condition], 6, model=world)


NOISY = [world for world in WORLDS if world.motor_noise]


@pytest.mark.parametrize("world", NOISY, ids=named)
@pytest.mark.parametrize("condition", ["EC1", "EC3", "EC4", "EC4-subtask", "EC4-uncorrected"])
def test_next_action_is_read_from_the_tables_of_the_slow_learner(condition, world):
    """Greedy hands and their postures, state by state; it is what a run in noise answers."""
    task = load_task("ascending" if condition == "EC1" else "two-armed-2")
    condition = EVERY_CONDITION[condition]
    run = learn(task, condition, seed=3, trials=12, model=world)
    slow = reference.learn(task, condition, seed=3, trials=12, model=world)
    if not slow.completed.any():
        assert run.learned == ()
        return
    due, before = [], None
    for goal in range(len(task.goals)):
        known = {hand: value for (state, hand), value in slow.values.items()
                 if state == (goal, before)}  # fmt: skip
        hand = max(sorted(known), key=known.get) if known else condition.hands[0]
        target = slow.targets.get(((goal, before), hand))
        if target is not None and not condition.modify_other:
            target = np.array(target)
            target[task.robot.joints("left" if hand == "right" else "right")] = np.nan
        due.append((hand, target))
        before = hand
    assert [(m.goal, m.hand) for m in run.learned] == [*enumerate((h for h, _ in due), 1)]
    for movement, (_, target) in zip(run.learned, due, strict=True):
        assert movement.ticks is None
        assert movement.kind == ("corrective" if target is None else "learned")
        if target is not None:
            npt.assert_allclose(movement.target, target, atol=1e-9)
    method = next(each for each in METHODS if each.name.endswith(f"/{condition.id}"))
    options = {"model": world, "trusted": True}
    result = method(method.Parameters(trials=12)).solve(
        Session(task, 3, method.information, **options)
    )
    assert result.solution == run.learned


def test_next_action_corrects_where_nothing_is_stored():
    """Values without postures after them: the greedy hands lead into a state that no trial saw."""
    run = learn("two-armed-2", "EC4", seed=0, trials=40, model=NOISY[0])
    values, targets = run.values.copy(), run.targets.copy()
    code = int(values[0, 2].argmax())
    values[1, code], targets[1, code] = -np.inf, np.nan
    first, second, *_ = replace(run, values=values, targets=targets).next_action
    assert (first.kind, second.kind, second.target) == ("learned", "corrective", None)
    assert second.hand == "left"  # at a tie


def shown(movements):
    return [(m.goal, m.hand, m.kind, m.ticks, tuple(m.target)) for m in movements]


def bettered(run):
    """How often a trial was better than all before it."""
    rewards = np.where(run.completed, run.rewards, -math.inf)
    return np.count_nonzero(np.diff(np.maximum.accumulate(rewards)))


SUBTASK = replace(ABLATIONS["EC4-subtask"], noise_sd=0.03)


@pytest.mark.parametrize(
    ("task", "condition", "trials", "seed", "better"),
    [
        ("ascending", CONDITIONS["EC1"], 4, 36, 0),
        ("two-armed-1", CONDITIONS["EC2"], 4, 36, 0),
        ("two-armed-2", CONDITIONS["EC3"], 4, 36, 0),
        ("two-armed-1", CONDITIONS["EC4"], 15, 998, 5),
        ("two-armed-1", SUBTASK, 5, 162, 2),
        # One hand is always the closest: it draws no number to break a tie with itself.
        ("ascending", ExplorationCondition("EC1-one", ("right",), True, False, "closest", 0.5),
         5, 11, 0),
    ],
)  # fmt: skip
def test_equals_the_slow_learner_trial_by_trial(task, condition, trials, seed, better):
    """Also where what is stored is hit and missed, and replaced, again and again."""
    task = load_task(task)
    slow = assert_equals_reference(task, condition, trials, seed)
    assert slow.corrections.sum() > len(task.goals) or not condition.corrects
    assert slow.completed.all() == condition.corrects
    assert bettered(slow) >= better
    if better == 2:
        slow = assert_equals_reference(failing_task(), replace(condition, epsilon=0.5), trials=12)
        assert set(slow.completed) == {True, False}


@pytest.mark.parametrize(
    ("chosen", "other", "hands"),
    [
        (True, True, "none"), (False, False, "none"),
        (True, False, "closest"), (False, True, "closest"),
        (True, True, "random"), (False, False, "random"),
    ],
)  # fmt: skip
def test_conditions_are_data(chosen, other, hands):
    """Every pair of values of these fields, on an uneven robot on a rail."""
    task = uneven_task(locked_base=["x"])
    condition = ExplorationCondition("own", ("left", "right"), chosen, other, hands, 0.4, 0.1)
    slow = assert_equals_reference(task, condition, 8 if hands == "random" else 6, seed=0)
    assert slow.corrections.sum() > len(task.goals)
    assert slow.completed.all() == (hands != "random")  # a random hand fails now and then
    assert bettered(slow) or not other


def test_informed_conditions_equal_the_slow_learner_trial_by_trial():
    """On the tasks of the paper and on an uneven robot with a rail, under EC1, EC3 and EC4."""
    one_hand = {"drift": 0.3, "epsilon": 0.5}
    fields = {**one_hand, "hand_exploration": "random"}
    for task, condition, own in [
        (uneven_task(locked_base=["x"]), "EC4", fields),
        (load_task("ascending"), "EC1", one_hand),
        # Hands alternate: where they do, an arm is idle at the next goal and prefers to stay.
        (load_task("two-armed-1"), "EC3", {**fields, "epsilon": 0.7}),
        # A hand with which the corrective process fails is the farthest.
        (failing_task(), "EC4", {**fields, "epsilon": 0.7}),
    ]:
        assert_equals_reference(task, replace(CONDITIONS[condition], **own), trials=4, seed=7)


EACH_FIELD = [
    ("EC4", {"hands": ("right",)}),
    ("EC4", {"modify_chosen": False}),
    ("EC3", {"modify_other": True}),
    *(("EC4", {"hand_exploration": each, "epsilon": 0.6})
      for each in ("none", "closest")),
    ("EC4", {"epsilon": 0.9}),
    ("EC4", {"noise_sd": 0.3}),
    ("EC4", {"corrects": False, "noise_sd": 0.02}),
    ("EC4", {"learned": "replay"}),
    ("EC4", {"learned": "replay", "credit": "subtask"}),
    ("EC4", {"drift": 0.5}),
]  # fmt: skip
"""Of each field of a condition each value, or several, with what it needs of other fields."""


@functools.cache
def plain_targets(condition):
    """What the slow learner stores under a condition that changed ones are compared with."""
    task = load_task("two-armed-1")
    return repr(reference.learn(task, condition, seed=5, trials=6, model=SOON_FAILED).targets)


@pytest.mark.parametrize(("base", "changes"), EACH_FIELD)
def test_every_field_equals_the_slow_learner_and_makes_a_difference(base, changes):
    plain, task = EVERY_CONDITION[base], load_task("two-armed-1")
    changed = replace(plain, **changes)
    slow = assert_equals_reference(task, changed, trials=6, seed=5)
    if "learned" in changes:
        assert slow.replay is not None
        assert -sum(slow.replay[1]) != slow.rewards.max()
        plain = replace(plain, learned="replay")
    if changed != plain:
        assert repr(slow.targets) != plain_targets(plain)


def test_no_field_of_a_condition_is_without_a_case():
    """Nor any value of one that has few."""
    seen = [EVERY_CONDITION[base] for base, _ in EACH_FIELD]
    seen += [replace(EVERY_CONDITION[base], **changes) for base, changes in EACH_FIELD]
    for name, kind in get_type_hints(ExplorationCondition).items():
        values = {getattr(condition, name) for condition in seen}
        todo = f"add a case with another value of {name} to EACH_FIELD"
        assert len(values) > 1, todo
        assert set(get_args(kind)) <= values or get_origin(kind) is not Literal, todo


def test_without_information_an_informed_condition_is_the_papers():
    """No drift changes nothing."""
    paper = learn("two-armed-1", "EC4", seed=3, trials=200)
    for drift, equal in ((0.0, True), (1e-12, False)):
        run = learn("two-armed-1", replace(CONDITIONS["EC4"], drift=drift), seed=3, trials=200)
        assert np.array_equal(run.targets, paper.targets, equal_nan=True) == equal


@pytest.mark.parametrize(
    ("away", "condition"), [(0.0, "EC4"), (0.5, "EC4"), (0.5, "EC4-uncorrected")]
)
def test_from_a_first_solution_it_equals_the_slow_learner(away, condition):
    """From one that hits its goals, and from one that misses them and is corrected: in trial 0 also
    where no later trial is."""
    hits = learn("two-armed-2", "EC4", seed=1, trials=50).execute().configurations
    start = movements_of("RLRR", hits + away)
    task = load_task("two-armed-2")
    rules = (CONDITIONS | ABLATIONS)[condition]
    slow = assert_equals_reference(task, rules, trials=5, seed=3, start=start)
    assert slow.corrections[0] == (4 if away else 1)
    run = learn(task, condition, seed=3, trials=1, start=start)
    due = execute(task, start)
    assert (run.first_hands, run.initial_reward) == ("RLRR", due.reward)
    assert shown(run.initial) == shown(due.movements)


@pytest.mark.parametrize(
    ("shift", "visited"),
    [(0.0, [True, True]), (1e-12, [True, True]), (1e-6, [False, True]), (-1e-6, [True, True])],
)
def test_closest_hand_and_its_ties(shift, visited):
    """EC2: the nearer hand always, a random one of two at the same place up to rounding."""
    task = tiny_task(
        goals=[[0.0, 6.0]],
        start={"left": [math.acos(0.125), 0, 0, 0], "right": [math.pi - math.acos(0.125), 0, 0, 0]},
        robot={"right_shoulder": [0.5, 0.1 + shift]},
    )
    condition = ExplorationCondition("c", HANDS, True, False, "closest", epsilon=1.0)
    run = learn(task, condition, seed=0, trials=200)
    assert list(np.isfinite(run.values[0, 2])) == visited  # trial 0 visits the right one


def test_what_a_policy_spends_is_counted():
    task = changed("two-armed-1", initial_hands="best-of-all")
    assert learn(task, "EC3", seed=0, trials=1).first_hands == "LRLR"
    information = {Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL}
    session = Session(task, 0, information)
    assert session.find_initial_hands() == "LRLR"
    meter = session.meter
    assert (meter.trials, meter.initial_trials, meter.failed_trials) == (0, 16, 0)
    assert meter.corrections == 64
    named = Session(load_task("two-armed-1"), 0, information)
    assert (named.find_initial_hands(), named.meter.initial_trials) == ("RRRR", 0)


def test_a_trial_that_failed_stays_failed_where_the_hand_is_in_the_next_goal():
    left_only = ExplorationCondition("left", ("left",), True, False, "none")
    task = failing_task(goals=[[1.5, 0.1], [3.5, 0.1]], hands="LL")
    slow = assert_equals_reference(task, left_only, trials=3)
    assert not slow.completed.any()


def test_run_without_any_completed_trial():
    run = learn(STUCK, "EC1", seed=0, trials=20)
    assert "all 20 trials" in run.reason
    assert run.reward is run.hands is run.replay_reward is run.initial_reward is None
    assert run.solution == ()
    with pytest.raises(CoarticError, match="the run has no learned solution to execute"):
        run.execute()


def test_a_replay_that_misses_a_goal_is_no_solution():
    condition = replace(ABLATIONS["EC4-uncorrected"], learned="replay")
    run = learn("two-armed-1", condition, seed=0, trials=40)
    assert run.completed.any()
    assert (run.learned, run.replay, run.reward, run.hands) == ((), (), None, None)
    assert "the replay of what was learned did not hit" in run.reason
    hits = learn("ascending", replace(CONDITIONS["EC1"], learned="replay"), seed=3, trials=25)
    assert hits.execute().reward == hits.reward == hits.replay_reward != max(hits.rewards)


LEFT_FIRST = load_task("two-armed-1").model_copy(update={"initial_hands": "LRLR"})


@pytest.mark.parametrize(
    ("error", "words", "options"),
    [
        (CoarticError, "condition 'EC5' is unknown; did you mean", {"condition": "EC5"}),
        (CoarticError, "only the right hand, .* starts with LRLR", {"task": LEFT_FIRST}),
        (CoarticError, "movements for goals", {"start": movements_of("R", [ZERO])}),
        (CoarticError, "the first .* left",
         {"task": "two-armed-1", "start": movements_of("LLLL", [ZERO] * 4)}),
        (SolutionError, "ovement", {"start": "x"}),
        *((ValueError, "seed is", {"seeds": [seed]}) for seed in (-1, 2**128)),
        (ValueError, "seeds has 3 more than once", {"seeds": [3, 1, 3]}),
        (ValueError, "seeds has more than 20,000 entries",
         {"seeds": itertools.count(), "trials": 10_000}),
        *((ValueError, f"model.{name}", {"model": MotionModel(**{name: value})})
          for name, value in (("step", 1e-20), ("arrival_tolerance", -1.0),
                              ("correction_tolerance", 0.1), ("max_iterations", -1))),
    ],
)  # fmt: skip
def test_runs_that_cannot_be_are_refused(error, words, options):
    usual = {"task": "ascending", "condition": "EC1", "seeds": [0], "trials": 1}
    with pytest.raises(error, match=words):
        learn_many(**usual | options)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("epsilon", 1.5, "epsilon"),
        ("noise_sd", -1.0, "noise_sd"),
        ("hands", ("right", "right"), "hands"),
        ("drift", -1, "drift is -1"),
        ("credit", "subtask", "set learned to 'replay'"),
    ],
)
def test_a_condition_keeps_its_limits(field, value, words):
    with pytest.raises(ValueError, match=words):
        replace(CONDITIONS["EC1"], **{field: value})


@pytest.mark.parametrize(
    ("update", "message"),
    [
        ({"goals": ((3.0, 1.0),) * 5}, "for each of 5 goals"),
        ({"initial_hands": "L"}, "'L' do not fit task"),
        ({"robot": Robot(left_links=(1.0,), right_links=(1.0,))}, r"it must be \(4,\)"),
        ({"radius": np.inf}, "radius is inf"),
    ],
)
def test_a_copy_that_is_no_task_is_refused(update, message):
    """``model_copy`` checks nothing, and kernels have no bounds of their own."""
    task = load_task("two-armed-1").model_copy(update=update)
    with pytest.raises(ValueError, match=message):
        learn(task, "EC4", seed=0, trials=3)
    if "initial_hands" not in update:  # which only the learner reads
        with pytest.raises(ValueError):  # noqa: PT011
            make_trials(task, "RRRR", np.full((1, 4, 10), np.nan))


def test_a_goal_where_the_hand_is_already_takes_no_tick():
    """It is in the solution all the same, which says with which hand it is hit."""
    task = tiny_task(goals=[[4.5, 0.1], [4.5, 0.15]])
    run = learn(task, "EC3", seed=0, trials=1)
    assert (run.reward, run.hands, [m.ticks for m in run.solution]) == (0, "RR", [0, 0])
    assert run.execute().reward == 0


def test_any_condition_is_a_setting_of_a_method(tmp_path):
    fields = 'base = "EC3", modify_other = true, epsilon = 0.4, drift = 0.3'
    method = 'tasks = ["two-armed-1"]\nmethods = ["dual-process/custom"]'
    (cell,) = suite_of(tmp_path, f"{method}\nparameters = {{ {fields} }}")
    (method,) = (each for each in METHODS if each.name == "dual-process/custom")
    fields = method.Parameters.model_fields
    asked = {name: value for name, value in cell.parameters.items() if name in fields}
    _, execution, _ = solve(method, "two-armed-1", seed=3, **asked)
    rules = replace(CONDITIONS["EC3"], modify_other=True, epsilon=0.4, drift=0.3)
    assert execution.reward == learn("two-armed-1", rules, seed=3, trials=30).reward


FAILED_AT_ONCE = MotionModel(max_iterations=60)


def assert_same(a, b):
    for name in ("seed", "counters", "best_trial", "replay_reward", "completed", "values",
                 "targets"):  # fmt: skip
        npt.assert_equal(getattr(a, name), getattr(b, name))
    npt.assert_array_equal(a.rewards.data, b.rewards.data)
    for name in ("initial", "solution", "replay"):
        assert shown(getattr(a, name)) == shown(getattr(b, name))


@pytest.mark.parametrize(
    ("task", "condition", "model"),
    [
        ("two-armed-2", "EC2", PAPER),
        ("two-armed-2", "EC4-subtask", FAILED_AT_ONCE),
        ("ascending", "EC1-uncorrected", PAPER),
    ],
)
def test_a_run_is_the_same_whoever_is_beside_it(task, condition, model):
    task = load_task(task)
    seeds = [*range(SLOTS), 217, *range(SLOTS, SLOTS + 3)]  # more than there are slots
    for trials in (1, np.int64(25)):
        options = {"trials": trials, "model": model}
        together = learn_many(task, condition, seeds=np.uint8(seeds), jobs=1, **options)
        assert repr([run.seed for run in together]) == repr(seeds)
        some = learn_many(task, condition, seeds=seeds[::-7], jobs=2, **options)
        for run, same in zip(together[::-7], some, strict=True):
            assert_same(run, same)
        for run in together[5 :: SLOTS // 3]:
            assert_same(run, learn(task, condition, seed=run.seed, **options))
    if model is FAILED_AT_ONCE:
        assert any(run.counters.failed_trials for run in together)
