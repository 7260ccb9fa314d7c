"""Executions with motor noise are those of a slow implementation, from the same draws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import (
    MotionModel,
    Movement,
    SolutionError,
    corrective_trial,
    execute,
    execute_noisy,
    load_task,
    movements_of,
)
from coartic.motion.batch import SLOTS
from tests.support import noise as reference
from tests.support.strategies import (
    STUCK,
    TIED,
    changed,
    failing_task,
    posture,
    random_solution,
    tiny_task,
    uneven_task,
)

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


@pytest.mark.parametrize("name", TASKS)
def test_executions_are_those_of_the_slow_implementation(name):
    rng = np.random.default_rng(7)
    solutions = [random_solution(TASKS[name], SHORT, rng) for _ in range(4)]
    seen = []
    for motor_noise, grows in ((0.01, False), (0.1, True)):
        case = TASKS[name], solutions, motor_noise, 2, 3, SHORT
        made = execute_noisy(*case, signal_dependent=grows)
        due = reference.execute_noisy(*case, signal_dependent=grows)
        np.testing.assert_array_equal(made, due)
        seen.append(made)
    completed = np.isfinite(seen)
    assert len(np.unique(np.array(seen)[completed])) >= 5
    assert completed.all() == (name != "held")


def test_many_robots_execute_as_one_after_the_other():
    """More than fit into the compiled kernels at once."""
    task, count = TASKS["uneven"], SLOTS + 8
    solution = movements_of("RLR", corrective_trial(task, "RLR").configurations)
    case = task, [solution], 0.1, count, [4], SHORT
    made = execute_noisy(*case)
    np.testing.assert_array_equal(made, reference.execute_noisy(*case))
    assert made.shape == (1, count)
    assert len(np.unique(made)) > 5


@settings(max_examples=20)
@given(st.sampled_from([*TASKS]), st.integers(0, 2**31))
def test_without_noise_nothing_changes(name, seed):
    task = TASKS[name]
    solution = random_solution(task, SHORT, np.random.default_rng(seed))
    # Where no corrective movement has a target, execute corrects as often as it must, too.
    solution = [replace(m, target=None) if m.kind == "corrective" else m for m in solution]
    due = execute(task, solution, model=SHORT)
    made = execute_noisy(task, [solution], 0.0, 2, seed, SHORT)
    np.testing.assert_array_equal(made, np.full((1, 2), due.ticks if due.completed else np.nan))
    if due.completed:  # as made, with targets of the corrective process and ticks
        again = execute_noisy(task, [due.movements], 0.0, 2, seed, SHORT)
        np.testing.assert_array_equal(again, made)


@settings(max_examples=6)
@given(
    st.sampled_from([*TASKS]),
    st.integers(0, 2**31),
    st.sampled_from([0.002, 0.02, 1.0]),
    st.booleans(),
)
def test_ticks_of_a_solution_depend_on_its_own_seed(name, seed, motor_noise, signal_dependent):
    """On no other solution; child k of one seed is the seed of solution k."""
    task, rng = TASKS[name], np.random.default_rng(seed)
    solutions = [random_solution(task, SHORT, rng) for _ in range(3)]
    options = {"model": SHORT, "signal_dependent": signal_dependent}
    made = execute_noisy(task, solutions, motor_noise, 3, [5, 6, 7], **options)
    order = [2, 0, 2]
    some = [solutions[k] for k in order]
    again = execute_noisy(task, some, motor_noise, 3, [5 + k for k in order], **options)
    np.testing.assert_array_equal(again, made[order])
    whole = execute_noisy(task, solutions, motor_noise, 3, seed, **options)
    np.testing.assert_array_equal(
        execute_noisy(task, solutions[:2], motor_noise, 3, seed, **options), whole[:2]
    )


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
    """Noise along the way through the rim does not change where it is hit, noise across it does."""
    assert execute(REACH, planned(1.6)).ticks == 142
    for solution in (planned(1.6), along(1.0, 1.6), planned(1.6, 1e-10)):
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


@pytest.mark.parametrize(("seed", "fails"), [(211, False), (236, True)])
def test_an_execution_fails_after_fifty_corrections(seed, fails):
    """Seeds with which the fiftieth correction hits, or the next would."""
    task, model = uneven_task(goals=[[1.0, 2.0]], initial_hands="L"), MotionModel(gain=0.5)
    case = task, [[Movement(1, "left", "corrective")]], 3.0, 1, [seed], model
    (made,) = execute_noisy(*case)
    assert np.isnan(made).tolist() == [fails]
    np.testing.assert_array_equal([made], reference.execute_noisy(*case))


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
    ],
)
def test_wrong_arguments_are_refused(change, words):
    case = {"task": "ascending", "solutions": [SOLUTION], "motor_noise": 0.01, "repeats": 2}
    with pytest.raises((ValueError, SolutionError), match=words):
        execute_noisy(**{**case, "seed": 0, **change})
