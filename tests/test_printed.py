"""What the paper prints, entry by entry: against the code, the task files, and itself."""

import math

import pytest
from coartic.analysis.printed import (
    ENTRIES,
    Base,
    Best,
    Constant,
    Count,
    Gain,
    Goals,
    InitialHands,
    Layout,
    Lock,
    Order,
    Posture,
    Reward,
    Sd,
    Sequences,
    constant,
    parse_entries,
)
from pydantic import ValidationError

from coartic import PAPER, CoarticError, Robot, corrective_trial, hand_sequences, load_task
from coartic.analysis import printed
from coartic.analysis.claims.register import CLAIMS
from coartic.analysis.published import RUNS, TRIALS
from coartic.learner.conditions import CONDITIONS
from coartic.tasks.catalogue import builtin_tasks
from coartic.tasks.readings import readings

TASKS = list(builtin_tasks())


def of(task, kind):
    return [entry for entry in ENTRIES.values() if entry.task == task and type(entry) is kind]


def test_constants_are_those_of_the_code():
    assert (constant("step"), constant("gain")) == (PAPER.step, PAPER.gain)
    assert {constant("epsilon"), constant("epsilon-of-closest-hand")} == {
        condition.epsilon for condition in CONDITIONS.values()
    }
    assert {constant("noise-sd")} == {condition.noise_sd for condition in CONDITIONS.values()}
    assert (RUNS, TRIALS) == (20, 10_000)
    robot = Robot()
    assert robot.dof == constant("degrees-of-freedom")
    assert robot.left_links == (constant("link-length"),) * int(constant("joints-per-arm"))
    assert robot.right_links == robot.left_links
    assert robot.base_size == (constant("base-width"), constant("base-height"))
    assert {constant("goal-radius")} == {load_task(name).radius for name in TASKS}
    (reading,) = (r for r in readings() if r.id == "arrival-tolerance")
    assert [c.value for c in reading.choices if c.printed] == [constant("arrival-tolerance")]
    with pytest.raises(KeyError):
        constant("not-normal")


@pytest.mark.parametrize("name", TASKS)
def test_tasks_are_as_printed(name):
    task = load_task(name)
    (layout,), (posture,), (initial,) = of(name, Layout), of(name, Posture), of(name, InitialHands)
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
    assert initial.hands == task.initial_hands
    assert [goals.points for goals in of(name, Goals)] in ([], [task.goals])
    assert [lock.locked_base for lock in of(name, Lock)] in ([], [task.locked_base])
    assert bool(of(name, Lock)) == bool(task.locked_base)


@pytest.mark.parametrize("name", TASKS)
def test_constraints_hold_of_what_is_computed(name):
    """As a search may ask; the initial rewards of reconstructed goals are near."""
    task = load_task(name)

    def reward(hands):
        return corrective_trial(task, hands).reward

    seen = set()
    for entry in printed.constraints(name):
        seen.add(type(entry))
        match entry:
            case Reward():
                assert entry.condition is None
                near = 0 if task.provenance["goals"].status == "printed" else 5
                assert abs(reward(entry.hands) - entry.number) <= entry.rounding + near
            case Order():
                assert reward(entry.hands) > reward(entry.than.hands)
            case Best():
                assert reward(entry.hands) == max(map(reward, hand_sequences(task)))
            case Base():
                reached = corrective_trial(task, entry.hands).configurations
                x = [task.q0[0], *(q[0] for q in reached)]
                assert all(x[goal] < x[goal - 1] for goal in entry.left)
                assert all(x[goal] > x[goal - 1] for goal in entry.right)
                assert (x[-1] > x[0]) == (entry.net == "right")
    assert Reward in seen
    assert name != "two-armed-1" or {Order, Best, Base} < seen


def test_what_is_learned_never_selects():
    for entry in ENTRIES.values():
        assert entry.condition is None or entry.role in ("test", "setting"), entry.id
        learned = isinstance(entry, Sd | Count | Gain | Sequences)
        assert not learned or entry.role == "test", entry.id
        than = getattr(entry, "than", None)
        assert than is None or than.condition is None or entry.role == "test", entry.id
        assert isinstance(entry, Constant) <= (entry.role == "setting"), entry.id


@pytest.mark.parametrize("name", TASKS)
def test_constraints_and_tests_are_apart(name):
    constraints, tests = printed.constraints(name), printed.tests(name)
    assert not {e.id for e in constraints} & {e.id for e in tests}
    assert {e.task for e in (*constraints, *tests)} == {name}
    assert constraints
    assert tests


def test_a_task_that_the_paper_lacks():
    with pytest.raises(CoarticError, match="no task 'two-armed-3'; .*; did you mean 'two-armed-"):
        printed.constraints("two-armed-3")
    with pytest.raises(CoarticError, match="no task 'general'"):
        printed.tests("general")


def test_derived_numbers():
    initial = [ENTRIES[f"{name}.initial"] for name in ("ascending", "descending")]
    assert [(e.number, e.rounding, e.derived) for e in initial] == [
        (-319, 1.0, True),
        (-333, 1.0, True),
    ]
    assert initial[0].formula == "ascending.EC1 - ascending.EC1-gain"
    rest = ENTRIES["two-armed-1.EC2-RRLR-runs"]
    assert (rest.number, rest.rounding, rest.derived) == (11, 0.0, True)
    learned = ENTRIES["descending.EC1-sd"]
    assert (learned.number, learned.rounding, learned.derived) == (1.88, 0.005, False)
    assert str(ENTRIES["two-armed-1.EC4-LRLR-sd"].value) == "2.0"


@pytest.mark.parametrize("name", TASKS)
def test_numbers_of_a_condition_fit_together(name):
    for found in of(name, Sequences):
        counts = {e.hands: e for e in of(name, Count) if e.condition == found.condition}
        assert set(counts) <= set(found.found)
        assert not counts or sum(e.number for e in counts.values()) == RUNS
        means = {e.hands: e for e in of(name, Reward) if e.condition == found.condition}
        assert set(means) - {None} <= set(found.found)
        if None in means and counts:
            shares = {hands: count.number / RUNS for hands, count in counts.items()}
            mean = sum(share * means[hands].number for hands, share in shares.items())
            error = sum(share * means[hands].rounding for hands, share in shares.items())
            assert abs(mean - means[None].number) <= error + means[None].rounding


def test_entries_refer_to_what_is_there():
    for entry in ENTRIES.values():
        assert set(entry.claims) <= set(CLAIMS), entry.id
        if entry.task is None:
            continue
        goals = len(load_task(entry.task).goals)
        named = [entry, getattr(entry, "than", entry)]
        assert all(len(e.hands) == goals for e in named if e.hands), entry.id
        numbers = [getattr(entry, key, None) or () for key in ("left", "right", "goals")]
        assert {*sum(numbers, ()), getattr(entry, "goal", None) or 1} <= set(range(1, goals + 1))
    judged = {name for entry in ENTRIES.values() for name in entry.claims}
    assert len(judged) > 15


ROW = """
[own.a]
kind = "reward"
role = "test"
quote = ""
place = ""
"""


def test_rows_that_are_refused():
    (entry,) = parse_entries(f"{ROW}value = -3.50").values()
    assert (entry.id, entry.task, entry.digits, entry.number) == ("own.a", "own", 2, -3.5)
    assert math.isclose(entry.rounding, 0.005)
    for rest in ("", "value = -3\nsaid = 1", 'value = -3\nhands = "RX"'):
        with pytest.raises(ValidationError):
            parse_entries(ROW + rest)
    with pytest.raises(ValidationError, match="does not match any of the expected tags"):
        parse_entries(ROW.replace("reward", "praise"))
    for names in (["b", "a"], ["a"], ["b", "c"]):
        with pytest.raises(ValueError, match="two printed numbers"):
            parse_entries(f"{ROW}difference_of = {names}")
