"""What the paper publishes, entry by entry: against the code, the task files, and itself."""

import pytest

from coartic import PAPER, Robot, corrective_trial, hand_sequences, load_task
from coartic.learner.conditions import CONDITIONS
from coartic.method import TRIALS
from coartic.tasks.catalogue import builtin_tasks
from tests.support.processes import programs

REGISTER, PUBLISHED = programs("replication", "claims", "published")
ENTRIES, RUNS, published_cell = PUBLISHED.ENTRIES, PUBLISHED.RUNS, PUBLISHED.published_cell
TASKS = list(builtin_tasks())


def of(task, kind):
    return [entry for entry in ENTRIES.values() if (entry["task"], entry["kind"]) == (task, kind)]


def constant(name):
    return ENTRIES[f"general.{name}"]["value"]


def rounding(entry):
    """Half a unit of the last decimal that is published; twice that of a difference."""
    if "difference_of" in entry:
        return sum(rounding(ENTRIES[name]) for name in entry["difference_of"])
    decimals = str(entry["value"]).partition(".")[2]
    return 0.0 if entry["kind"] == "count" else 0.5 * 10.0 ** -len(decimals)


def test_constants_are_those_of_the_code():
    assert (constant("step"), constant("gain")) == (PAPER.step, PAPER.gain)
    assert {constant("epsilon"), constant("epsilon-of-closest-hand")} == {
        condition.epsilon for condition in CONDITIONS.values()
    }
    assert {constant("noise-sd")} == {condition.noise_sd for condition in CONDITIONS.values()}
    assert (RUNS, constant("trials")) == (20, TRIALS) == (20, 10_000)
    robot = Robot()
    assert robot.dof == constant("degrees-of-freedom")
    assert robot.left_links == (constant("link-length"),) * int(constant("joints-per-arm"))
    assert robot.right_links == robot.left_links
    assert robot.base_size == (constant("base-width"), constant("base-height"))
    assert {constant("goal-radius")} == {load_task(name).radius for name in TASKS}
    assert (
        constant("arrival-tolerance") == 10 * PAPER.for_radius().arrival_tolerance
    )  # docs/model.md says why


@pytest.mark.parametrize("name", TASKS)
def test_tasks_are_as_published(name):
    task = load_task(name)
    (layout,), (posture,) = of(name, "layout"), of(name, "posture")
    along, across = (0, 1) if layout["same"] == "y" else (1, 0)
    line = [task.goals[goal - 1] for goal in layout["goals"]]
    (common,) = {goal[across] for goal in line}
    if "going" in layout:
        places = [goal[along] for goal in line]
        assert places == sorted(places, reverse=layout["going"] == "down")
    if "apart" in layout:
        off = task.goals[layout["apart"] - 1][across] - common
        assert off < 0 if layout["side"] in ("below", "left") else off > 0
    others = [layout["apart"]] if "apart" in layout else []
    assert sorted([*layout["goals"], *others]) == list(range(1, len(task.goals) + 1))
    assert list(task.q0[:2]) == posture["base"]
    left, right = (task.robot.forward_kinematics(task.q0, hand) for hand in ("left", "right"))
    if posture["arms"] == "steeple":
        assert left == pytest.approx(right)
    else:
        assert not task.q0[2:].any()
    assert [entry["hands"] for entry in of(name, "initial hands")] == [task.initial_hands]
    points = [[tuple(point) for point in goals["points"]] for goals in of(name, "goals")]
    assert points in ([], [list(task.goals)])
    assert [tuple(lock["locked_base"]) for lock in of(name, "lock")] in ([], [task.locked_base])
    assert bool(of(name, "lock")) == bool(task.locked_base)


@pytest.mark.parametrize("name", TASKS)
def test_constraints_hold_of_what_is_computed(name):
    """The initial rewards of reconstructed goals are near."""
    task = load_task(name)

    def reward(hands):
        return corrective_trial(task, hands).reward

    kinds = set()
    constraints = [e for e in ENTRIES.values() if (e["task"], e["role"]) == (name, "constraint")]
    for entry in constraints:
        kinds.add(kind := entry["kind"])
        if kind == "reward":
            assert "condition" not in entry
            near = 0 if task.provenance["goals"].status == "published" else 5
            assert abs(reward(entry["hands"]) - entry["value"]) <= rounding(entry) + near
        elif kind == "order":
            assert reward(entry["hands"]) > reward(entry["than"]["hands"])
        elif kind == "best of all sequences":
            assert reward(entry["hands"]) == max(map(reward, hand_sequences(task)))
        elif kind == "base":
            reached = corrective_trial(task, entry["hands"]).configurations
            x = [task.q0[0], *(q[0] for q in reached)]
            assert all(x[goal] < x[goal - 1] for goal in entry.get("left", ()))
            assert all(x[goal] > x[goal - 1] for goal in entry.get("right", ()))
            assert (x[-1] > x[0]) == (entry["net"] == "right")
    assert "reward" in kinds
    assert name != "two-armed-1" or {"order", "best of all sequences", "base"} < kinds


def test_what_is_learned_never_selects():
    for entry in ENTRIES.values():
        than, task = entry.get("than", {}), entry["task"]
        learned = "condition" in {*entry, *than} or entry["kind"] == "hand sequences"
        assert not learned or entry["role"] in ("test", "setting"), entry
        assert set(entry.get("claims", ())) <= {*REGISTER.CLAIMS.index}, entry
        goals = None if task == "general" else len(load_task(task).goals)
        assert all(len(e["hands"]) == goals for e in (entry, than) if "hands" in e), entry


def test_a_cell_puts_its_groups_together():
    """EC2 of two-armed 1: 11 runs of -520 ± 7.7 and 9 of -609 ± 16.9."""
    cell = published_cell("two-armed-1", "EC2")
    assert cell["RRLR"][:4] == (-520, 7.7, 11, 11)
    assert (cell[""].mean, cell[""].sd) == pytest.approx((-560.05, 47.06), abs=0.01)
    assert cell[""].derived
    assert not cell["RRLR"].derived
    assert published_cell("ascending", "EC1")[""][:5] == (-303, 2.9, 20, 20, False)
    assert published_cell("ascending", "EC4") is None


@pytest.mark.parametrize("name", TASKS)
def test_numbers_of_a_condition_fit_together(name):
    numbers = [e for e in ENTRIES.values() if "value" in e and e["task"] == name]
    for named in of(name, "hand sequences"):
        of_condition = [e for e in numbers if e.get("condition") == named["condition"]]
        counts = {e.get("hands"): e for e in of_condition if e["kind"] == "count"}
        sequences = set(named.get("sequences", ()))
        assert set(counts) <= sequences
        assert not counts or sum(e["value"] for e in counts.values()) == RUNS
        means = {e.get("hands"): e for e in of_condition if e["kind"] == "reward"}
        assert set(means) - {None} <= sequences
        if None in means and counts:
            shares = {hands: count["value"] / RUNS for hands, count in counts.items()}
            mean = sum(share * means[hands]["value"] for hands, share in shares.items())
            error = sum(share * rounding(means[hands]) for hands, share in shares.items())
            assert abs(mean - means[None]["value"]) <= error + rounding(means[None])
