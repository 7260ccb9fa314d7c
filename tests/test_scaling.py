"""How cost grows: the tasks that are measured, and what is fitted."""

import pytest

from coartic.benchmarks import scaling
from coartic.benchmarks.scaling import GOALS, JOINTS, exponent, instances, measured


def test_every_size_has_an_instance_of_that_size():
    found = list(instances(1))
    assert [(what, size) for what, size, _ in found] == [
        *(("goals", size) for size in GOALS), *(("joints", size) for size in JOINTS),
    ]  # fmt: skip
    for what, size, task in found:
        assert size == (len(task.goals) if what == "goals" else task.robot.dof)
        assert task.split == "development"


def test_the_exponent_of_a_power_is_found():
    assert exponent([2, 4, 8], [3 * size**2.5 for size in (2, 4, 8)]) == pytest.approx(2.5)


def test_what_is_measured_finds_movements_and_bounds(monkeypatch):
    monkeypatch.setattr(scaling, "NODES", 60)
    task = next(iter(instances(1)))[2]
    runs = measured()
    planned = runs["posture-based/two-goals"](task)
    assert planned is not None
    assert planned == runs["posture-based/two-goals, every sequence"](task)
    assert runs["proof, 60 cone programmes"](task) is None
