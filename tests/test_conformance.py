"""The conformance kit: every built-in method passes, every broken one fails its law."""

import re
from concurrent.futures import ProcessPoolExecutor

import pytest

from coartic import corrective_trial, load_task
from coartic.benchmarks import conformance, reproduce
from coartic.benchmarks.conformance import check_method, check_task_file
from coartic.benchmarks.processes import CONTEXT
from coartic.benchmarks.registry import registry
from coartic.benchmarks.worker import perform_job
from coartic.method import Information, Session
from coartic.runs.plan import Job
from coartic.tasks.task import TASK_FOLDER
from tests.support.strategies import shipped_optima, tiny_task
from tests.support.suites import BROKEN, InProcess, cell_on
from tests.support.suites import KNOWN as BUILT_IN

pytestmark = pytest.mark.process

OPTIMUM = {
    entry.task: entry.reward
    for entry in shipped_optima()
    if (entry.other_arm, entry.base) == ("free", "task")
}
TRIALS = 30
"""Half of what a contributor's check makes: enough to learn something, and more than a budget
allows. Where none succeeds, each takes as long as it may."""
FEW_TASKS = [load_task("ascending"), tiny_task()]
"""For what breaks a law."""
ONE_GOAL = [tiny_task(name="near", goals=[[4.5, 1.0]], hands=["right"])]
"""For searches that take seconds on any shipped task; tests/test_optimum.py has those."""
TWO_GOALS = [tiny_task(hands=["right"]), *ONE_GOAL]
"""For programmes that are solved for one goal in another way."""
TASKS = {
    "optimum/": ONE_GOAL,
    "receding-horizon": TWO_GOALS,
    "cma-es/bandit": FEW_TASKS,  # of both hands, as it chooses among hand sequences
    "nullspace-qp/": FEW_TASKS,
    "posture-qp/": TWO_GOALS,
    "posture-based/": TWO_GOALS,
    "trajectory-optimisation/": ONE_GOAL,
}
"""What some methods are checked on, the first that fits; the others on a task for one hand and one
for both."""


@pytest.fixture(scope="module")
def methods():
    return registry([BROKEN])


@pytest.fixture(scope="module")
def another_process(methods):
    """One for all methods, from the server that the processes of their file come from: each of them
    would take long to begin its."""
    with ProcessPoolExecutor(1, mp_context=CONTEXT) as pool:
        yield pool


@pytest.fixture(autouse=True)
def quick_checks(monkeypatch, another_process):
    """Of few trials, not executed with noise, which no law is about; all runs of a check are here
    but the one that is to be in another process, for methods that draw nothing:
    tests/test_versions.py has a run of each other one."""

    class HereAndThere(InProcess):
        def perform(self, jobs, **options):
            here = len(jobs) > 1 or jobs[0].cell.method.stochastic
            answers = (map if here else another_process.map)(perform_job, jobs)
            yield from reversed([*zip(jobs, answers, strict=True)])  # as they may finish

    monkeypatch.setattr(conformance, "CHECK_TRIALS", TRIALS)
    monkeypatch.setattr(reproduce, "Local", HereAndThere)


@pytest.mark.parametrize("name", [*BUILT_IN, "test/good"])
def test_methods_that_keep_every_law(methods, name):
    every = [load_task(task) for task in ("ascending", "two-armed-1")]
    tasks = next((few for kind, few in TASKS.items() if name.startswith(kind)), every)
    laws = check_method(methods[name], tasks=tasks)
    assert {law.name for law in laws} == {law for _, law, _ in CASES}
    assert [law for law in laws if not law.passed] == []
    if name in BUILT_IN:
        (failure,) = (law.finding for law in laws if law.name == "failure")
        assert "gives infeasible: " in failure or "does not apply" in failure
    # And no method beats the optimum.
    (rewards,) = (law.finding for law in laws if law.name == "solution")
    printed = re.findall(r"([a-z0-9-]+) (-\d+)", rewards)
    assert printed
    assert all(int(reward) <= OPTIMUM.get(task, -1) for task, reward in printed)


def outcome_of(method, **parameters):
    """The outcome of a run on task ``ascending``."""
    (outcome,) = perform_job(Job(cell_on(load_task("ascending"), method, **parameters), 0, (0,)))
    return outcome


def test_what_a_session_shows_cannot_be_written():
    task = load_task("ascending")
    session = Session(task, 0, Information)
    session.trial(corrective_trial(task, "RRR").movements)
    session.meter.trials = 0
    session.rewards.append(10**6)
    session.q0[:] = 9.0
    with pytest.raises(
        ValueError, match="counter 'trials' cannot be added to by this method; it may add to"
    ):
        session.spend(trials=-1)
    assert (session.meter.trials, session.rewards) == (1, [-319])
    assert session.q0.tolist() == task.q0.tolist()


OUTSIDE = {
    "objective": 6, "learn": 9, "execute": 1, "session": 4, "initial hands": 1,
    "environment in a thread": 1,
}  # fmt: skip
"""Trials that each way around a session makes, in every run."""


@pytest.mark.parametrize("means", OUTSIDE)
def test_trials_outside_the_session_stop_a_run(methods, means):
    """Those of an objective too, which has a session, but not the one of the run."""
    if "environment" in means:
        pytest.importorskip("gymnasium")
    outcome, again = (outcome_of(methods["test/outsider"], means=means) for _ in range(2))
    assert outcome.status == "crashed"
    assert again.reason == outcome.reason
    made = "1 trial" if OUTSIDE[means] == 1 else f"{OUTSIDE[means]} trials"
    assert f"made {made} outside its session" in outcome.reason


CASES = [
    ("test/uncited", "declaration", "citation is empty"),
    ("test/loose", "parameters", "an unknown parameter is accepted"),
    ("test/unexecutable", "solution", "movements for goals [1]; it must"),
    ("test/random", "determinism", "same seed on ascending, same process: details"),
    ("test/local", "determinism", "same seed on tiny, another process: details"),
    ("test/remembers", "no hidden state", "after other runs, ascending with the same seed"),
    ("test/spendthrift", "limits", "BudgetError: the budget of 7 trials is spent"),
    ("test/peeks", "solution", "the method used 'Jacobian', which it does not declare"),
    ("test/overdeclares", "information", "not used: Jacobian"),
    ("test/taker", "solution", "reveal is for this project's own compiled methods"),
    ("test/freeloader", "solution", "used 'corrective process', which it does not declare"),
    ("test/lucky", "determinism", "stochastic is False, but another seed"),
    ("test/unhelpful", "failure", "ZeroDivisionError: no goal is that far"),
    ("test/timid", "motor noise", "on ascending, with motor noise 0.01: crashed: "),
]


@pytest.mark.parametrize(("name", "law", "finding"), CASES)
def test_each_law_can_be_broken(methods, name, law, finding):
    laws = {each.name: each for each in check_method(methods[name], tasks=FEW_TASKS)}
    assert laws[law].passed is False
    assert finding in laws[law].finding
    # What is found after a solution that failed would mislead.
    later = [*laws.values()][[*laws].index("solution") + 1 :]
    assert {each.passed is None for each in later} == {law == "solution"}


@pytest.mark.parametrize(
    ("name", "is_best_trial"),
    [("test/proud", True), ("random-search", True), ("cma-es/bandit", False),
     ("hill-climbing", False), ("dual-process/EC4", False), ("test/good", False)],
)  # fmt: skip
def test_whoever_answers_a_lucky_trial_is_told(methods, name, is_best_trial):
    tasks = [load_task(task) for task in ("ascending", "two-armed-1")]
    tasks = [task for task in tasks if methods[name].inapplicable_reason(task) is None]
    laws = {each.name: each for each in check_method(methods[name], tasks=tasks)}
    assert laws["motor noise"].passed
    assert ("seems to be its best trial" in laws["motor noise"].finding) == is_best_trial


@pytest.mark.parametrize("path", sorted(TASK_FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_tasks_keep_every_law(methods, path):
    assert [law for law in check_task_file(path, methods) if not law.passed] == []


@pytest.mark.parametrize(
    ("text", "law", "finding"),
    [
        ("name = 1", "valid", "name is 1"),
        (
            'goals = [[20, 20]]\nlocked_base = ["x", "y"]\nhands = ["right"]\n'
            "[robot]\nright_links = [20, 20]\nleft_links = [1]\n"
            "[start]\nright = [0.5, 0.5]\nleft = [0]\n",
            "solvable",
            "did not converge",
        ),
        (
            # Beyond what the corrective process can do with the only hand there is.
            'name = "behind"\nlocked_base = ["x", "y"]\nhands = ["right"]\n'
            "goals = [[-2.0, 0.1], [2.0, 2.0]]",
            "solvable",
            "did not converge",
        ),
    ],
)
def test_laws_of_a_task_file(methods, text, law, finding, tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(text, encoding="utf-8")
    laws = {each.name: each for each in check_task_file(path, methods)}
    assert finding in laws[law].finding
    assert not laws[law].passed
