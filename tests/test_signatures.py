"""Signatures on constructed cases whose right answer is known."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic import Movement, corrective_trial, execute, learn, learn_many, load_task, trajectory
from coartic.analysis.methods import EC1, PLACEBO
from coartic.analysis.signatures import context, subtasks
from coartic.analysis.signatures.context import context_pairs, distance_of_means, permutation_p
from coartic.analysis.signatures.locus import locus_slopes, moved_goals, slope_length
from coartic.analysis.signatures.manifold import motor_equivalence, movable, subspaces
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.topics.coarticulation import placebo, sentences
from coartic.analysis.topics.coarticulation.values import signature_values
from coartic.analysis.trajectories import Trajectories, best_sequences, change_from
from tests.support.made_up import MadeUp, made, row, study_of
from tests.support.strategies import as_released, changed, tiny_task


def rng(seed=1):
    return np.random.default_rng(seed)


def posture(x=0.0, y=0.0, **joints):
    """Arms straight along +x, base at (x, y); ``right_2=0.3`` and the like bend them."""
    q = np.array([x, y, *[0.0] * 8])
    for name, angle in joints.items():
        hand, number = name.split("_")
        q[(2 if hand == "left" else 6) + int(number) - 1] = angle
    return q


def planned(*targets, hands):
    return [
        Movement(number, {"L": "left", "R": "right"}[letter], "planned", target)
        for number, (target, letter) in enumerate(zip(targets, hands, strict=True), 1)
    ]


# Context dependence


def test_context_dependence_by_hand():
    first = np.array([[0.0, 0.0], [2.0, 0.0]])  # mean (1, 0), squares 2
    second = np.array([[4.0, 3.0], [4.0, 5.0]])  # mean (4, 4), squares 2
    assert distance_of_means(first, second) == 5.0
    assert context.context_dependence(first, second) == pytest.approx(5.0 / math.sqrt(4 / 2))
    assert math.isnan(context.context_dependence(first[:1], second[:1]))
    assert math.isnan(context.context_dependence(first[[0, 0]], second[[1, 1]]))


def test_permutation_p_finds_a_planted_context_and_no_other():
    first = rng(2).standard_normal((20, 6))
    second = rng(3).standard_normal((20, 6))
    assert permutation_p(first, second, rng()) > 0.05
    assert math.isnan(permutation_p(first[:1], second, rng()))
    shift = np.array([0, 0, 2.0, 0, 0, 0])
    assert permutation_p(first, second + shift, rng()) < 0.001
    inside, outside = np.eye(6)[:, [2]], np.eye(6)[:, [0, 1, 3, 4, 5]]
    assert permutation_p(first, second + shift, rng(), basis=inside) < 0.001
    assert permutation_p(first, second + shift, rng(), basis=outside) > 0.05


def test_the_smallest_p_is_that_of_the_clearest_case():
    """Runs of each context in one place, far from the other: as many divisions as there are."""
    for n, m in ((2, 2), (3, 3), (3, 5), (4, 4)):
        first = rng(n).standard_normal((n, 3))
        second = rng(m).standard_normal((m, 3)) + 1000.0
        p = float(permutation_p(first, second, rng()))
        # Of groups of one size the exchange of both is as far apart.
        assert p == pytest.approx(context.smallest_p(n, m) * (2 if n == m else 1))
    assert context.smallest_p(2, 2) > 0.05 > context.smallest_p(4, 4)
    assert context.smallest_p(50, 50, resamples=99) == 0.01


def test_more_than_a_placebo_by_brute_force():
    """Every division of five runs and of four in two contexts, counted one by one."""
    draw = rng(6)
    method = draw.standard_normal((3, 2)), draw.standard_normal((2, 2)) + 2.0
    placebo = draw.standard_normal((2, 2)), draw.standard_normal((2, 2)) + 0.5
    pools = [np.concatenate(runs) for runs in zip(method, placebo, strict=True)]

    def excess(ours, theirs):
        groups = zip(pools, ours, theirs, strict=True)
        parts = [(pool[list(a)], pool[list(b)]) for pool, a, b in groups]
        return distance_of_means(parts[0][0], parts[1][0]) - distance_of_means(
            parts[0][1], parts[1][1]
        )

    observed, count, total = (
        distance_of_means(*method) - distance_of_means(*placebo),
        0,
        0,
    )
    for one in itertools.combinations(range(5), 3):
        for two in itertools.combinations(range(4), 2):
            rest = [set(range(5)) - set(one), set(range(4)) - set(two)]
            count += excess((one, two), rest) >= observed - 1e-12
            total += 1
    p = context.beyond_p(method, placebo, rng(), resamples=20_000)
    assert p == pytest.approx(2 * count / total, abs=0.03)


def test_a_context_counts_where_it_exceeds_the_placebos():
    """Selected noise: both move apart by the same; a learner that moves by more is told apart."""
    shift = np.array([0.5, 0.0, 0.0])
    noise = rng(7).standard_normal((4, 20, 3)) * 0.2
    placebo = noise[0], noise[1] + shift
    assert permutation_p(*placebo, rng()) < 0.001  # which alone would count as a sign
    assert context.beyond_p((noise[2], noise[3] + shift), placebo, rng()) > 0.05
    assert context.beyond_p((noise[2], noise[3] + 2 * shift), placebo, rng()) < 0.001
    assert math.isnan(context.beyond_p((noise[2][:1], noise[3]), placebo, rng()))


def test_slopes_count_where_they_exceed_the_placebos():
    """Three places of a goal: the contrast of their means is the slope, and what is tested."""
    x = np.array([-1.0, 0.0, 1.0])
    contrast = x / (x**2).sum()
    noise = rng(8).standard_normal((6, 12, 2)) * 0.1

    def follows(slope, samples):
        return [q + slope * place for q, place in zip(samples, x, strict=True)]

    steep, flat = follows(0.5, noise[:3]), follows(0.2, noise[3:])
    assert context.beyond_p(steep, flat, rng(), contrast=contrast) < 0.001
    assert context.beyond_p(flat, steep, rng(), contrast=contrast) == 1.0
    assert context.beyond_p(follows(0.2, noise[:3]), flat, rng(), contrast=contrast) > 0.05
    # What is common to all places is no slope.
    moved = [q + 3.0 for q in flat]
    assert context.beyond_p(moved, flat, rng(), contrast=contrast) > 0.05


def test_pairs_of_contexts():
    tasks = {name: load_task(name) for name in ("ascending", "descending", "two-armed-1")}
    assert context_pairs(tasks) == [("ascending", "descending", 1)]
    moved = tiny_task(goals=[[5.0, 1.0], [5.0, 2.0], [5.0, 3.0]], initial_hands="RRR")
    other = tiny_task(goals=[[5.0, 1.0], [5.0, 2.0], [5.0, 3.5]], initial_hands="RRR")
    assert context_pairs({"a": moved, "b": other, "c": moved}) == [
        ("a", "b", 2),
        ("b", "c", 2),
    ]
    wider = other.model_copy(update={"radius": 0.2})
    assert context_pairs({"a": moved, "b": wider}) == []


def test_lead_time_of_a_planted_divergence():
    """Contexts part five ticks before the hit, far beyond the scatter."""
    first = 0.01 * rng(4).standard_normal((12, 20, 3))
    second = 0.01 * rng(5).standard_normal((12, 20, 3))
    second[:, -6:, 1] += 1.0
    assert context.lead_time(first, second, rng(), alpha=0.002) == 5
    ticks = [permutation_p(first[:, k], second[:, k], rng()) for k in range(20)]
    assert max(ticks[-6:]) < 0.001
    assert ticks[-7] > 0.002
    second[:, -1] = first[:, -1]  # together again at the hit: no lead counts
    assert context.lead_time(first, second, rng()) is None
    assert context.lead_time(first, first, rng()) is None
    assert context.lead_time(first[:1], first, rng()) is None
    apart = first + 3.0
    assert context.lead_time(first, apart, rng()) == 19  # the whole movement


def test_permutations_by_brute_force():
    """Every division of seven runs, and every order of four means, counted one by one."""
    draw = rng(11)
    first, second = draw.standard_normal((3, 2)), draw.standard_normal((4, 2)) + 0.8
    pool = np.concatenate([first, second])
    observed = distance_of_means(first, second)
    count = 0
    for chosen in itertools.combinations(range(7), 3):
        rest = [k for k in range(7) if k not in chosen]
        count += distance_of_means(pool[list(chosen)], pool[rest]) >= observed - 1e-12
    assert permutation_p(first, second, rng()) == pytest.approx(count / 35)
    drawn = permutation_p(first, second, rng(), resamples=34)
    assert drawn == pytest.approx(count / 35, abs=0.25)
    assert drawn * 35 == pytest.approx(round(drawn * 35))  # the observed one counts
    x, q = np.array([0.0, 1.0, 3.0, 4.0]), draw.standard_normal((4, 2))
    norms = [
        math.hypot(*(np.polyfit(x, q[list(order), k], 1)[0] for k in range(2)))
        for order in itertools.permutations(range(4))
    ]
    norm = slope_length(q, x, rng())
    assert norm.value == pytest.approx(norms[0])
    assert norm.p == pytest.approx(np.mean(np.array(norms) >= norms[0] - 1e-12))


# What the hand feels


def test_movable_joints():
    assert list(movable(load_task("two-armed-1"), "left")) == [0, 2, 3, 4, 5]  # y is locked
    assert list(movable(load_task("ascending"), "right")) == [0, 1, 6, 7, 8, 9]


JACOBIAN = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]])


def test_motor_equivalence_by_hand():
    """Nullspace: the last two joints; each part over the root of two dimensions."""
    parts = motor_equivalence(np.array([1.0, 1.0, 3.0, 4.0]), JACOBIAN)
    assert parts == pytest.approx((5 / math.sqrt(2), 1.0))
    singular = motor_equivalence(np.array([1.0, 1.0, 3.0, 4.0]), JACOBIAN * [[1], [0]])
    assert singular == pytest.approx((math.sqrt(26 / 3), 1.0))
    assert math.isnan(motor_equivalence(np.ones(2), np.eye(2))[0])


def test_self_motion_of_the_robot_is_motor_equivalent():
    """A small displacement that leaves the hand in place, and one that only moves it."""
    task = load_task("ascending")
    q = posture(1.0, right_1=0.4, right_2=-0.5, right_3=0.6)
    joints = movable(task, "right")
    jacobian = task.robot.jacobian(q, "right")[:, joints]
    null, complement = subspaces(jacobian)
    still, moving = np.array(q), np.array(q)
    still[joints] += 1e-4 * null[:, 0]
    moving[joints] += 1e-4 * complement[:, 0]
    at = task.robot.forward_kinematics(np.array([q, still, moving]), "right")
    assert np.linalg.norm(at[1] - at[0]) < 1e-7
    assert np.linalg.norm(at[2] - at[0]) > 5e-5
    parts = [motor_equivalence((p - q)[joints], jacobian) for p in (still, moving)]
    assert parts[0] == pytest.approx((1e-4 / 2, 0), abs=1e-12)
    assert parts[1] == pytest.approx((0, 1e-4 / math.sqrt(2)), abs=1e-12)


# Subtasks and hands


def test_isolated_reaches_are_the_corrective_process():
    task = load_task("two-armed-1")
    for hand, letter in (("left", "L"), ("right", "R")):
        ticks, _ = subtasks.isolated_reach(task, task.q0, 1, hand)
        assert ticks == corrective_trial(task, letter + "RRR").ticks_by_goal()[0]
    assert subtasks.isolated_reach(tiny_task(), posture(0.5, 0.9), 1, "right")[0] == 0
    unreachable = changed("ascending", locked_base=["x", "y"])
    assert subtasks.isolated_reach(unreachable, unreachable.q0, 3, "right") is None


def test_other_hands_are_no_sacrifice():
    """Goal 1 with the slower hand, by the corrective process: nothing is given up."""
    task = as_released("two-armed-1")  # where the left hand is the slower one
    initial, other = corrective_trial(task, "RRRR"), corrective_trial(task, "LRLR")
    assert change_from(other, initial)[0] > 1  # the old comparison took this for a sacrifice
    assert other.ticks < initial.ticks
    frame = signature_values(solved_study([(task, "every", [other.movements])]))
    rows = frame.set_index("signature")
    assert rows.loc["first subtask against the same hands"].value == 0
    assert rows.loc["total against the same hands"].value == 0


def test_signs_are_signatures_with_one_number_a_run():
    """A learner's first movement is slower, the whole faster, than with the same hands."""
    task = load_task("two-armed-1")
    runs = [learn(task, "EC4", seed=seed, trials=400).solution for seed in (1, 2)]
    cell = Trajectories(task, "", "", tuple(trajectory(task, solution) for solution in runs))
    corrective = [corrective_trial(task, hands).ticks_by_goal() for hands in cell.sequences]
    learned = [run.execution.ticks_by_goal() for run in cell.runs]
    first, whole = SIGNS["first"].of(cell), SIGNS["whole"].of(cell)
    assert first.tolist() == [a[0] - b[0] for a, b in zip(learned, corrective, strict=True)]
    assert whole.tolist() == [sum(b) - sum(a) for a, b in zip(learned, corrective, strict=True)]
    nearer = [subtasks.preshaping(run, corrective_trial(task, "RRRR")) for run in cell.runs]
    assert SIGNS["other arm"].of(cell) == pytest.approx([np.nanmean(run) for run in nearer])
    each = [subtasks.served(run).mean(axis=0) for run in cell.runs]
    assert SIGNS["cost"].of(cell) == pytest.approx([cost for cost, _ in each])
    assert SIGNS["arm"].of(cell) == pytest.approx([gain for _, gain in each])
    assert not any(sign.of(Trajectories(task, "", "", ())).size for sign in SIGNS.values())
    one = load_task("ascending")
    alone = Trajectories(one, "", "", (trajectory(one, corrective_trial(one, "RRR").movements),))
    assert [sign.of(alone).size for sign in SIGNS.values()] == [0, 1, 1, 0, 1, 1]


def test_choice_in_isolation():
    """Each hand beside its goal: the near one is the isolated choice."""
    start = {"base": [0.0, 0.0], "left": [math.pi, 0, 0, 0], "right": [0.0] * 4}
    task = tiny_task(goals=[[5.0, 0.1], [-5.0, 0.1]], initial_hands="RL", start=start)
    paths = [trajectory(task, corrective_trial(task, hands).movements) for hands in ("RL", "LR")]
    agrees = REGISTER["hand as in isolation"].measure(Trajectories(task, "", "", tuple(paths)))
    assert agrees[:, 0].tolist() == [True, False]
    assert agrees[0, 1]
    assert SIGNS["hand"].of(Trajectories(task, "", "", tuple(paths))).tolist() == [0.0, 1.0]


def test_best_corrective_sequences():
    rewards = pd.array([-9, -7, -7, None], dtype="Int64")
    table = pd.DataFrame({"hands": ["RR", "RL", "LR", "LL"], "reward": rewards})
    assert best_sequences(table) == ["RL", "LR"]
    assert best_sequences(table[3:]) == []


# The other arm


def test_travel_is_of_the_arm_that_waits():
    task = tiny_task(goals=[[5.5, 0.1], [7.5, 0.1]], initial_hands="RL")
    path = trajectory(task, planned(posture(1.0, left_4=0.5), posture(4.0), hands="RL"))
    assert subtasks.waiting_travel(path)[0] == pytest.approx(path.execution.configurations[0][5])
    assert subtasks.waiting_travel(path)[1] == 0.0  # the right arm, when the left hand works


def test_preshaping_by_the_arm_alone():
    """The base never moves: all of it is the arm's."""
    start = posture(left_1=1.0)
    swung = posture(left_1=1.0, right_1=0.4)
    robot = load_task("two-armed-1").robot
    goals = [robot.forward_kinematics(q, hand).tolist()
             for q, hand in ((swung, "right"), (posture(left_1=0.2), "left"))]  # fmt: skip
    content = {"base": [0.0, 0.0], "left": start[2:6].tolist(), "right": start[6:].tolist()}
    task = tiny_task(goals=goals, initial_hands="RL", start=content, locked_base=["x", "y"])
    end = posture(left_1=0.2, right_1=0.4)
    initial = execute(task, planned(swung, end, hands="RL"))
    path = trajectory(task, planned(posture(left_1=0.6, right_1=0.4), end, hands="RL"))
    now, before = (
        np.linalg.norm(robot.forward_kinematics(of.configurations[0], "left") - goals[1])
        for of in (path.execution, initial)
    )
    assert 0.2 < subtasks.preshaping(path, initial)[0] == pytest.approx(1 - now / before)
    assert np.isnan(subtasks.preshaping(path, initial)[1])


def test_what_its_own_hit_left_is_no_preshaping_since():
    """The left arm keeps still after its hit of goal 1, in another posture than initially."""
    task = load_task("two-armed-1")
    initial = corrective_trial(task, "RRRR")
    path = trajectory(task, corrective_trial(task, "LRLR").movements)
    np.testing.assert_array_equal(subtasks.preshaping(path, initial)[:3], [0, 0, 0])
    moved = [posture(0.3, left_1=a, left_2=0.4, right_1=b) for a, b in ((0.5, 0), (0.8, 0.3))]
    robot = task.robot
    goals = [robot.forward_kinematics(q, hand).tolist()
             for q, hand in zip(moved, ("left", "right"), strict=True)]  # fmt: skip
    goals.append([7.0, 3.0])
    small = tiny_task(goals=goals, initial_hands="LRL")
    end = Movement(3, "left", "corrective")
    still = execute(
        small, [Movement(1, "left", "corrective"), Movement(2, "right", "corrective"), end]
    )
    path = trajectory(small, [*planned(*moved, hands="LR"), end])
    configurations = path.execution.configurations
    held = np.array(configurations[1])
    held[2:6] = configurations[0, 2:6]
    now, without, before = (
        np.linalg.norm(robot.forward_kinematics(q, "left") - [7.0, 3.0])
        for q in (configurations[1], held, still.configurations[1])
    )
    assert subtasks.preshaping(path, still)[1] == pytest.approx((without - now) / before)
    assert abs(without - now) > 0.05


def test_waiting_arms_keep_still_under_condition_3_only():
    for condition, moves in (("EC3", False), ("EC4", True)):
        run = learn(load_task("two-armed-1"), condition, seed=1, trials=400)
        path = trajectory(run.task, run.solution)
        moved = subtasks.preshaping(path, corrective_trial(run.task, "RRRR"))
        assert (np.nan_to_num(moved) != 0).any() == moves


# Form


def test_turning_angles():
    corners = np.array([[0, 0], [1, 0], [2, 0], [2, 3], [2, 1], [2, 1], [5, 5.0]])
    angles = subtasks.turning_angles(corners)
    np.testing.assert_allclose(angles[:3], [0, math.pi / 2, math.pi], atol=1e-12)
    assert np.isnan(angles[3:]).all()


# Locus


def family_of(positions, goal=2, coordinate=1):
    tasks = {}
    for k, position in enumerate(positions):
        goals = [[5.0, 1.0], [5.0, 2.0], [5.0, 3.0]]
        goals[goal - 1][coordinate] = position
        tasks[f"v{k}"] = tiny_task(name=f"v{k}", goals=goals, initial_hands="RRR")
    return tasks


def test_families():
    tasks = family_of([1.5, 2.0, 2.5, 3.5])
    ((moving, positions),) = moved_goals({**tasks, "ascending": load_task("ascending")})
    assert moving == 2
    assert positions == pytest.approx({"v0": -0.875, "v1": -0.375, "v2": 0.125, "v3": 1.125})
    assert moved_goals(family_of([1.5, 2.0])) == []
    ((moving, across),) = moved_goals(family_of([4.0, 3.0, 5.0], goal=3, coordinate=0))
    assert moving == 3
    assert list(across.values()) == pytest.approx([0, -1, 1], abs=1e-12)


def test_two_families_share_their_common_task():
    tasks = family_of([1.5, 2.0, 2.5]) | {
        f"w{k}": task for k, task in enumerate(family_of([3.5, 4.0], goal=3).values())
    }
    assert {(moving, tuple(positions)) for moving, positions in moved_goals(tasks)} == {
        (2, ("v0", "v1", "v2")),
        (3, ("v1", "w0", "w1")),
    }


def test_locus_slopes_by_hand():
    """Means 0, 1, 5 at -1, 0, 1: slope 2.5, residuals ½, -1, ½, one degree of freedom."""
    q = np.array([[-1.0], [1.0], [1.0], [5.0], [5.0]])
    (slope,) = locus_slopes(q, [-1, -1, 0, 1, 1])
    half = 12.7062047 * math.sqrt(1.5 / 2)
    assert (slope.value, slope.low, slope.high) == pytest.approx((2.5, 2.5 - half, 2.5 + half))
    # t = 2.5 / √(1.5 / 2), one degree of freedom: Cauchy's distribution, both tails.
    assert slope.p == pytest.approx(1 - 2 * math.atan(2.5 / math.sqrt(0.75)) / math.pi)
    # However many runs there are of each task, the evidence is that of three positions.
    many = np.repeat(q, 50, axis=0), np.repeat([-1, -1, 0, 1, 1], 50)
    assert locus_slopes(*many)[0] == pytest.approx(slope)


def test_a_curve_is_no_slope():
    """200 runs on a parabola, whose line over all runs would be "significant"."""
    places = np.repeat([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0], 40)
    curve = (0.01 * rng(12).standard_normal(240) + 0.1 * places**2)[:, None]
    assert stats.linregress(places, curve[:, 0]).pvalue < 1e-6
    assert locus_slopes(curve, places)[0].p > 0.1
    assert slope_length(curve, places, rng()).p > 0.1


# The driver


def solved_study(solved):
    """A study of ``(task, method, [movements of each run])``."""
    rows, movements = [], {}
    tasks = {task.name: task for task, _, _ in solved}
    for task, method, solutions in solved:
        for run, solution in enumerate(solutions):
            run_id = f"{task.name}-{method}-{run}"
            execution = execute(task, solution)
            rows.append({"run_id": run_id, "task": task.name, "method": method, "variant": "",
                         "status": "ok", "run": run, "reward": execution.reward,
                         "hands": execution.hands})  # fmt: skip
            movements[run_id] = pd.DataFrame(
                {"order": order, "goal": m.goal, "hand": m.hand, "kind": m.kind, "ticks": m.ticks}
                | dict(zip(task.robot.joint_names, m.target, strict=True))
                for order, m in enumerate(execution.movements)
            )
        if not solutions:
            rows.append({"run_id": f"{task.name}-{method}", "task": task.name, "method": method,
                         "variant": "", "status": "infeasible", "run": 0})  # fmt: skip
    study = study_of(pd.DataFrame(rows), list(tasks.values()))
    return MadeUp(study, movements=(movements, {}))


def test_frame_of_two_contexts():
    """The learner depends on context, the corrective process does not."""
    tasks = [load_task("ascending"), load_task("descending")]
    solved = []
    for task in tasks:
        runs = learn_many(task, "EC1", seeds=range(5), trials=1500)
        solved += [
            (task, "learner", [run.solution for run in runs]),
            (task, "corrective", [corrective_trial(task, "RRR").movements]),
            (task, "failed", []),
        ]
    frame = signature_values(solved_study(solved))
    assert frame.equals(signature_values(solved_study(solved)))  # nothing is random but by its seed

    def one(method, signature):
        rows = frame[(frame.task == "ascending") & (frame.method == method)]
        return rows[rows.signature == signature].iloc[0]

    assert one("learner", "context dependence").p < 0.02  # 2 of 252 at best
    assert one("learner", "motor-equivalent part").value > 5 * (
        one("learner", "non-motor-equivalent part").value
    )
    assert one("corrective", "context distance").value == 0
    assert one("corrective", "context dependence").why_not.startswith("one run a context")
    assert one("learner", "total against the same hands").high < 0
    assert one("learner", "hand as in isolation").why_not == "the task has one hand"
    assert one("failed", "total against the same hands").why_not == "no run has a solution"
    assert one("learner", "locus slope").why_not.startswith("fewer than 3 tasks")
    assert list(frame.signature.unique()) == [
        each.name for each in REGISTER.values() if each.meaning
    ]
    # A row has a value, or says why it has none.
    assert (frame.value.notna() | (frame.why_not != "")).all()
    intervals = frame[frame.low.notna()]
    assert (intervals.low <= intervals.value + 1e-9).all()
    assert (intervals.value <= intervals.high + 1e-9).all()
    assert set(frame.method) == {"learner", "corrective", "failed"}


def test_frame_of_a_family():
    """The base is lower at goals 1 and 3 by a tenth of goal 2's height: slopes are known."""
    solved = []
    for task in family_of([1.5, 2.0, 2.5]).values():
        height = task.goals[1][1]
        lower = 0.02 * (height - 2.0)
        targets = [posture(0.5, 0.85 + lower), posture(0.5, height - 0.1), posture(0.5, 2.95)]
        solved.append((task, "planner", [planned(*targets, hands="RRR")] * 2))
    frame = signature_values(solved_study(solved))
    slopes = frame[frame.signature == "locus slope"].set_index(["goal", "hand", "joint"])
    assert set(slopes.moving) == {2}
    norms = frame[frame.signature == "locus slope norm"].set_index(["goal", "hand"])
    reached = {
        goal: [
            execute(task, solution[0]).configurations[goal - 1, 1] for task, _, solution in solved
        ]
        for goal in (1, 3)
    }
    for goal in (1, 3):
        row = slopes.loc[goal, "right", "base_y"]
        assert row.value == pytest.approx(reached[goal][2] - reached[goal][0])  # over length 1
        assert row.n == 6
        every = slopes.value.loc[goal, "right"]
        assert norms.value[goal, "right"] == pytest.approx(np.linalg.norm(every))
        assert norms.p[goal, "right"] in (pytest.approx(k / 3) for k in (1, 2, 3))  # of 6 orders
    assert slopes.value[1, "right", "base_y"] > 0.001
    contexts = frame[frame.signature == "context distance"]
    assert contexts.why_not.str.contains("locus slopes").all()


# Beside the placebo


def study_beside_placebo(apart, of_placebo=0.5, *, runs=12, placebo_runs=12, replayed=None):
    """The learner's bases lie ``apart`` at goal 1 by the next goal, and those of the placebo."""
    tasks = [load_task("ascending"), load_task("descending")]
    groups = {EC1: (apart, runs), PLACEBO: (of_placebo, placebo_runs)}
    rows, cells = [], {}
    for label, (shift, count) in groups.items():
        for side, task in enumerate(tasks):
            q = np.zeros((count, len(task.goals), 10))
            q[..., 0] = 0.1 * rng(side).standard_normal((count, 1)) * (count > 1)
            q[..., 0] += side * shift - (q[..., 0].mean() if count else 0)
            solutions = [SimpleNamespace(hands=["right"] * 3, execution=SimpleNamespace(
                configurations=each, ticks_by_goal=lambda: [9, 9, 9], hands="RRR"))
                for each in q]  # fmt: skip
            cells[task.name, label] = Trajectories(task, label, "", tuple(solutions))
            rows += [row(label, -300, task=task.name, run=k) for k in range(count)]
    replays = {key: Trajectories(cell.task, cell.method, "", cell.runs if replayed else ())
               for key, cell in cells.items()}  # fmt: skip
    study = study_of(pd.DataFrame(rows), tasks)
    return MadeUp(study, trajectories=made(cells), replays=made(replays))


@pytest.mark.parametrize(
    ("made_up", "seen", "answer"),
    [
        ({"apart": 2.0}, True, "Yes: at goal 1 base and joints lie 2.00 apart"),
        ({"apart": 0.5}, False, "Not shown:"),
        ({"apart": 0.5, "of_placebo": 2.0}, False, "Not shown:"),
        ({"apart": 0.0}, False, "No significant difference:"),
        ({"apart": 2.0, "runs": 2}, False, "Too few runs"),
        ({"apart": 2.0, "placebo_runs": 0}, False, "Undecided:"),
    ],
)
def test_a_method_that_selects_has_to_exceed_the_placebo(made_up, seen, answer):
    study = study_beside_placebo(**made_up)
    found = placebo.difference(study)
    assert found.contexts.method == EC1
    assert found.contexts.apart == pytest.approx(made_up["apart"])
    assert found.seen == seen
    assert sentences.answer(study).startswith(answer)
    if found.placebo is not None:
        p = found.contexts.p_beyond(found.placebo)
        assert found.placebo.apart == pytest.approx(made_up.get("of_placebo", 0.5))
        assert placebo.context_beyond_p(study, found.contexts) == p or len(found.contexts.runs) < 2
        # The placebo itself is tested against nothing.
        assert math.isnan(placebo.context_beyond_p(study, found.placebo))
