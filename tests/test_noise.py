"""Motor noise: its numbers, and executions of solutions, sessions and environments with it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from coartic import (
    PAPER,
    MotionModel,
    Movement,
    SolutionError,
    UndeclaredError,
    correct,
    corrective_trial,
    execute,
    execute_noisy,
    initial_hands,
    load_task,
    move,
    movements_of,
    objective,
    trajectory,
)
from coartic.method import Information, Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.motion.kernels.compile import entry
from coartic.motion.kernels.noise import hashed, normal_of
from coartic.motion.kernels.slots import SLOTS
from coartic.motion.trials import reach_goals
from tests.support import noise, reference
from tests.support.strategies import (
    STUCK,
    TIED,
    changed,
    failing_task,
    posture,
    random_solution,
    sample,
    tiny_task,
    uneven_task,
)
from tests.support.worlds import WORLDS, named

TASKS = {
    "two-armed-2": load_task("two-armed-2"),
    "uneven": uneven_task(),
    "held": uneven_task(
        locked_base=["x", "y"], goals=[[1.6, 0.9], [-0.3, 0.85]], initial_hands="RL"
    ),
    "tied": TIED,  # hands stand in goals from the start
}
SHORT = MotionModel(max_iterations=70, gain=0.06, correction_tolerance=0.08)
"""Corrections that take longer fail."""


# ---- The numbers ----


@entry
def _fill(seeds, draws, goals, movements, coordinates, numbers):
    for n in range(len(numbers)):
        word = hashed(hashed(seeds[n], 0), draws[n])
        word = hashed(hashed(word, goals[n]), movements[n])
        numbers[n] = normal_of(hashed(word, coordinates[n]))


def numbers_of(seeds, draws, goals, movements, coordinates):
    """The kernels' z for arrays of indices that are broadcast."""
    indices = np.broadcast_arrays(draws, goals, movements, coordinates, np.zeros_like(seeds))
    numbers = np.empty(indices[0].size)
    flat = [np.ascontiguousarray(index.ravel().astype(np.int64)) for index in indices[:4]]
    words = np.broadcast_to(seeds, indices[0].shape).ravel().astype(np.uint64)
    _fill(words, *flat, numbers)
    return numbers.reshape(indices[0].shape)


def test_numbers_are_those_of_scipys_inverse_distribution():
    """Of every size that 52 bits can give: the logarithm and all three branches."""
    rng = np.random.default_rng(0)
    seeds = rng.integers(0, 2**64, 20_000, dtype=np.uint64)
    indices = rng.integers(0, [[10_000], [20], [51], [18]], (4, len(seeds)))
    due = [
        noise.normal(int(s), *map(int, index)) for s, *index in zip(seeds, *indices, strict=True)
    ]
    np.testing.assert_allclose(numbers_of(seeds, *indices), due, rtol=1e-13, atol=1e-15)


@entry
def _normals(words, numbers):
    for n in range(len(words)):
        numbers[n] = normal_of(words[n])


def test_numbers_of_the_farthest_tails():
    steps = np.array([0, 1, 2, 10, 10**6, 10**9, 10**12, 2**51, 2**52 - 2, 2**52 - 1], np.uint64)
    numbers = np.empty(len(steps))
    _normals(steps << np.uint64(12), numbers)
    due = stats.norm.ppf((steps.astype(float) + 0.5) / 2.0**52)
    np.testing.assert_allclose(numbers, due, rtol=1e-13)
    assert numbers[0] == -numbers[-1] < -8.1


SHAPE = 40, 25, 4, 3, 10  # seeds, draws, goals, movements, coordinates


@pytest.fixture(scope="module")
def block():
    """Numbers for all combinations of small indices, as methods meet them: 120,000."""
    indices = np.meshgrid(*map(np.arange, SHAPE), indexing="ij")
    return numbers_of(indices[0].astype(np.uint64), *indices[1:])


def test_numbers_are_normal(block):
    values = block.ravel()
    count = len(values)
    moments = [np.mean(values**k) for k in range(1, 9)]
    due = [0, 1, 0, 3, 0, 15, 0, 105]
    variances = [1, 2, 15, 96, 945, 10170, 135135, 2016000]
    for moment, expected, variance in zip(moments, due, variances, strict=True):
        assert abs(moment - expected) < 4 * np.sqrt(variance / count)
    assert stats.kstest(values, "norm").pvalue > 1e-3
    for share in (1e-4, 1e-3, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999):
        below = np.mean(values < stats.norm.ppf(share))
        assert abs(below - share) < 4 * np.sqrt(share * (1 - share) / count)


@pytest.mark.parametrize("axis", range(len(SHAPE)))
def test_numbers_of_neighbours_are_uncorrelated(block, axis):
    """Of neighbours in each index, their squares too, and of an index with the one above."""
    ahead, behind = (np.take(block, range(b, SHAPE[axis] - 1 + b), axis) for b in (0, 1))
    for first, second in ((ahead, behind), (ahead**2, behind**2)):
        correlation = np.corrcoef(first.ravel(), second.ravel())[0, 1]
        assert abs(correlation) < 4 / np.sqrt(first.size)
    means = np.moveaxis(block, axis, 0).reshape(SHAPE[axis], -1).mean(axis=1)
    z = means * np.sqrt(block.size / SHAPE[axis])
    assert stats.chi2.sf((z**2).sum(), len(z)) > 1e-4


# ---- Executions ----


@pytest.mark.parametrize("grows", [False, True])
@pytest.mark.parametrize("world", WORLDS, ids=named)
def test_executions_are_those_of_the_slow_implementation(world, grows):
    rng = np.random.default_rng(7)
    exact, seen = world._replace(motor_noise=0.0), []
    for task in TASKS.values():
        solutions = [random_solution(task, exact, rng) for _ in range(3)]
        made = execute_noisy(
            task, solutions, world.motor_noise, 2, 3, exact, signal_dependent=grows
        )
        due = [
            [reference.executed_noisily(task, each, world, 3, draw, grows) for draw in range(2)]
            for each in solutions
        ]
        np.testing.assert_array_equal(made, due)
        seen += made.ravel().tolist()
    assert len({*np.nan_to_num(seen)}) >= 8


def test_many_robots_execute_as_one_after_the_other():
    """More than fit into the compiled kernels at once, and more than are executed in a lot."""
    task, model = TASKS["uneven"], MotionModel(motor_noise=0.1, max_iterations=70)
    exact = model._replace(motor_noise=0.0)
    solution = movements_of("RLR", corrective_trial(task, "RLR").configurations)
    made = execute_noisy(task, [solution], 0.1, SLOTS + 8, [4], exact)
    due = [reference.executed_noisily(task, solution, model, 4, d) for d in range(SLOTS + 8)]
    np.testing.assert_array_equal(made, [due])
    assert len(np.unique(made)) > 5
    more = execute_noisy(task, [solution, solution], 0.1, 3000, [5, 4], exact)
    np.testing.assert_array_equal(more[1, : SLOTS + 8], due)


@settings(max_examples=20)
@given(st.sampled_from([*TASKS]), st.integers(0, 2**31))
def test_without_noise_nothing_changes(name, seed):
    task = TASKS[name]
    solution = random_solution(task, SHORT, np.random.default_rng(seed))
    due = execute(task, solution, model=SHORT)
    made = execute_noisy(task, [solution], 0.0, 2, seed, SHORT)
    if not any(m.kind == "corrective" and m.target is not None for m in solution):
        ticks = due.ticks if due.completed else np.nan
        np.testing.assert_array_equal(made, np.full((1, 2), ticks))
    if due.completed:  # as made, with targets of the corrective process and ticks
        again = execute_noisy(task, [due.movements], 0.0, 2, seed, SHORT)
        np.testing.assert_array_equal(again, np.full((1, 2), due.ticks))


@settings(max_examples=6)
@given(
    st.sampled_from([*TASKS]),
    st.integers(0, 2**31),
    st.sampled_from([0.002, 0.02, 1.0]),
    st.booleans(),
)
def test_ticks_depend_on_seed_and_draw_alone(name, seed, motor_noise, signal_dependent):
    """Neither on the other solutions nor on the number of executions."""
    task, rng = TASKS[name], np.random.default_rng(seed)
    solutions = [random_solution(task, SHORT, rng) for _ in range(3)]
    options = {"model": SHORT, "signal_dependent": signal_dependent}
    made = execute_noisy(task, solutions, motor_noise, 3, [5, 6, 7], **options)
    order = [2, 0, 2]
    some = [solutions[k] for k in order]
    again = execute_noisy(task, some, motor_noise, 2, [5 + k for k in order], **options)
    np.testing.assert_array_equal(again, made[order, :2])
    whole = execute_noisy(task, solutions, motor_noise, 3, seed, **options)
    np.testing.assert_array_equal(
        execute_noisy(task, solutions[1:], motor_noise, 3, seed, **options), whole[1:]
    )


def test_solutions_under_one_seed_meet_the_same_noise():
    """Equal solutions have equal ticks, and a solution that aims farther misses alike."""
    solution, farther = planned(1.415), planned(1.425)
    twice = execute_noisy(REACH, [solution, solution, farther], 0.01, 200, 0)
    np.testing.assert_array_equal(twice[0], twice[1])
    hits = twice == execute(REACH, solution).ticks
    assert hits[2].sum() > hits[0].sum()
    assert hits[2][hits[0]].all()  # whoever aims farther hits whenever the other does


REACH = tiny_task(goals=[[6.004, 0.1]])
"""The right hand starts 1.404 to the left of the goal's rim."""
NEAR, FAR = tiny_task(goals=[[5.104, 0.1]]), tiny_task(goals=[[8.604, 0.1]])
"""Likewise, 0.504 and 4.004."""


def planned(*configuration, kind="planned"):
    return [Movement(1, "right", kind, posture(*configuration))]


def along(*places):
    """A path on which only the base moves, in x."""
    return [Movement(1, "right", "path", waypoints=np.array([posture(x) for x in places]))]


def test_only_coordinates_that_move_miss():
    """Noise along the way through the rim does not change where it is hit, noise across it does.
    A coordinate whose target is NaN, or where the robot stands, does not move."""
    assert execute(REACH, planned(1.6)).ticks == 142
    stays = [replace(planned(1.6)[0], target=np.where(posture(1.6) == 0.0, np.nan, posture(1.6)))]
    for solution in (planned(1.6), along(1.0, 1.6), planned(1.6, 1e-10), stays):
        assert {*execute_noisy(REACH, [solution], 0.03, 300, 1)[0]} == {142}
    assert len({*execute_noisy(REACH, [planned(1.6, 1e-8)], 0.03, 300, 1)[0]}) > 1


@pytest.mark.parametrize(
    ("task", "solution", "grows", "share"),
    [
        # A planned movement stops up to 0.01 before its end: it hits if it ends beyond 1.41.
        (REACH, planned(1.415), False, 0.6915),  # by half a standard deviation
        (FAR, planned(4.015), True, 0.6915),  # which does not grow beyond a length of 1
        (NEAR, planned(0.515), True, 0.8342),  # by 0.5 / 0.515 standard deviations
        # Others go to their end: they hit if it is beyond 1.404.
        (REACH, planned(1.409, kind="corrective"), False, 0.6915),
        (NEAR, along(0.3, 0.509), True, 0.8370),
        # The first of two waypoints is missed by half: here beyond 1.407, as the way back counts.
        (REACH, along(1.412, 0.0), False, 0.8413),
    ],
)
def test_movements_miss_by_the_normal_distribution(task, solution, grows, share):
    """From which the share of executions that hit at once follows: they take the fewest ticks."""
    (made,) = execute_noisy(task, [solution], 0.01, 400, 0, signal_dependent=grows)
    bound = 4 * np.sqrt(share * (1 - share) / 400)
    assert abs(np.mean(made == execute(task, solution).ticks) - share) < bound


def test_a_correction_misses_by_its_length():
    """A correction of length L misses by s min(1, L): short ones hit where long ones do not."""
    corrective = [Movement(1, "right", "corrective")]
    near = tiny_task(goals=[[4.65, 0.1]])
    counts = [len({*execute_noisy(task, [corrective], 0.02, 300, 3)[0]}) for task in (near, REACH)]
    assert counts[0] < 5 < counts[1]


def test_an_execution_fails_after_fifty_corrections():
    """Noise far larger than the goal: about half of the executions need more."""
    task = uneven_task(goals=[[1.0, 2.0]], initial_hands="L")
    model = MotionModel(gain=0.5, motor_noise=3.0)
    corrective = [Movement(1, "left", "corrective")]
    exact = model._replace(motor_noise=0.0)
    (made,) = execute_noisy(task, [corrective], 3.0, 20, 0, exact)
    due = [reference.executed_noisily(task, corrective, model, 0, draw) for draw in range(20)]
    np.testing.assert_array_equal(made, due)
    assert 0 < np.isnan(made).sum() < 20


def test_an_execution_fails_where_the_corrective_process_does():
    tilt = np.array([0.0, 0.0, *[0.1] * 8])
    for task, hand in ((STUCK, "right"), (failing_task(hands="L"), "left")):
        made = execute_noisy(task, [[Movement(1, hand, "corrective")]], 0.01, 3, 0)
        assert np.isnan(made).all()
        # Noise moves the arm away from where the process is stuck.
        aimed = [Movement(1, hand, "planned", task.q0 + tilt)]
        assert np.isfinite(execute_noisy(task, [aimed], 0.01, 3, 0)).all()
    few = MotionModel(max_iterations=20)  # a second correction would go on where the first ends
    reach = [Movement(1, "right", "corrective")]
    assert np.isnan(execute_noisy(REACH, [reach], 0.01, 3, 0, few)).all()


# ---- Trials in a session ----


def session_in(task, model, seed=0, *information):
    return Session(task, seed, OPTIMISER_INFORMATION | {*information}, model=model)


def test_an_idle_arm_keeps_still_where_its_target_is_nan():
    """One that a plan holds by a number is drawn anew at each goal: it stands elsewhere now."""
    task, left = tiny_task(goals=[[6.004, 0.1], [8.004, 0.1]]), slice(2, 6)
    held = posture(3.6, left_1=0.5)
    aims = [posture(1.6, left_1=0.5), held]
    stays = [aims[0], np.where(np.arange(10) < 2, held, np.nan)]
    for targets, moves in ((aims, True), (stays, False)):
        session = session_in(task, MotionModel(motor_noise=0.01))
        first, second = session.trial(movements_of("RR", targets)).configurations
        assert (first[left] != second[left]).any() == moves
        made = session.trial(movements_of("RR", targets)).movements
        np.testing.assert_array_equal(made[-1].target, targets[-1])  # as it was asked for
    first, second = execute(task, movements_of("RR", stays)).configurations
    np.testing.assert_array_equal(first[left], second[left])


@pytest.mark.parametrize("world", WORLDS, ids=named)
@pytest.mark.parametrize("name", ["two-armed-2", "uneven"])
def test_trials_of_a_session_are_those_of_the_slow_implementation(name, world):
    """Trial k meets draw k, whether trials are made at once or one by one."""
    task, rng = TASKS[name], np.random.default_rng(3)
    hands, targets = sample(task, 6, 0.1, seed=1)
    targets[rng.random(targets.shape) < 0.2] = np.nan
    targets[1, 0] = np.nan
    due = [
        reference.execute(task, movements_of(each, rows), world, reference.World(world, 9, n))
        for n, (each, rows) in enumerate(zip(hands, targets, strict=True))
    ]
    session = session_in(task, world, 9)
    assert len(session.trials([], targets[:0]).ticks) == 0
    made = session.trials(hands, targets)
    assert session.rewards == [each.reward for each in due]
    names = ("ticks", "corrections", "iterations")
    for name, values in zip(names, (made.ticks, made.corrections, made.iterations), strict=True):
        assert values.tolist() == [getattr(each, name) for each in due]
    meter = session.meter
    assert (meter.movement_ticks, meter.corrections) == (made.ticks.sum(), made.corrections.sum())
    one_by_one = session_in(task, world, 9)
    executions = [
        one_by_one.trial(movements_of(each, rows))
        for each, rows in zip(hands, targets, strict=True)
    ]
    for execution, each in zip(executions, due, strict=True):
        assert (execution.reward, execution.ticks) == (each.reward, each.ticks)
        np.testing.assert_allclose(
            execution.configurations, np.reshape(each.hits, (-1, task.robot.dof)), atol=1e-9
        )


NOISY = MotionModel(motor_noise=0.03)


def test_a_trial_that_is_not_counted_gives_its_number_back():
    task = TASKS["two-armed-2"]
    hands, targets = sample(task, 8, 0.1, seed=2)
    whole = session_in(task, NOISY, 5).trials(hands, targets)
    session = session_in(task, NOISY, 5)
    until = np.where(np.arange(8) < 2, 1.0, -1e9)  # the third trial is the last that counts
    assert len(session.trials(hands, targets, until=until).ticks) == 3
    np.testing.assert_array_equal(session.trials(hands[3:], targets[3:]).ticks, whole.ticks[3:])


def test_trials_do_not_notice_batches_and_threads(monkeypatch):
    task = TASKS["uneven"]
    hands, targets = sample(task, 1, 0.05, seed=2)
    many = session_in(task, NOISY, 5).trials(hands * 3000, np.repeat(targets, 3000, axis=0)).ticks
    assert len(np.unique(many)) > 20
    monkeypatch.setattr("coartic.motion.trials.SHARE", 10**9)  # one thread
    session = session_in(task, NOISY, 5)
    parts = [session.trials(hands * n, np.repeat(targets, n, axis=0)).ticks for n in (1, 71, 2928)]
    np.testing.assert_array_equal(np.concatenate(parts), many)


def test_chosen_draws_are_common_random_numbers():
    task = TASKS["two-armed-2"]
    hands, targets = sample(task, 1, 0.05, seed=2)
    session = session_in(task, NOISY, 5, Information.NOISE_DRAWS)
    draws = [7, 3, 7, 0]
    made = session.trials(hands * 4, np.repeat(targets, 4, axis=0), draws=draws).ticks
    due = session_in(task, NOISY, 5).trials(hands * 8, np.repeat(targets, 8, axis=0)).ticks[draws]
    np.testing.assert_array_equal(made, due)
    assert Information.NOISE_DRAWS in session.used
    for wrong, words in (([1], "shape"), ([-1] * 4, "integer from 0"), ([0.5] * 4, "integer")):
        with pytest.raises(ValueError, match=f"draws .*{words}"):
            session.trials(hands * 4, np.repeat(targets, 4, axis=0), draws=wrong)
    with pytest.raises(UndeclaredError, match="draws of the noise"):
        session_in(task, NOISY).trials(hands, targets, draws=[0])


def test_random_numbers_of_a_method_do_not_depend_on_the_noise():
    for seed in (0, 2**127):
        streams = [session_in(TIED, model, seed).rng.random(5) for model in (PAPER, NOISY)]
        np.testing.assert_array_equal(*streams)


def test_an_objective_in_noise():
    """Costs are those of the trials; the best point is the luckiest; draws pair points."""
    cost, again = (objective("two-armed-2", model=NOISY, seed=4) for _ in range(2))
    points = cost.x0 + 0.01 * np.random.default_rng(0).standard_normal((50, cost.dim))
    costs = cost.many(points)
    np.testing.assert_array_equal(costs, [again(point) for point in points])
    assert cost.best_cost == min(*costs, cost.history.cost[0])  # the first trial, too
    assert cost.best_known is None
    assert (objective("two-armed-2", model=NOISY, seed=5).many(points) != costs).any()
    same = cost.many(np.tile(points[0], (50, 1)), draws=[3] * 50)
    assert len({*same}) == 1
    movements = cost.movements(points[0])
    free = cost.joints
    for movement, joints in zip(movements, free, strict=True):
        np.testing.assert_array_equal(np.isnan(movement.target), ~joints)


@pytest.mark.parametrize(
    "call",
    [
        lambda: execute("ascending", SOLUTION, model=NOISY),
        lambda: trajectory("ascending", SOLUTION, NOISY),
        lambda: corrective_trial("ascending", "RRR", model=NOISY),
        lambda: move(REACH.robot, REACH.q0, REACH.q0, "right", (1, 1), 0.1, model=NOISY),
        lambda: correct(REACH.robot, REACH.q0, "right", (1, 1), model=NOISY),
        lambda: reach_goals(REACH.robot, [REACH.q0], [0], [(1, 1)], 0.1, model=NOISY),
    ],
)
def test_functions_without_a_seed_refuse_noise(call):
    with pytest.raises(ValueError, match="motor_noise is 0.03; it must be 0 here.*execute_noisy"):
        call()


def test_the_search_for_initial_hands_is_made_without_noise():
    for name in ("two-armed-1", "two-armed-2"):
        assert initial_hands(name, model=NOISY) == initial_hands(name)


# ---- Wrong arguments ----


SOLUTION = corrective_trial("ascending", "RRR").movements


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"motor_noise": np.nan}, "motor_noise is"),
        ({"repeats": 0}, "repeats is"),
        ({"seed": -1}, "seed is"),
        ({"seed": [1, 2]}, "seed has 2 entries; it must have one for each of the 1"),
        ({"task": "descending"}, r"took 319 ticks; on task 'descending'.* of another task\?"),
        ({"task": changed("ascending", hands=["left"], initial_hands="LLL")}, "has no right hand"),
        ({"solutions": SOLUTION}, r"solutions\[0\]: .* must be a list of movements"),
        (
            {"model": MotionModel(motor_noise=0.01)},
            r"model.motor_noise is 0.01; it must be 0, because argument motor_noise says",
        ),
    ],
)
def test_wrong_arguments_are_refused(change, words):
    case = {"task": "ascending", "solutions": [SOLUTION], "motor_noise": 0.01, "repeats": 2}
    with pytest.raises((ValueError, SolutionError), match=words):
        execute_noisy(**{**case, "seed": 0, **change})
