"""Families of random tasks: what is drawn, what is rejected, and that it stays."""

import hashlib
import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coartic import TaskError, corrective_trial, load_task
from coartic.benchmarks.runner import run_suite
from coartic.internal.limits import MAX_CELLS
from coartic.tasks import families
from coartic.tasks.families import (
    FAMILY_FOLDER,
    MAX_ATTEMPTS,
    broken_rule,
    draft,
    instance,
    instance_of,
    load_family,
    named_by,
    shipped_families,
)
from coartic.tasks.task import Address, address_of, task_text
from tests.support.processes import at_release

addresses = st.builds(
    Address,
    st.sampled_from(sorted(shipped_families())),
    st.sampled_from(["d", "i", "2027-", "1999-"]),
    st.integers(0, 999_999),
)


FAMILIES = {
    "aligned/v1": "7d54471d916711ce",
    "long/v1": "f1f48d64e2a1d1ee",
    "many-goals/v1": "431e6d2a591657a2",
    "one-armed/v1": "85c1cafe81ce2bc4",
    "redundancy/v1": "74dc928d21a32f17",
    "two-armed/v1": "3c581b274307a7ab",
}
"""Maps released families to their hashes (``family_hash``). A family never changes, because
results on tasks of the same name would not be comparable. A family with another distribution gets a
new version."""


def family_hash(name: str) -> str:
    """Return a hash (16 hex digits) of a family and a task of each split."""
    family = json.dumps(shipped_families()[name].model_dump(mode="json"), sort_keys=True)
    drawn = [task_text(instance(f"{name}/{number}")) for number in ("i017", "d003", "2027-041")]
    return hashlib.sha256("".join([family, *drawn]).encode()).hexdigest()[:16]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_released_family_and_its_instances_are_not_changed(name):
    assert family_hash(name) == FAMILIES[name], "leave it, and add a family of another version"


@at_release
def test_each_family_has_its_hash():
    new = {name: family_hash(name) for name in shipped_families() if name not in FAMILIES}
    assert not new, f"add to FAMILIES: {new}"


@given(addresses)
def test_every_instance_is_valid(address):
    task, family = load_task(str(address)), shipped_families()[address.family]
    assert (task.family, task.name) == (address.family, str(address))
    assert family.goals[0] <= len(task.goals) <= family.goals[1]
    assert corrective_trial(task, task.initial_hands).completed
    figures = [v for goal in task.goals for v in goal] + [*task.start.left, *task.start.right]
    assert all(round(figure, 3) == figure for figure in figures)
    for hand in task.hands:
        links = task.robot.left_links if hand == "left" else task.robot.right_links
        assert math.fsum(links) == pytest.approx(4.0, abs=1e-12)
        assert family.links[0] <= len(links) <= family.links[1]
    drafts = (draft(family, address, attempt) for attempt in range(MAX_ATTEMPTS))
    first = next(draft for draft in drafts if broken_rule(family, draft) is None)
    assert (first.goals, first.start, first.robot) == (task.goals, task.start, task.robot)


FAMILY = load_family("two-armed/v1")
GOOD = load_task("two-armed/v1/i016")
STRAIGHT = GOOD.start.model_copy(update={"left": (0.0,) * 4, "right": (0.0,) * 4})
ALONG = ((2.5, 0.1), (3.0, 0.1))  # on the line of straight arms, which cannot bend to them


def of_family(**changes):
    return FAMILY.model_copy(update=changes)


def with_goal(index, goal):
    goals = list(GOOD.goals)
    goals[index] = goal
    return GOOD.model_copy(update={"goals": tuple(goals)})


def with_base(task, *locked):
    return task.model_copy(update={"locked_base": locked})


def with_left(*angles):
    return GOOD.model_copy(update={"start": GOOD.start.model_copy(update={"left": angles})})


HAND = GOOD.robot.forward_kinematics(GOOD.q0, "right")
STRAIGHT_ALONG = GOOD.model_copy(
    update={"initial_hands": "best-single-hand", "start": STRAIGHT, "goals": ALONG}
)
TALL = of_family(region=FAMILY.region.model_copy(update={"y": (-9000, 9000)}))
JUDGED = [
    (FAMILY, GOOD, None),
    # The nearest figures that are let in, and those a thousandth beyond.
    (FAMILY, with_goal(1, (7.0, 0.0)), None),
    (FAMILY, with_goal(1, (7.001, 0.0)), "outside"),
    (FAMILY, with_goal(1, (5.363, -0.303)), None),
    (FAMILY, with_goal(1, (5.362, -0.303)), "overlap"),
    (TALL, with_base(with_goal(1, (3.888, 3.9)), "y"), None),  # shoulders at 0.1, reach 3.8
    (TALL, with_base(with_goal(1, (3.888, 3.901)), "y"), "reach"),
    (FAMILY, with_left(1.8, 0.2, -0.199, 0.0), None),
    (FAMILY, with_left(1.8, 0.199, -0.199, 0.0), "straight"),
    (FAMILY, with_goal(2, (round(HAND[0] + 0.29, 3), round(HAND[1], 3))), "start-hit"),
    # Restrictions count as well. With a free base straight arms come to these goals, with a locked
    # one they never do.
    (FAMILY, with_goal(1, (6.0, 0.0)), None),
    (of_family(restrictions=("locked",)), with_goal(1, (6.0, 0.0)), "reach"),
    (of_family(bent=0), STRAIGHT_ALONG, None),
    (of_family(bent=0), with_base(STRAIGHT_ALONG, "x", "y"), "corrective"),
    (of_family(bent=0, restrictions=("locked",)), STRAIGHT_ALONG, "corrective"),
]


def test_each_rule_rejects_what_it_says():
    assert [broken_rule(family, task) for family, task, _ in JUDGED] == [r for *_, r in JUDGED]
    rules = {"outside", "overlap", "reach", "straight", "start-hit", "corrective"}
    assert {rule for *_, rule in JUDGED} == {*rules, None}


def test_splits_share_no_instance():
    ranges = ("d000..d024", "i000..i024", "2027-000..2027-024", "2028-000..2028-024")
    tasks = [[instance(name) for name in named_by(f"two-armed/v1/{each}")] for each in ranges]
    splits = [{task.split for task in each} for each in tasks]
    assert splits == [{"development"}, {"test"}, {"fresh"}, {"fresh"}]
    assert len({task.goals for each in tasks for task in each}) == 100


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("long/v1/i003..i001", "goes backwards"),
        (f"long/v1/i000..i{MAX_CELLS}", "names more than 10,000 instances"),
        ("long/v1/i000..d003", "is not a range of instances"),
    ],
)
def test_ranges(text, words):
    due = [f"long/v1/2027-{n}" for n in ("008", "009", "010", "011")]
    assert named_by("long/v1/2027-008..2027-011") == due
    with pytest.raises(TaskError, match=words):
        named_by(text)


def test_a_family_that_cannot_be_met_ends(monkeypatch):
    monkeypatch.setattr(families, "MAX_ATTEMPTS", 20)
    message = "20 draws of family 'two-armed/v1' broke a rule, 20 of them 'overlap'"
    with pytest.raises(TaskError, match=message):
        instance_of(of_family(apart=99_000), address_of("two-armed/v1/i000"))


def test_a_family_of_a_file_is_named_by_its_path(tmp_path, monkeypatch, coartic, ranked):
    """Where a family is named; an instance of it where a task is named."""
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    (tmp_path / "mine.v1.toml").write_text((FAMILY_FOLDER / "two-armed.v1.toml").read_text())
    path = "../mine.v1.toml"
    task = load_task(f"{path}/i001")
    address = address_of("mine/v1/i001")
    assert task == instance_of(load_family(path), address)
    assert task.goals != load_task("two-armed/v1/i001").goals  # numbers come from its name
    with pytest.raises(TaskError, match="rename the file"):
        run_suite("quick", "out", family_files=[FAMILY_FOLDER / "one-armed.v1.toml"])
    assert named_by(f"{path}/i000..i001") == [f"{path}/i000", f"{path}/i001"]
    for name in (path, Path(path)):
        with pytest.raises(TaskError, match="is a family: name an instance, such as .*toml/i000"):
            load_task(name)
    asked = ("--tasks", f"{path}/i000..i001", "--methods", "EC4", "--runs", 1, "--trials", 5)
    code, text, _ = coartic("run", "paper", *asked, "--out", "out")
    assert (code, text[:5]) == (0, "2 run")
