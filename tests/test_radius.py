"""The radius of the goals as a constant of the world."""

import pytest

from coartic import (
    PAPER,
    CoarticError,
    MotionModel,
    NotApplicableError,
    execute,
    learn,
    load_task,
    objective,
)
from coartic.analysis import contrast, load
from coartic.analysis.verify import check_runs
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.runner import perform
from coartic.method import built_in_methods, run_method
from coartic.motion.solution import corrective_movements
from coartic.pictures.trajectories import trajectory
from coartic.runs.plan import cell_of
from coartic.runs.record import movement_data
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import in_world
from tests.support.suites import InProcess

SMALL = MotionModel(radius=0.05)


def with_radius(name, radius=0.05):
    """The task that a task file with this radius would give."""
    return load_task(name).model_copy(update={"radius": radius})


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(
    ("name", "task"),
    [("dual-process/EC4", "two-armed-1"), ("random-search", "two-armed-1"),
     ("hill-climbing", "ascending"), ("cma-es/bandit", "ascending"),
     ("policy-gradient", "ascending"), ("posture-qp/goals-ahead", "two-armed-1"),
     ("posture-based/two-goals", "ascending"), ("trajectory-optimisation/path-length", "ascending"),
     ("corrective-alone/best-hands", "two-armed-2"), ("receding-horizon", "ascending")],
)  # fmt: skip
def test_a_run_is_that_of_a_task_with_this_radius(name, task, noise):
    method = built_in_methods()[name]
    trials = {"trials": 60} if "trials" in method.Parameters.model_fields else {}
    parameters = method.Parameters(**trials, **method.quick)
    results = []
    for of, model in (
        (task, SMALL._replace(motor_noise=noise)),
        (with_radius(task), MotionModel(motor_noise=noise)),
    ):
        result, session = run_method(method(parameters), of, 4, model=model)
        results.append((session.rewards, [*map(movement_data, result.solution)]))
    assert results[0] == results[1]


def test_functions_of_a_task_take_its_radius_from_the_world():
    small, model = with_radius("ascending"), SMALL
    alone = corrective_movements("RRR")
    assert execute("ascending", alone, model=model) == execute(small, alone)
    assert execute("ascending", alone, model=model).ticks > execute("ascending", alone).ticks
    run, other = (learn(*each, seed=1, trials=40, model=m) for each, m in (
        (("ascending", "EC1"), model), ((small, "EC1"), PAPER)))  # fmt: skip
    assert run.rewards.tolist() == other.rewards.tolist()
    cost, alike = objective("ascending", model=model), objective(small)
    assert cost(cost.x0) == alike(alike.x0)
    assert trajectory("ascending", alone, model).task.radius == 0.05
    assert in_world(small, model) is small


def test_the_own_radius_is_no_other_world():
    task, method = load_task("ascending"), built_in()["random-search"]
    own, none, other = (
        cell_of(task, method, {}, model=MotionModel(radius=radius)) for radius in (0.1, None, 0.05)
    )
    assert (own, own.id, own.world) == (none, none.id, "")
    assert other.world == "radius=0.05"
    assert other.id != none.id
    assert other.task == task
    assert other.arena.radius == 0.05
    assert other.model.arrival_tolerance == pytest.approx(0.005)
    assert "radius" not in none.content["model"]


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan"), "0.1", True, 1e7])
def test_wrong_radii_are_refused(radius):
    with pytest.raises((TypeError, ValueError), match=r"model\.radius"):
        execute("ascending", corrective_movements("RRR"), model=MotionModel(radius=radius))


def test_a_tolerance_must_fit_the_radius():
    with pytest.raises(ValueError, match=r"goals' radius 0\.05"):
        learn("ascending", "EC1", seed=0, trials=2, model=SMALL._replace(correction_tolerance=0.06))


SUITE = """title = "Small goals"
description = "Goals of several sizes."
runs = 2
trials = 30
model = { radius = [0.02, 0.1, 0.3] }

[[blocks]]
tasks = ["one-armed/v1/i000..i006"]
methods = ["random-search", "EC1", "corrective-alone/given"]

[[contrasts]]
name = "smaller"
says = "Smaller goals take more ticks."
quantity = "ticks"
weights = [
    { method = "learner", world = "radius=0.02", weight = 1 },
    { method = "learner", world = "", weight = -1 },
]
expected = "above 0"
"""


def test_a_suite_of_radii(tmp_path):
    """Run, stored, read, verified, ranked by the best of the folder, and asked about."""
    path, folder = tmp_path / "sizes.toml", tmp_path / "folder"
    path.write_text(SUITE)
    plan = plan_suite(path)
    assert {job.cell.world for job in plan} == {"radius=0.02", "", "radius=0.3"}
    perform(plan, folder, executor=InProcess())
    study = load(folder)
    assert [*study.worlds] == ["", "radius=0.02", "radius=0.3"]
    small = study.worlds["radius=0.02"]
    assert {task.radius for task in small.tasks.values()} == {0.02}
    assert set(small.runs.radius) == {0.02}
    assert set(study.worlds[""].runs.radius) == {0.1}
    for task in small.tasks:
        (known,) = small.runs[small.runs.task == task].best_known.unique()
        assert known == small.runs[small.runs.task == task].reward.max()
        assert best_shipped(small.tasks[task], small.models[task]) is None
    hits = [small.executed(task, "dual-process/EC1") for task in small.tasks]
    assert len(hits) == 7
    (row,) = study.contrasts[study.contrasts.family == "one-armed/v1"].itertuples()
    ticks = -study.runs[study.runs.label == "dual-process/EC1"].pivot_table(
        values="value", index="task", columns="world"
    )
    assert (row.n, row.yes) == (7, int((ticks["radius=0.02"] > ticks[""]).sum()))
    assert contrast(study.worlds[""], "gap", {"learner": 1}).n.iloc[0] == 7
    report = check_runs(folder)
    assert (report.runs, report.wrong) == (len(study.runs), [])


def test_methods_of_any_information_run_in_a_world_of_another_radius():
    for method in built_in_methods().values():
        assert method.refuses(SMALL) is None
    with pytest.raises(NotApplicableError, match="base_weight"):
        run_method(
            built_in_methods()["posture-qp/goals-ahead"](), "ascending",
            model=SMALL._replace(base_weight=2.0),
        )  # fmt: skip


def test_a_wrong_radius_in_a_suite_is_refused(tmp_path):
    path = tmp_path / "sizes.toml"
    path.write_text(SUITE.replace("[0.02, 0.1, 0.3]", "[0.0]"))
    with pytest.raises(CoarticError, match=r"model\.radius is 0\.0"):
        plan_suite(path)
