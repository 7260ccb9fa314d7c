"""What the paper prints, entry by entry: against the code, the task files, and itself."""

import pytest
from pydantic import ValidationError

from coartic import PAPER, Robot, corrective_trial, hand_sequences, load_task
from coartic.analysis.claims.judgements import CLAIMS
from coartic.analysis.topics.paper.published import (
    ENTRIES,
    RUNS,
    constant,
    parse_entries,
    published_cell,
    published_exhaustive,
    published_initial,
)
from coartic.learner import learning
from coartic.learner.conditions import CONDITIONS
from coartic.tasks.catalogue import builtin_tasks

TASKS = list(builtin_tasks())


def of(task, kind):
    return [entry for entry in ENTRIES.values() if (entry.task, entry.kind) == (task, kind)]


def test_constants_are_those_of_the_code():
    assert (constant("step"), constant("gain")) == (PAPER.step, PAPER.gain)
    assert {constant("epsilon"), constant("epsilon-of-closest-hand")} == {
        condition.epsilon for condition in CONDITIONS.values()
    }
    assert {constant("noise-sd")} == {condition.noise_sd for condition in CONDITIONS.values()}
    assert (RUNS, constant("trials")) == (20, learning.TRIALS) == (20, 10_000)
    robot = Robot()
    assert robot.dof == constant("degrees-of-freedom")
    assert robot.left_links == (constant("link-length"),) * int(constant("joints-per-arm"))
    assert robot.right_links == robot.left_links
    assert robot.base_size == (constant("base-width"), constant("base-height"))
    assert {constant("goal-radius")} == {load_task(name).radius for name in TASKS}
    assert constant("arrival-tolerance") == 10 * PAPER.arrival_tolerance  # docs/model.md says why


@pytest.mark.parametrize("name", TASKS)
def test_tasks_are_as_printed(name):
    task = load_task(name)
    (layout,), (posture,) = of(name, "layout"), of(name, "posture")
    along, across = (0, 1) if layout.same == "y" else (1, 0)
    line = [task.goals[goal - 1] for goal in layout.goals]
    (common,) = {goal[across] for goal in line}
    if layout.going:
        places = [goal[along] for goal in line]
        assert places == sorted(places, reverse=layout.going == "down")
    if layout.apart:
        off = task.goals[layout.apart - 1][across] - common
        assert off < 0 if layout.side in ("below", "left") else off > 0
    assert sorted(filter(None, (*layout.goals, layout.apart))) == list(
        range(1, len(task.goals) + 1)
    )
    assert tuple(task.q0[:2]) == posture.base
    left, right = (task.robot.forward_kinematics(task.q0, hand) for hand in ("left", "right"))
    if posture.arms == "steeple":
        assert left == pytest.approx(right)
    else:
        assert not task.q0[2:].any()
    assert published_initial(name).hands == task.initial_hands
    assert [goals.points for goals in of(name, "goals")] in ([], [task.goals])
    assert [lock.locked_base for lock in of(name, "lock")] in ([], [task.locked_base])
    assert bool(of(name, "lock")) == bool(task.locked_base)


@pytest.mark.parametrize("name", TASKS)
def test_constraints_hold_of_what_is_computed(name):
    """The initial rewards of reconstructed goals are near."""
    task = load_task(name)

    def reward(hands):
        return corrective_trial(task, hands).reward

    kinds = set()
    constraints = [e for e in ENTRIES.values() if (e.task, e.role) == (name, "constraint")]
    for entry in constraints:
        kinds.add(entry.kind)
        if entry.kind == "reward":
            assert entry.condition is None
            near = 0 if task.provenance["goals"].status == "printed" else 5
            assert abs(reward(entry.hands) - entry.number) <= entry.rounding + near
        elif entry.kind == "order":
            assert reward(entry.hands) > reward(entry.than.hands)
        elif entry.kind == "best of all sequences":
            assert reward(entry.hands) == max(map(reward, hand_sequences(task)))
            assert published_exhaustive(name).hands == entry.hands
        elif entry.kind == "base":
            reached = corrective_trial(task, entry.hands).configurations
            x = [task.q0[0], *(q[0] for q in reached)]
            assert all(x[goal] < x[goal - 1] for goal in entry.left)
            assert all(x[goal] > x[goal - 1] for goal in entry.right)
            assert (x[-1] > x[0]) == (entry.net == "right")
    assert "reward" in kinds
    assert name != "two-armed-1" or {"order", "best of all sequences", "base"} < kinds


def test_what_is_learned_never_selects():
    for entry in ENTRIES.values():
        than = getattr(entry, "than", None)
        learned = entry.condition or (than and than.condition) or entry.kind == "hand sequences"
        assert not learned or entry.role in ("test", "setting"), entry.id
        assert set(entry.claims) <= set(CLAIMS), entry.id
        goals = None if entry.task is None else len(load_task(entry.task).goals)
        assert all(len(e.hands) == goals for e in (entry, than) if e and e.hands), entry.id


def test_derived_numbers():
    initial = [ENTRIES[f"{name}.initial"] for name in ("ascending", "descending")]
    assert [(e.number, e.rounding) for e in initial] == [(-319, 1.0), (-333, 1.0)]
    assert published_initial("ascending") == initial[0]
    assert initial[0].hands == "RRR"
    rest = ENTRIES["two-armed-1.EC2-RRLR-runs"]
    assert (rest.number, rest.rounding, bool(rest.difference_of)) == (11, 0.0, True)
    learned = ENTRIES["descending.EC1-sd"]
    assert (learned.number, learned.rounding, learned.difference_of) == (1.88, 0.005, ())
    assert str(ENTRIES["two-armed-1.EC4-LRLR-sd"].value) == "2.0"


def test_a_cell_puts_its_groups_together():
    """EC2 of two-armed 1: 11 runs of -520 ± 7.7 and 9 of -609 ± 16.9."""
    cell = published_cell("two-armed-1", "EC2")
    assert {hands: s[:4] for hands, s in cell.sequences.items()} == {
        "RRLR": (-520, 7.7, 11, 11), "RRRR": (-609, 16.9, 9, 9)
    }  # fmt: skip
    assert cell.summary.mean == pytest.approx(-560.05)
    assert cell.summary.sd == pytest.approx(47.06, abs=0.01)
    assert cell.summary.derived
    assert cell.sequences["RRLR"].derived_runs
    assert not cell.sequences["RRRR"].derived_runs
    assert published_cell("ascending", "EC1").summary[:5] == (-303, 2.9, 20, 20, False)
    assert published_cell("ascending", "EC4") is None


@pytest.mark.parametrize("name", TASKS)
def test_numbers_of_a_condition_fit_together(name):
    numbers = [e for e in ENTRIES.values() if e.value is not None and e.task == name]
    for named in of(name, "hand sequences"):
        of_condition = [e for e in numbers if e.condition == named.condition]
        counts = {e.hands: e for e in of_condition if e.kind == "count"}
        assert set(counts) <= set(named.sequences)
        assert not counts or sum(e.number for e in counts.values()) == RUNS
        means = {e.hands: e for e in of_condition if e.kind == "reward"}
        assert set(means) - {None} <= set(named.sequences)
        if None in means and counts:
            shares = {hands: count.number / RUNS for hands, count in counts.items()}
            mean = sum(share * means[hands].number for hands, share in shares.items())
            error = sum(share * means[hands].rounding for hands, share in shares.items())
            assert abs(mean - means[None].number) <= error + means[None].rounding


def test_an_entry_keeps_its_decimals_and_refuses_what_it_does_not_know():
    row = '[own.a]\nkind = "reward"\nrole = "test"\nquote = ""\nplace = ""\nvalue = -3.50\n'
    (entry,) = parse_entries(row).values()
    assert (entry.id, entry.task, entry.digits, entry.number) == ("own.a", "own", 2, -3.5)
    assert entry.rounding == pytest.approx(0.005)
    for wrong in (row + "said = 1", row.replace("reward", "praise")):
        with pytest.raises(ValidationError):
            parse_entries(wrong)
