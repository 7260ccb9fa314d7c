"""Signatures on constructed cases whose right answer is known."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg, stats

from coartic import Movement, corrective_trial, execute, learn, load_task, movements_of
from coartic.analysis import TABLES, signatures
from coartic.analysis.control import contexts_of_control, mean_excess, shared_goal, with_control
from coartic.analysis.methods import EC1, EC3, EC4, RANDOM_SEARCH
from coartic.analysis.signatures import (
    SIGNATURES,
    Solutions,
    TwoContexts,
    as_in_isolation,
    context_pairs,
    distance_of_means,
    motor_equivalence,
    movable,
    permutation_p,
)
from coartic.analysis.statistics import exchange_test
from coartic.robot import HANDS
from tests.support.made_up import change_runs, runs_of, study_of_solutions
from tests.support.strategies import AS_RELEASED, changed, posture, tiny_task


def rng(seed=1):
    return np.random.default_rng(seed)


def posed(task, method, q, ticks=(0, 0, 0), hands="RRR"):
    """Runs that hit all goals in one posture each, ``q`` (runs, dof)."""
    configurations = np.repeat(np.asarray(q)[:, None], len(task.goals), axis=1)
    runs = (
        SimpleNamespace(configurations=each, hands=hands, ticks_by_goal=lambda: ticks)
        for each in configurations
    )
    return Solutions(task, method, tuple(runs))


def test_standardised_posture_difference_by_hand():
    first = np.array([[0.0, 0.0], [2.0, 0.0]])  # mean (1, 0), squares 2
    second = np.array([[4.0, 3.0], [4.0, 5.0]])  # mean (4, 4), squares 2
    assert distance_of_means(first, second) == 5.0
    assert signatures.standardised_posture_difference(first, second) == pytest.approx(
        5.0 / math.sqrt(4 / 2)
    )
    assert math.isnan(signatures.standardised_posture_difference(first[:1], second[:1]))
    assert math.isnan(signatures.standardised_posture_difference(first[[0, 0]], second[[1, 1]]))


def divisions(*groups):
    """Yield each division of the runs of two groups into groups as large."""
    pool = np.concatenate(groups)
    for chosen in itertools.combinations(range(len(pool)), len(groups[0])):
        yield pool[[*chosen]], np.delete(pool, chosen, axis=0)


def test_permutations_by_brute_force():
    draw = rng(11)
    groups = draw.standard_normal((3, 2)), draw.standard_normal((4, 2)) + 0.8
    observed = distance_of_means(*groups)
    p = np.mean([distance_of_means(*each) >= observed - 1e-12 for each in divisions(*groups)])
    assert permutation_p(*groups, rng()) == pytest.approx(p)
    assert math.isnan(permutation_p(groups[0][:1], groups[1], rng()))


def test_more_than_another_by_brute_force():
    draw = rng(6)
    method = draw.standard_normal((3, 2)), draw.standard_normal((2, 2)) + 2.0
    other = draw.standard_normal((2, 2)), draw.standard_normal((2, 2)) + 0.5
    both = [divisions(*runs) for runs in zip(method, other, strict=True)]
    excess = [
        distance_of_means(*ours) - distance_of_means(*theirs)
        for ours, theirs in (zip(*each, strict=True) for each in itertools.product(*both))
    ]
    observed = distance_of_means(*method) - distance_of_means(*other)
    p = signatures.beyond_p(method, other, rng(), resamples=20_000)
    assert p == pytest.approx(2 * np.mean(np.array(excess) >= observed - 1e-12), abs=0.03)


def test_drawn_tests_count_what_was_seen():
    """No resample comes near: p is that of the one that was seen, both tails where it has two."""
    near = [*rng(9).standard_normal((2, 30, 2))]
    far = near[0], near[1] + 100.0
    assert permutation_p(*far, rng(), resamples=9) == 0.1
    assert signatures.beyond_p(far, near, rng(), resamples=19) == 2 / 20
    assert signatures.beyond_p(near, far, rng(), resamples=19) == 1.0
    assert math.isnan(signatures.beyond_p((far[0][:1], far[1]), near, rng()))
    assert signatures.posture_difference_below(*near, 50.0, rng(), resamples=9) == 0.1
    assert math.isnan(signatures.posture_difference_below(near[0][:1], near[1], 1.0, rng()))


def test_posture_difference_below_a_bound_by_brute_force():
    first, second = rng(12).standard_normal((3, 2)), rng(13).standard_normal((2, 2)) + 1.5
    reached = [
        not signatures.standardised_posture_difference(np.array(a), np.array(b)) < 2.0
        for a in itertools.product(first, repeat=3)
        for b in itertools.product(second, repeat=2)
    ]  # NaN where resamples have no spread: infinitely far
    p = signatures.posture_difference_below(first, second, 2.0, rng())
    assert 0.1 < p < 0.9
    assert p == pytest.approx(np.mean(reached), abs=0.02)


def test_pairs_of_contexts():
    """A context is another next goal; the end of a task is none."""
    tasks = {name: load_task(name) for name in ("ascending", "descending", "two-armed-1")}
    assert context_pairs(tasks) == [("ascending", "descending", 1)]

    def task(*ys):
        return tiny_task(goals=[[5.0, y] for y in ys])

    ends = {"one": task(1), "two": task(1, 2), "three": task(1, 2, 3)}
    assert context_pairs(ends) == [("two", "three", 1)]
    others = {"a": task(1, 2, 3), "b": task(1, 2, 3.5), "c": task(1, 2, 3), "d": task(1.5, 2, 3)}
    assert context_pairs(others) == [("a", "b", 2), ("b", "c", 2)]
    wider = others["b"].model_copy(update={"radius": 0.2})
    assert context_pairs({"a": others["a"], "b": wider}) == []


def postures(start, goal, following, noise=0.0, carried=0.7, runs=4, seed=1):
    """Runs of a context with these mean postures: noise of SD ``noise`` is made at each posture,
    and a share ``carried`` of it is still there at the next one."""
    fresh = rng(seed).normal(size=(runs, 3, len(goal)))
    for k in (1, 2):
        fresh[:, k] = carried * fresh[:, k - 1] + math.sqrt(1 - carried**2) * fresh[:, k]
    return np.array([start, goal, following]) + noise * fresh


def test_lean_by_hand():
    """Next postures (1, 0) and (−1, 0): the way is (2, 0), of which 0.5 is made at the goal, and
    0.1 was there at the start; what is at right angles does not count."""
    up = postures([0.1, 5.0], [0.5, -3.0], [1.0, 0.0], runs=5)
    down = postures([-0.1, 0.0], [-0.5, 0.0], [-1.0, 0.0], runs=5)
    found = signatures.lean(up, down, rng())
    assert (found.at_goal, found.at_start) == pytest.approx((0.5, 0.1))
    assert (found.more.value, found.more.low, found.more.high) == pytest.approx((0.4, 0.4, 0.4))
    assert found.apart == pytest.approx(2.0)
    assert found.more.n == (5, 5)
    # On a way twice as long, which other sources name, the same distance is half the share.
    other = signatures.lean(up, down, rng(), toward=[[3.0, 0.0], [5.0, 0.0]])
    assert (other.more.value, other.apart) == pytest.approx((0.2, 4.0))
    degrees = signatures.lean(np.degrees(up), np.degrees(down), rng())
    assert degrees.more.value == pytest.approx(found.more.value)


def test_lean_needs_two_runs_and_its_interval_five():
    for runs in (1, 2, 4, 5):
        two = [postures([0.0, 0.0], [side / 4, 0.0], [side, 0.0], runs=runs) for side in (1, -1)]
        found = signatures.lean(*two, rng())
        assert math.isnan(found.more.value) == (runs < 2)
        assert math.isnan(found.more.low) == (runs < 5)
        alone = signatures.lean(*two, rng(), deterministic=True)
        assert alone.more.value == pytest.approx(0.25)
        assert math.isnan(alone.more.low)


def test_lean_does_not_apply_to_equal_next_postures():
    """Equal up to noise, or nearer than a tenth of a rad: missing, and not 0."""
    none, n = [0.0] * 4, 6
    for seed in range(20):
        two = [postures(none, none, none, 0.5, runs=n, seed=(seed, k)) for k in (0, 1)]
        assert math.isnan(signatures.lean(*two, rng(), resamples=9).more.value)
    near = [postures(none, none, [end, 0, 0, 0], runs=n) for end in (0.0, 0.099)]
    assert math.isnan(signatures.lean(*near, rng()).more.value)
    assert signatures.lean(*near, rng()).apart == pytest.approx(0.099)


@pytest.mark.parametrize("planted", [0.0, 0.3])
def test_lean_is_found_through_noise_that_is_carried_on(planted):
    """The mean is what was planted, less up to a tenth as the way is noisy, and 95 % intervals hold
    it. If both postures come from the same runs, their noise looks like a lean."""
    way, values, same_runs, held, studies = np.array([0.6] + [0.0] * 7), [], [], [], 150
    for seed in range(studies):
        up = postures(0 * way, planted * way, way, 0.08, runs=6, seed=(seed, 0))
        down = postures(0 * way, 0 * way, 0 * way, 0.08, runs=6, seed=(seed, 1))
        found = signatures.lean(up, down, rng(seed), resamples=199).more
        values.append(found.value)
        held.append(found.low <= planted <= found.high)
        _, goal, following = up.mean(axis=0) - down.mean(axis=0)
        same_runs.append(goal @ following / (following @ following))
    error = np.std(values) / math.sqrt(studies)
    assert 0.9 * planted - 3 * error < np.mean(values) < planted + 3 * error
    assert sum(held) >= stats.binom.ppf(0.001, studies, 0.9)  # of six runs it is a little narrow
    assert planted or np.mean(same_runs) > 4 * error


def test_lean_refuses_other_arrays():
    good = np.zeros((2, 3, 4))
    for words, *given in (
        ("postures of a context have", np.full((2, 3, 4), np.nan), good),
        ("postures of a context have", good[:, :2], good),
        ("coordinates", good, good[..., :3]),
    ):
        with pytest.raises(ValueError, match=words):
            signatures.lean(*given, rng())
    with pytest.raises(ValueError, match="toward"):
        signatures.lean(good, good, rng(), toward=np.zeros(4))


def solutions_with(task, hits, hands):
    """Solutions whose runs hit the goals at ``hits`` (runs, goals, dof) with these hands."""
    runs = (SimpleNamespace(configurations=q, hands=h) for q, h in zip(hits, hands, strict=True))
    return Solutions(task, "", tuple(runs))


def test_lean_of_two_contexts():
    """Coordinates of the hand that hits the goal count, and runs with the commonest next hand."""
    task = load_task("two-armed-1")
    still = np.repeat(task.q0[None], len(task.goals), axis=0)
    hits = np.repeat(still[None], 7, axis=0)
    ahead = np.array(hits)
    right, left = (task.robot.joints(hand) for hand in ("right", "left"))
    ahead[:, 0, right] += 0.25
    ahead[:, 1, right] += 1.0
    ahead[:, :2, left] += 9.0  # of the idle arm
    ahead[5:, :2, right] -= 7.0  # of runs that hit the next goal with the left hand
    contexts = TwoContexts(
        solutions_with(task, ahead, ["RRRR"] * 5 + ["RLRR"] * 2),
        solutions_with(task, hits, ["RLRR"] * 7),
        1,
        "right",
    )
    assert contexts.lean.more.value == pytest.approx(0.25)
    assert contexts.lean.more.n == (5, 7)
    assert contexts.lean.at_start == 0.0


def lean_by_hand(contexts, kept):
    """Lean at the goal less lean at the start of tuples (starts, hits, next), in own code.

    p is of every other run, and n of the others; the result is the mean of both ways round.
    """
    leans = []
    for even in (0, 1):
        p, q, n = (
            [np.mean([run[kept] for run in runs[which][parity::2]], axis=0) for runs in contexts]
            for which, parity in ((0, even), (1, even), (2, 1 - even))
        )  # start, goal, next
        way = n[0] - n[1]
        leans.append(((q[0] - q[1]) - (p[0] - p[1])) @ way / (way @ way))
    return np.mean(leans)


PARTS = {"all": [0, 1, 6, 7, 8, 9], "base": [0, 1], "joints": [6, 7, 8, 9]}
"""Coordinates of a posture of a two-armed robot that belong to base and right arm, by part."""


def test_lean_and_posture_difference_by_part():
    """The base has gone half of its way, the joints a tenth back; idle joints do not count."""
    task = load_task("ascending")
    still = np.repeat(task.q0[None], len(task.goals), axis=0)
    hits = np.repeat(still[None], 6, axis=0)
    ahead = np.array(hits)
    ahead[:, 0, 0] += 0.3
    ahead[:, 1, 0] += 0.6
    ahead[:, 0, 6:] -= 0.02
    ahead[:, 1, 6:] += 0.2
    ahead[:, :2, 2:6] += 5.0  # of the idle arm
    both = solutions_with(task, ahead, ["RRR"] * 6), solutions_with(task, hits, ["RRR"] * 6)
    found = {part: TwoContexts(*both, 1, "right", part=part) for part in PARTS}
    assert found["base"].lean.more.value == pytest.approx(0.5)
    assert found["joints"].lean.more.value == pytest.approx(-0.1)
    # Base and joints do not add up: 0.3 · 0.6 − 4 · 0.02 · 0.2 of 0.6² + 4 · 0.2².
    assert found["all"].lean.more.value == pytest.approx((0.18 - 0.016) / 0.52)
    assert found["base"].lean.apart == pytest.approx(0.6)
    assert found["joints"].lean.apart == pytest.approx(0.4)
    assert found["base"].posture_difference == pytest.approx(0.3)
    assert found["joints"].posture_difference == pytest.approx(0.04)
    assert found["all"].posture_difference == pytest.approx(math.sqrt(0.09 + 0.0016 + 4 * 25))
    assert found["joints"].of_part("all") == found["all"]


@pytest.mark.parametrize(
    ("base", "joints", "applies"),
    [(0.2, 0.04, {"all", "base"}), (0.05, 0.1, {"all", "joints"}), (0.09, 0.04, {"all"})],
)
def test_each_part_has_its_own_rule_for_no_lean(base, joints, applies):
    """Next postures that differ by so much in the base and in each of four joints: 0.1 is due."""
    task = load_task("ascending")
    hits = np.repeat(np.repeat(task.q0[None], len(task.goals), axis=0)[None], 6, axis=0)
    ahead = np.array(hits)
    ahead[:, 1, 0] += base
    ahead[:, 1, 6:] += joints
    both = solutions_with(task, ahead, ["RRR"] * 6), solutions_with(task, hits, ["RRR"] * 6)
    leans = {part: TwoContexts(*both, 1, "right", part=part).lean.more.value for part in PARTS}
    assert {part for part, lean in leans.items() if not math.isnan(lean)} == applies


def test_a_locked_base_has_no_lean_of_its_own():
    """Its postures are the same, and the joints lean as all coordinates do."""
    task = changed("ascending", locked_base=["x", "y"])
    noise = 0.1 * rng(4).standard_normal((2, 12, len(task.goals), 10))
    noise[..., :2] = 0.0
    noise[0, :, 1] += 0.5 * (np.arange(10) > 5)
    both = [solutions_with(task, task.q0 + each, ["RRR"] * 12) for each in noise]
    every, base, joints = (TwoContexts(*both, 1, "right", part=part) for part in PARTS)
    assert base.posture_difference == base.lean.apart == 0.0
    assert math.isnan(base.lean.more.value)
    assert joints.lean == every.lean


def test_other_parts_of_a_posture_are_refused():
    task = load_task("ascending")
    runs = posed(task, "", [posture(0.1)] * 5)
    with pytest.raises(ValueError, match="part is 'arm'; it must be one of all, base, joints"):
        TwoContexts(runs, runs, 1, "right", part="arm")
    whole, base = (TwoContexts(runs, runs, 1, "right", part=part) for part in ("all", "base"))
    with pytest.raises(ValueError, match="'base'.*'all'"):
        base.p_beyond(whole)


@pytest.mark.parametrize("label", [EC1, RANDOM_SEARCH, "cma-es/bandit"])
def test_lean_by_part_of_shipped_runs_by_own_code(shipped, label):
    """Postures are taken from the executions of the shipped solutions, run by run."""
    both = [shipped.executed(task, label) for task in ("ascending", "descending")]
    contexts = []
    for runs in both:
        run_by_run = [run.configurations for run in runs.runs]
        contexts.append(
            (
                [runs.task.q0] * len(run_by_run),
                [hits[0] for hits in run_by_run],
                [hits[1] for hits in run_by_run],
            )
        )
    of_control = contexts_of_control(shipped, TwoContexts(*both, 1, "right", part="joints"))
    assert (of_control is None) == (label == RANDOM_SEARCH)
    assert of_control is None or of_control.part == "joints"
    table = TABLES["contexts"](shipped).loc[f"ascending descending {label} goal 1 right"]
    for part, kept in PARTS.items():
        ending = "" if part == "all" else f"_{part}"
        expected = lean_by_hand(contexts, kept)
        assert table[f"lean{ending}"] == pytest.approx(expected, abs=1e-12)
        means = [np.mean(hits, axis=0) for _, hits, _ in contexts]
        within = slice(None) if part == "all" else kept
        distance = np.linalg.norm((means[0] - means[1])[within])
        assert table[f"distance{ending}"] == pytest.approx(distance, abs=1e-12)


def test_interval_of_a_posture_difference():
    task, noise = load_task("ascending"), rng(2).normal(size=(2, 40, 10))
    first, second = (posed(task, "", 0.05 * noise[k] + k) for k in (0, 1))
    found = TwoContexts(first, second, 1, "right").difference
    assert found.low < math.sqrt(10) < found.high
    assert found.high - found.low < 0.2
    few = posed(task, "", noise[0][:4])
    assert math.isnan(TwoContexts(few, second, 1, "right").difference.low)


JACOBIAN = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]])


def test_motor_equivalence_by_hand():
    """Nullspace: the last two joints; each part over the root of two dimensions."""
    parts = motor_equivalence(np.array([1.0, 1.0, 3.0, 4.0]), JACOBIAN)
    assert parts == pytest.approx((5 / math.sqrt(2), 1.0))
    singular = motor_equivalence(np.array([1.0, 1.0, 3.0, 4.0]), JACOBIAN * [[1], [0]])
    assert singular == pytest.approx((math.sqrt(26 / 3), 1.0))
    assert math.isnan(motor_equivalence(np.ones(2), np.eye(2))[0])


def test_parts_of_two_contexts():
    """Mean postures that differ by self-motion: the hand stays, which its Jacobian tells."""
    task, q = load_task("ascending"), posture(1.0, right_1=0.4, right_2=-0.5, right_3=0.6)
    joints = movable(task, "right")
    null = linalg.null_space(task.robot.jacobian(q, "right")[:, joints])
    noise = 1e-4 * rng(3).standard_normal((6, 10))
    moved = np.array(q)
    moved[joints] += 0.02 * null[:, 0]
    contexts = TwoContexts(
        posed(task, "", q + noise), posed(task, "", moved + noise[::-1]), 1, "right"
    )
    assert contexts.parts[0] == pytest.approx(0.02 / 2, rel=1e-3)  # of four dimensions
    assert contexts.parts[1] < 5e-4
    assert contexts.posture_difference == pytest.approx(0.02)


def isolated_ticks(task, q, goal, hand):
    return signatures.isolated_reaches(
        task, q[None], np.array([goal]), np.array([HANDS.index(hand)])
    )[0]


def test_isolated_reaches_are_the_corrective_process():
    task = load_task("two-armed-1")
    for hand, letter in (("left", "L"), ("right", "R")):
        ticks = corrective_trial(task, letter + "RRR").ticks_by_goal()[0]
        assert isolated_ticks(task, task.q0, 1, hand) == ticks
    assert isolated_ticks(tiny_task(), posture(0.5, 0.9), 1, "right") == 0
    unreachable = changed("ascending", locked_base=["x", "y"])
    assert np.isnan(isolated_ticks(unreachable, unreachable.q0, 3, "right"))
    stays = posed(unreachable, "", [unreachable.q0])
    assert signatures.ticks_slower(stays)[0, 2] == math.inf
    task = tiny_task(goals=[[2.0, 1.0], [4.4, 0.5]], locked_base=["x", "y"],
                     start={"left": [0.5] * 4, "right": [0.5] * 4})  # fmt: skip
    right = Solutions(task, "", (corrective_trial(task, "RR"),))
    assert signatures.ticks_slower(right)[0, 1] == 0  # the left hand cannot hit it


def test_what_a_posture_serves():
    """The corrective process itself gains nothing; half the way ahead, half the way is left."""
    task = AS_RELEASED
    initial = corrective_trial(task, "RRRR")
    assert signatures.gain_at_next(Solutions(task, "", (initial,)))[0] == pytest.approx([0, 0, 0])
    alone = initial.configurations
    q = alone.copy()
    q[:-1] += 0.5 * np.diff(alone, axis=0)

    def gain_of(q, hands="RRRR"):
        run = SimpleNamespace(configurations=q, hands=hands)
        return signatures.gain_at_next(Solutions(task, "", (run,)))[0, 0]

    left = isolated_ticks(task, q[0], 2, "right")[0]
    gain = isolated_ticks(task, alone[0], 2, "right")[0] - left
    assert gain > 0.4 * left
    assert gain_of(q) == gain
    # What the other arm does is not the chosen one's, though its hand is the next.
    q = corrective_trial(task, "RLRR").configurations.copy()
    q[0, task.robot.joints("left")] += 0.3
    assert gain_of(q, "RLRR") == 0


def test_signs_are_one_number_a_run():
    """A learner's first movement is slower, the whole task faster, than with the same hands."""
    task = load_task("two-armed-1")
    learned = [learn(task, "EC4", seed=seed, trials=100).execute() for seed in (1, 2)]
    cell = Solutions(task, "", tuple(learned))
    ticks = [
        (run.ticks_by_goal(), corrective_trial(task, run.hands).ticks_by_goal()) for run in learned
    ]
    first, whole = (SIGNATURES[name].each(cell).tolist() for name in ("first", "whole"))
    assert first == [ours[0] - alone[0] for ours, alone in ticks]
    assert whole == [sum(alone) - sum(ours) for ours, alone in ticks]
    assert not any(
        signature.each(Solutions(task, "", ())).size for signature in SIGNATURES.values()
    )
    one = load_task("ascending")
    alone = Solutions(one, "", (corrective_trial(one, "RRR"),))
    missing = {name for name, signature in SIGNATURES.items() if np.isnan(signature.each(alone))}
    assert missing == {"hand", "other arm"}


def test_choice_in_isolation():
    start = {"left": [math.pi, 0, 0, 0], "right": [0.0] * 4}
    task = tiny_task(goals=[[5.0, 0.1], [-5.0, 0.1]], initial_hands="RL", start=start)
    some = tuple(corrective_trial(task, hands) for hands in ("RL", "LR", "RR"))
    agrees = as_in_isolation(Solutions(task, "", some))
    assert agrees[:, 0].tolist() == [1, 0, 1]
    assert agrees[[0, 2], 1].tolist() == [1, 0]
    # Not of the last goal.
    assert SIGNATURES["hand"].each(Solutions(task, "", some)).tolist() == [0.0, 1.0, 0.0]


def test_preshaping_is_what_the_idle_arm_moved_since_its_own_hit_or_the_start():
    """The base does not count, nor the posture that an arm's own hit left."""
    task = load_task("two-armed-1")
    initial, run = corrective_trial(task, "RRRR"), corrective_trial(task, "LRLR")
    np.testing.assert_array_equal(signatures.preshaping(task, run, initial)[:3], [0, 0, 0])
    moved = [posture(0.3, left_1=a, left_2=0.4, right_1=b) for a, b in ((0.5, 0.2), (0.8, 0.4))]
    goals = [task.robot.forward_kinematics(q, hand).tolist()
             for q, hand in zip(moved, ("left", "right"), strict=True)]  # fmt: skip
    small = tiny_task(goals=[*goals, [7.0, 3.0]], initial_hands="LRL")
    initial = corrective_trial(small, "LRL")
    run = execute(small, [*movements_of("LR", moved), Movement(3, "left", "corrective")])
    shares = signatures.preshaping(small, run, initial)
    for k, idle, kept in ((0, "right", small.q0), (1, "left", run.configurations[0])):
        held, joints = run.configurations[k].copy(), small.robot.joints(idle)
        held[joints] = kept[joints]
        now, without, initially = (
            np.linalg.norm(small.robot.forward_kinematics(q, idle) - small.goals[k + 1])
            for q in (run.configurations[k], held, initial.configurations[k])
        )
        assert shares[k] == pytest.approx((without - now) / initially)
        assert abs(without - now) > 0.05
    assert np.isnan(shares[2])


ONE_ARMED = ("ascending", "descending")
MANY, ONE = (12, 12), (1, 1)
FEW_CONTROLS = "undecided: too few runs of random search"
NO_CONTROL = "undecided: no random search of as many trials"


@pytest.mark.parametrize(
    ("method", "difference", "runs", "verdict", "control"),
    [
        (EC1, 2.0, MANY, "different postures", {}),
        (EC1, 0.5, MANY, "no more than random search", {"difference": 2.0}),
        (EC1, 0.0, MANY, "no significant difference", {}),
        (EC1, 2.0, MANY, FEW_CONTROLS, {"runs": ONE}),
        (EC1, 2.0, MANY, NO_CONTROL, {"trials": 9}),  # fewer than the learner's
        # Methods without trials select nothing; of one that draws nothing there is no test.
        ("plan", 0.0, ONE, "the same posture", {}),
        ("plan", 0.005, ONE, "different, negligible", {}),
        # Five runs in each context are needed, whatever the number of divisions.
        ("mine", 0.5, (40, 4), "too few runs", {}),
        # With a hundredth of the noise the 90 % interval is below the bound of sameness.
        ("mine", 0.0, (9, 9), "the same posture", {"noise": 0.001}),
        ("mine", 0.009, (9, 9), "different postures", {"noise": 0.005}),
    ],
)
def test_verdicts_on_postures_at_a_shared_goal(method, difference, runs, verdict, control):
    """Bases differ so much at goal 1 by the next goal, in so many runs on each of two tasks."""
    planted = {"difference": 0.5, "runs": MANY, "trials": 10, "noise": 0.1} | control
    cells = [
        posed(load_task(name), label, [posture(x + each) for each in noise[:count]])
        for label, shift, counts in (
            (method, difference, runs), (RANDOM_SEARCH, planted["difference"], planted["runs"])
        )
        for noise in [planted["noise"] * rng(2).standard_normal(40)]
        for name, x, count in zip(ONE_ARMED, (0.0, shift), counts, strict=True)
    ]  # fmt: skip
    study = study_of_solutions(cells, deterministic=["plan"])
    of_control = study.runs.method == RANDOM_SEARCH
    change_runs(study, "trials", np.where(of_control, planted["trials"], 10 * (method == EC1)))
    contexts = shared_goal(study)
    assert contexts.method == method
    rows = TABLES["contexts"](study)
    assert rows.verdict[rows.method == method].tolist() == [verdict]
    compared = contexts_of_control(study, contexts)
    assert compared is None or method == EC1
    if compared is not None:
        assert compared.posture_difference == pytest.approx(planted["difference"])
        # Random search is not compared itself.
        assert contexts_of_control(study, compared) is None


def study_of_first(task, *cells):
    """A study of methods with their settings, ticks that the first movement of each run takes more
    than the corrective process's, hands of each run, and more of their rows."""
    solutions, rows = [], []
    for method, setting, first, hands, more in cells:
        runs = []
        for number, (ticks, of_run) in enumerate(zip(first, hands, strict=True)):
            alone = corrective_trial(task, of_run).ticks_by_goal()
            q = [posture(0.1 * number)]
            runs += posed(task, "", q, (alone[0] + ticks, *alone[1:]), of_run).runs
        solutions.append(Solutions(task, f"{method} {setting}".strip(), tuple(runs)))
        rows += runs_of(
            task.name, method, [-300] * len(first), setting=setting, hands=hands, **more
        )
    return study_of_solutions(solutions, rows)


def test_random_search_is_compared_at_equal_hands_and_trials_over_all_runs():
    """Hands of fewer than a tenth of the runs are not compared."""
    task, searched = load_task("two-armed-2"), [2, 3, 400, 130, 140]
    study = study_of_first(
        task,
        (EC4, "", [5] * 18 + [9] * 3 + [7], ["RRRR"] * 18 + ["RLRR"] * 3 + ["LRRR"], {}),
        # One of the runs is no faster than the corrective process alone, and counts.
        (RANDOM_SEARCH, "", searched, ["RRRR"] * 5, {}),
        (RANDOM_SEARCH, "trials=100", [9] * 5, ["RRRR"] * 5, {"trials": 100}),
        (RANDOM_SEARCH, "hands=RLLR", [1] * 5, ["RLLR"] * 5, {}),
    )
    compared = with_control(study, "first", task.name, EC4)
    assert {each: [v.tolist() for v in pair] for each, pair in compared.items()} == {
        "RRRR": [[5] * 18, searched],
        "RLRR": [[9] * 3, []],
    }
    assert mean_excess(study, "first", task.name, EC4) == 5 - 135
    table = TABLES["signatures"](study).loc[f"{task.name} {EC4} RRRR"]
    test = exchange_test([5.0] * 18, searched)
    assert (table["first"], table.first_control, table.first_p) == (5, 135, test.p)
    assert (table.runs, table.control_runs) == (18, 5)


@pytest.mark.parametrize("has_its_own", [True, False])
def test_the_control_of_ec3_has_an_idle_arm_that_keeps_still(has_its_own):
    """Where a folder has it; or else the control that it has, and the table says which it was."""
    cells = [(EC3, "", [5] * 3), (EC4, "", [5] * 3), (RANDOM_SEARCH, "stages=10", [6] * 3),
             (RANDOM_SEARCH, "", [2, 3, 4])]  # fmt: skip
    cells += [(RANDOM_SEARCH, "idle_arm=False", [1] * 3)] * has_its_own
    name = "two-armed-2"
    study = study_of_first(load_task(name), *((*cell, ["RRRR"] * 3, {}) for cell in cells))
    of_ec3 = [1, 1, 1] if has_its_own else [2, 3, 4]
    for label, expected in ((EC3, of_ec3), (EC4, [2, 3, 4])):
        ((_, control),) = with_control(study, "first", name, label).values()
        assert control.tolist() == expected
    rows = TABLES["signatures"](study)
    of_ec4 = rows[rows.method == EC4]
    assert [*of_ec4.hands] == ["", "RRRR"]  # the choice of hands is first
    idle = rows.control_idle_arm
    assert idle[f"{name} {EC3} RRRR"] == ("still" if has_its_own else "with noise")
    assert idle[f"{name} {EC4} RRRR"] == "with noise"


def test_p_of_shared_goals_is_corrected_by_method():
    """Of ten runs in two places 2 of 252 divisions are as far apart. Two tasks share three goals:
    the learner, on three tasks, has nine of them, and random search, on two, has three."""
    tasks = [
        tiny_task(name=name, goals=[[5.0, 0.0], [5.0, 1.0], [5.0, 2.0], [5.0, y]])
        for name, y in (("a", 3.0), ("b", 3.5), ("c", 4.0))
    ]
    cells = [
        posed(task, label, [posture(place + 0.01 * run) for run in range(5)], hands="RRRR")
        for label, count in ((EC1, 3), (RANDOM_SEARCH, 2))
        for place, task in enumerate(tasks[:count])
    ]
    table = TABLES["contexts"](study_of_solutions(cells))
    assert table.index.is_unique
    table = table.set_index("method")
    assert table.p_holm[EC1].tolist() == pytest.approx([9 * 2 / 252] * 9)
    assert table.p_holm[RANDOM_SEARCH].tolist() == pytest.approx([3 * 2 / 252] * 3)
    # Each of its tests alone is significant.
    assert {*table.verdict[EC1]} == {"no significant difference"}
