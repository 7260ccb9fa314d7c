"""Plans: every option of a request changes the plan, or is refused; so does every name."""

from pathlib import Path

import pytest

from coartic import CoarticError, load_task
from coartic.benchmarks import include, runner, template
from coartic.benchmarks.planning import plan, plan_suite, request_for
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import load_suite
from coartic.runs.plan import tasks_by_name
from tests.support.suites import ROOT, suite_of

MINE = Path(template.__file__).read_text(encoding="utf-8")
FAMILY = (ROOT / "coartic" / "tasks" / "families" / "long.v1.toml").read_text(encoding="utf-8")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a method file of two methods and a family file."""
    monkeypatch.chdir(tmp_path)
    second = MINE[MINE.index("class Mine(") :].replace("class Mine(", "class Second(")
    both = MINE.replace("NAME", "first") + "\n\n" + second.replace("NAME", "second")
    Path("mine.py").write_text(both, encoding="utf-8")
    Path("strips.v1.toml").write_text(FAMILY, encoding="utf-8")


@pytest.mark.usefixtures("here")
def test_tasks_and_methods_given_twice_add_up(coartic, monkeypatch):
    plans = []
    monkeypatch.setattr(runner, "perform", lambda plan, *_, **__: plans.append(plan) or exit())
    repeated = ("--tasks", "ascending", "--tasks", "two-armed-1,descending")
    repeated += ("--methods", "hill-climbing", "--methods", "random-search")
    coartic("run", "comparison", *repeated)
    cells = {(job.cell.task.name, job.cell.method.name) for job in plans[0]}
    assert len(cells) == 3 * 2


@pytest.mark.usefixtures("here")
def test_a_star_stands_for_the_methods_of_the_command():
    """So that ``--methods '*,optimum/search'`` adds the search, whatever the suite and files."""
    path = Path("g.toml")
    block = 'tasks = ["ascending"]\nmethods = ["hill-climbing", "dual-process/EC1"]'
    path.write_text(f'title = "G"\ndescription = "G."\nruns = 2\n[[blocks]]\n{block}', "utf-8")
    usual, more = (
        {job.cell.method.name for job in plan_suite(path, method_files=["mine.py"], **named)}
        for named in ({}, {"methods": ["*", "optimum/search"]})
    )
    assert usual == {"hill-climbing", "dual-process/EC1", "first", "second"}
    assert more == usual | {"optimum/search"}


TRIALS = {
    "a grid": 'methods = ["random-search"]\ngrid = {trials = [100, 800]}',
    "two blocks": 'methods = ["random-search"]\nparameters = {trials = 100}\n[[blocks]]\n'
    'tasks = ["ascending"]\nmethods = ["random-search"]\nparameters = {trials = 800}',
}


@pytest.mark.parametrize("compared", TRIALS)
def test_trials_do_not_make_one_cell_of_two(compared, tmp_path):
    path = tmp_path / "g.toml"
    text = f'tasks = ["ascending"]\n{TRIALS[compared]}'
    path.write_text(f'title = "G"\ndescription = "G."\nruns = 2\n[[blocks]]\n{text}', "utf-8")
    assert len(plan_suite(path)) == 2
    words = "trials is 60, but suite 'g' compares 100 with 800 trials of random-search on ascending"
    with pytest.raises(CoarticError, match=words):
        plan_suite(path, trials=60)
    assert len(plan_suite(path, trials=60, methods=["hill-climbing"])) == 1


OPTIONS = {
    "suite": ("quick",),
    "folder": ("--out", "other"),
    "runs": ("--runs", "3"),
    "trials": ("--trials", "21"),
    "tasks": ("--tasks", "descending"),
    "methods": ("--methods", "EC1,corrective-alone/given"),
    "method_file": ("--method-file", "mine.py"),
    "family_file": ("--family-file", "strips.v1.toml"),
    "seed": ("--seed", "1"),
    "model": ("--model", "motor_noise=0.01"),
    "time_limit": ("--time-limit", "5"),
    "trial_budget": ("--trial-budget", "7"),
    "include": ("--include", "before"),
    "jobs": ("--jobs", "97"),
    "scheduler": ("--scheduler", "127.0.0.1:1"),
}


@pytest.mark.usefixtures("here")
def test_a_second_value_of_an_option_of_run_changes_what_is_performed(
    coartic, commands, monkeypatch
):
    names = {parameter.name for parameter in commands.commands["run"].params}
    assert names - {"after"} == {*OPTIONS}  # it changes what is printed
    base = {"suite": ("paper",), "folder": ("--out", "out"), "tasks": ("--tasks", "ascending")}
    base |= {"methods": ("--methods", "EC1"), "runs": ("--runs", "2"), "trials": ("--trials", "20")}
    asked = []

    def perform(plan, folder, *, executor, watch):
        asked.append((plan, folder, vars(executor).get("address") or executor.workers))
        raise CoarticError("that is enough")

    monkeypatch.setattr(runner, "perform", perform)
    monkeypatch.setattr(include, "include_folders", lambda plan, *folders: (plan, folders))

    def told(**changed):
        words = [word for each in (base | changed).values() for word in each]
        error = coartic("run", *words)[2]
        return asked.pop() if asked else error

    usual = told()
    assert told() == usual
    for name, words in OPTIONS.items():
        answer = told(**{name: words})
        assert answer != usual, name
        assert isinstance(answer, str) == (name == "family_file"), answer
    assert "strips.v1.toml has no effect: " in told(family_file=OPTIONS["family_file"])
    both = {name: OPTIONS[name] for name in ("jobs", "scheduler")}
    assert "--jobs has no effect with --scheduler" in told(**both)


@pytest.mark.usefixtures("here")
def test_a_method_file_that_is_named_runs():
    registered = registry([Path("mine.py")])

    def methods(suite="paper", **selection):
        request = request_for(**{"tasks": ["ascending"]} | selection)
        return [job.cell.method.name for job in plan(load_suite(suite), request, registered)]

    assert methods() == ["dual-process/EC1", "first", "second"]
    assert methods(methods=["EC1"]) == ["dual-process/EC1", "first", "second"]
    assert methods(methods=["EC1", "second"]) == ["dual-process/EC1", "second"]
    assert methods(tasks=[load_task("ascending").model_copy(update={"name": "own"})]) == [
        "dual-process/EC1", "first", "second",
    ]  # fmt: skip
    Path("own.toml").write_text(
        'title = "x"\ndescription = "x"\nruns = 1\n[[blocks]]\ntasks = ["ascending"]\n'
        'methods = ["first"]\n'
    )
    assert methods("own.toml") == ["first"]


@pytest.mark.parametrize("trials", ["grid = { trials = [5] }", "parameters = { trials = 5 }"])
def test_the_command_outranks_a_grid_and_a_block(trials, tmp_path):
    suite_of(tmp_path, f'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n{trials}')
    (own,) = plan_suite(tmp_path / "own.toml")
    assert own.cell.parameters["trials"] == 5
    (job,) = plan_suite(tmp_path / "own.toml", trials=7)
    assert (job.cell.parameters["trials"], job.cell.trials, job.trials) == (7, 7, 7)


def test_a_trial_budget_limits_the_trials_that_are_asked_for(tmp_path):
    block = 'tasks = ["ascending"]\nmethods = ["hill-climbing", "corrective-alone/given"]\n'
    suite_of(tmp_path, block)  # of 30 trials
    for options, due in (({}, 30), ({"trial_budget": 20}, 20), ({"trial_budget": 40}, 30),
                         ({"trials": 50, "trial_budget": 40}, 40)):  # fmt: skip
        search, alone = plan_suite(tmp_path / "own.toml", **options)
        assert (search.trials, search.cell.trials, alone.cell.trials) == (due, due, None)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"methods": ["corrective-alone/given"], "trials": 5}, "trials has no effect"),
        ({"methods": ["corrective-alone/given"], "runs": 2}, "runs has no effect"),
        (
            {"methods": ["EC4"], "tasks": ["ascending", "two-armed-1"]},
            "no method runs on task 'ascending': EC4 uses the left",
        ),
        ({"runs": range(0, 9, 2)}, r"runs is range\(0, 9, 2\); it must be"),
        ({"runs": range(-1, 9)}, "its first run is -1"),
    ],
)
def test_what_has_no_effect_is_refused(options, words):
    with pytest.raises(CoarticError, match=words):
        plan_suite("paper", **{"tasks": ["ascending"]} | options)


def test_two_tasks_of_one_name_are_refused():
    task = load_task("ascending")
    assert [*tasks_by_name([task, load_task("ascending")]).values()] == [task]
    with pytest.raises(CoarticError, match="two tasks have the name 'ascending'"):
        tasks_by_name([task, task.model_copy(update={"radius": 0.2})])
