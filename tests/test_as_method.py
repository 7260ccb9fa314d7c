"""Parameters that name a method: ``sequence``, ``hands`` and ``until`` as another method ends."""

from dataclasses import replace

import pytest

from coartic import PAPER, CoarticError, MotionModel, NotApplicableError, learn, load_task
from coartic.analysis import contrast, load
from coartic.analysis.standings import standings
from coartic.baselines.cma_es import CMAES
from coartic.baselines.hill_climbing import HillClimbing
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_again, some_runs
from coartic.benchmarks.runner import perform
from coartic.method import MethodError, built_in_methods, run_method
from coartic.motion.solution import hands_in
from coartic.runs.plan import cell_of
from tests.support.strategies import failing_task
from tests.support.suites import InProcess

TASKS = ["two-armed/v1/i000", "long/v1/i001"]
RIVAL, LEARNER = "policy-gradient", "dual-process/EC4"


def solve(name, task, seed=3, trials=200, model=PAPER, **parameters):
    method = built_in_methods()[name]
    return run_method(
        method(method.Parameters(trials=trials, **parameters)), task, seed, model=model
    )


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize(
    ("name", "parameter"),
    [("hill-climbing", "sequence"), ("policy-gradient", "sequence"), ("cma-es/bandit", "sequence"),
     (LEARNER, "sequence"), ("random-search", "hands")],
)  # fmt: skip
def test_a_method_takes_the_hands_in_which_another_ends(task, name, parameter, noise):
    """The run is the one with these hands written out, and the other's trials are beside it."""
    model, other = MotionModel(motor_noise=noise), LEARNER if name == RIVAL else RIVAL
    answer, of_other = solve(other, task, model=model)
    hands = hands_in(answer.solution)
    result, session = solve(name, task, model=model, **{parameter: f"as {other}"})
    known, alike = solve(name, task, model=model, **{parameter: hands})
    assert session.rewards == alike.rewards
    assert session.meter.trials == 200
    assert hands_in(result.solution) == hands_in(known.solution) == hands
    ticks = None if noise else -max(filter(None, of_other.rewards))
    assert result.details["as"] == {other: {"trials": 200, "hands": hands, "ticks": ticks}}


def test_the_learner_with_given_hands_explores_none():
    """Its first trial is the corrective process with these hands."""
    result, session = solve(LEARNER, "two-armed-1", sequence="LRLR")
    assert session.rewards[0] == -532
    assert {movement.hand for movement in result.initial} == {"left", "right"}
    assert hands_in(result.solution) == "LRLR"
    assert session.meter.initial_trials == 0
    with pytest.raises(NotApplicableError, match="EC1 uses only the right hand"):
        solve("dual-process/EC1", "two-armed-1", sequence="LRLR")
    with pytest.raises(ValueError, match="LR"):
        solve(LEARNER, "two-armed-1", sequence="LR")


@pytest.mark.parametrize("seed", range(4))
def test_the_learner_stops_at_equal_saving(seed):
    """By hand: the first trial of the whole run that takes no more ticks than the other's."""
    task = "one-armed/v1/i002"
    _, other = solve("random-search", task, seed)
    ticks = -max(reward for reward in other.rewards if reward is not None)
    whole = learn(task, "EC1", seed=seed, trials=200)
    better = [k for k, reward in enumerate(whole.rewards) if reward >= -ticks]
    stop = min(better, default=199)
    result, session = solve("dual-process/EC1", task, seed, until="as random-search")
    assert session.rewards == whole.rewards.tolist()[: stop + 1]
    assert result.details["reached"] is bool(better)
    again, alike = solve("dual-process/EC1", task, seed, until=ticks)
    assert (alike.rewards, again.details["reached"]) == (session.rewards, bool(better))
    never, all_made = solve("dual-process/EC1", task, seed, until=10)
    assert all_made.rewards == whole.rewards.tolist()
    assert never.details["reached"] is False


@pytest.mark.parametrize(
    ("name", "parameters", "error", "words"),
    [
        ("hill-climbing", {"sequence": "as cma"}, ValueError, "method 'cma' is unknown"),
        (LEARNER, {"until": "random"}, ValueError, "until is 'random'; it must be a number of"),
        (LEARNER, {"until": "as random"}, ValueError, "did you mean 'random-search'"),
        ("dual-process/EC4-subtask", {"until": 200}, ValueError, "its best trial"),
        (LEARNER, {"until": 200, "model": MotionModel(motor_noise=0.01)}, NotApplicableError,
         "without motor noise"),
        (LEARNER, {"sequence": "as posture-qp/goals-ahead", "model": MotionModel(base_weight=2.0)},
         NotApplicableError, "sequence is 'as posture-qp/goals-ahead', but model.base_weight"),
        (LEARNER, {"sequence": "as dual-process/EC1"}, NotApplicableError, "has no right hand"),
    ],
)  # fmt: skip
def test_what_cannot_be_named_is_refused(name, parameters, error, words):
    task = load_task("two-armed-1")
    if "EC1" in str(parameters):
        task = failing_task(goals=((1.5, 0.1),), hands="L").model_copy(update={"hands": ("left",)})
        name = "hill-climbing"
    with pytest.raises(error, match=words):
        solve(name, task, **parameters)


def test_a_run_fails_where_the_named_method_does():
    with pytest.raises(MethodError, match="sequence is 'as hill-climbing', which finds no answer"):
        solve("cma-es/bandit", failing_task(hands="L"), sequence="as hill-climbing", trials=1)


def test_the_version_of_the_named_method_is_a_part_of_ids(monkeypatch):
    task, method = load_task("ascending"), built_in()["hill-climbing"]
    first = cell_of(task, method, {"sequence": "as cma-es/bandit"})
    plain = cell_of(task, method, {"sequence": "R" * len(task.goals)})
    assert (first.named, plain.named) == ({"cma-es/bandit": built_in()["cma-es/bandit"].code}, {})
    monkeypatch.setattr(CMAES, "version", CMAES.version + 1)
    second = cell_of(task, method, {"sequence": "as cma-es/bandit"})
    assert first.digest != second.digest
    assert replace(second, named=first.named).digest == first.digest
    monkeypatch.setattr(HillClimbing, "title", "other")
    assert cell_of(task, method, {"sequence": "R" * len(task.goals)}).digest == plain.digest


SUITE = """title = "Same hands"
description = "Methods in each other's hands."
runs = 3
trials = 60

[[blocks]]
tasks = ["two-armed/v1/i000..i006"]
methods = ["random-search", "EC4"]

[[blocks]]
tasks = ["two-armed/v1/i000..i006"]
methods = ["EC4"]
parameters = { sequence = "as random-search" }
as = "learner, same hands"

[[blocks]]
tasks = ["two-armed/v1/i000..i006"]
methods = ["EC4"]
parameters = { until = "as random-search" }
as = "learner, equal saving"

[[contrasts]]
name = "equal-saving"
says = "At equal saving the learner turns its arm further."
quantity = "saved"
weights = { "learner, equal saving" = 1, "random-search" = -1 }
"""


def test_a_suite_with_named_methods(tmp_path):
    """Runs are stored, read back and made again; one that never saves as much does not count."""
    path = tmp_path / "hands.toml"
    path.write_text(SUITE)
    folder = tmp_path / "folder"
    perform(plan_suite(path), folder, executor=InProcess())
    study = load(folder)
    runs = study.runs.set_index(["called", "method", "task", "run"]).sort_index()
    searched = runs.loc["", "random-search"]
    assert (runs.loc["learner, same hands", LEARNER].hands == searched.hands).all()
    stopped = runs.loc["learner, equal saving", LEARNER]
    good = stopped.reached.astype(bool)
    assert 0 < good.sum() < len(good)
    assert (stopped.reward[good] >= searched.reward[good]).all()
    assert (stopped.reward[~good] < searched.reward[~good]).all()
    assert (stopped.trials[~good] == 60).all()
    assert runs.reached[runs.reached.isna()].size == 3 * 7 * 3
    (row,) = study.contrasts[study.contrasts.family == "two-armed/v1"].itertuples()
    all_reached = good.groupby("task").all()
    assert (row.n, row.not_applicable) == (all_reached.sum(), (~all_reached).sum())
    notes = standings(study).note
    assert notes["learner, same hands"].startswith("takes its hands from runs of random-search")
    assert f"; {(~good).sum()} runs never took so few ticks" in notes["learner, equal saving"]
    again = contrast(study, "ticks", {"learner, same hands": 1})
    assert again.n.tolist()[0] == 7
    stored = some_runs(folder, 30, built_in())
    assert len(stored) == 30
    assert [differences for _, differences in compare_again(stored[::6], built_in())] == [[]] * 5


def test_a_suite_refuses_what_cannot_be_named(tmp_path):
    path = tmp_path / "hands.toml"
    path.write_text(SUITE.replace('"as random-search" }\nas = "learner, s', '"as a" }\nas = "s'))
    with pytest.raises(CoarticError, match="method 'a' is unknown"):
        plan_suite(path)
    path.write_text(f"model = {{ motor_noise = 0.01 }}\n{SUITE}")
    with pytest.raises(CoarticError, match="until needs a world without motor noise"):
        plan_suite(path)
