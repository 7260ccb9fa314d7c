"""Best known rewards: the shipped ones, and those of a folder's own runs."""

import json

from coartic import load_task
from coartic.analysis import optima
from coartic.tasks.optima import best_shipped
from tests.support.made_up import row, study_of


def test_the_best_known_is_of_all_runs_on_the_task_and_of_what_is_shipped():
    """Also of runs that are no search; not of a search on another base, nor of one method alone."""
    search = "optimum/search"

    def run(task, method, reward, setting="", **parameters):
        return row(method, reward, task=task, setting=setting,
                   run_id=f"{task} {reward}", parameters=json.dumps(parameters))  # fmt: skip

    rows = [
        run("ascending", search, -290),
        run("ascending", search, -200, base="xy"),  # another task
        run("descending", "other", -309),
        run("mine", search, -290),
        run("mine", "other", -288, setting="base=EC1", base="EC1"),  # of a learner, not the robot
        run("yours", "other", -290),  # to be compared with itself
        *(run("free", "one", -301), run("free", "one", -300, setting="b=2")),
    ]
    changed = [load_task("ascending").model_copy(update={"name": name, "radius": 0.2})
               for name in ("mine", "yours", "free")]  # fmt: skip
    study = study_of(rows, changed)
    tasks = [*study.tasks.values(), load_task("two-armed-2")]
    best = optima.best_known(study.stored, tasks)
    shipped = {name: best_shipped(load_task(name)) for name in ("descending", "two-armed-2")}
    assert {name: (b.reward, b.bound, b.source, b.run_id) for name, b in best.items()} == {
        "ascending": (-290, -292, search, "ascending -290"),
        **{name: (of.reward, of.bound, "shipped", "") for name, of in shipped.items()},
        "mine": (-288, None, "other base=EC1", "mine -288"),
        "free": (-300, None, "one b=2", "free -300"),
    }
    assert [name for name, each in best.items() if each.only_here] == ["free"]
    worse = study_of([run("free", "one", -900), run("free", "two", -900)], changed)
    found, alone = worse.optima["free"], worse.sequences("free").iloc[0]
    assert (found.reward, found.hands) == (alone.reward, alone.hands)
    assert (found.source, found.only_here) == ("corrective process alone", True)
    nothing = optima.best_known(study.stored.assign(status="timeout"), tasks)
    assert {name: each.reward for name, each in nothing.items()} == {
        name: best_shipped(load_task(name)).reward for name in ("ascending", *shipped)
    }
