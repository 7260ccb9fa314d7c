"""Run methods on the same tasks in ten worlds: the paper's, and worlds that differ in one constant.

    PYTHONPATH=studies python studies/worlds/protocols.py results/worlds
    PYTHONPATH=studies python studies/worlds/protocols.py results/development d000..d001

The results folder has a folder for each world, and beside it the suite that made it, with the task
files of worlds with another radius. Stored runs are not made again. Worlds are run one after the
other, in the order of :data:`worlds.WORLDS`, so that an interrupted study has whole worlds.
"""

import sys
from pathlib import Path

from worlds import CONTROL, CONTROL_SETS, INSTANCES, LONG, RUNS, RUNS_OF_PAIRS, WORLDS

from coartic import load_task
from coartic.benchmarks import run_suite
from coartic.benchmarks.pool import Local
from coartic.tasks.task import task_text
from people.protocols import pair

PAPER = ("ascending", "descending", "two-armed-1", "two-armed-2")
FAMILIES = ("one-armed", "two-armed", "aligned")
SEARCHES = ("random-search", "hill-climbing", "policy-gradient")
"""Methods of tasks with one arm and with two, beside the learner. CMA-ES has runs of its own."""


def numbers(instances):
    """Return the names of a range of instances, such as ``d000..d001``."""
    first, last = instances.split("..")
    return [f"{first[0]}{number:03d}" for number in range(int(first[1:]), int(last[1:]) + 1)]


def with_radius(task, name, radius):
    """Return a task whose goals have another radius."""
    return task.model_copy(update={"name": name, "radius": radius})


def blocks_of(world, folder, instances):
    """Return the blocks of a world's suite as TOML, and write its task files into a folder."""
    names, made = [*PAPER] if instances == INSTANCES else [], {}
    names += [f"{family}/v1/{number}" for family in FAMILIES for number in numbers(instances)]
    if world.radius is None:
        tasks = dict(zip(names, names, strict=True))
    else:
        tasks = {name: f"{name.replace('/v1/', '-')}-radius-{world.radius}" for name in names}
        made |= {new: with_radius(load_task(old), new, world.radius) for old, new in tasks.items()}
    pairs = []
    for number in numbers(instances):
        for task in pair(f"one-armed/v1/{number}"):
            made[task.name] = (
                task if world.radius is None else with_radius(task, task.name, world.radius)
            )
            pairs.append(task.name)
    folder.mkdir(parents=True, exist_ok=True)
    for name, task in made.items():
        (folder / f"{name}.toml").write_text(task_text(task), encoding="utf-8")
    places = {name: str(folder / f"{name}.toml") if name in made else name
              for name in (*tasks.values(), *pairs)}  # fmt: skip

    def block(which, methods, runs, more=""):
        paths = [places[name] for name in which]
        text = f"\n[[blocks]]\ntasks = {paths}\nmethods = {[*methods]}\nruns = {runs}\n{more}"
        return text.replace("'", '"')

    text = ""
    arms = {"EC1": ("ascending", "descending", "one-armed"),
            "EC4": ("two-armed-", "two-armed/", "aligned")}  # fmt: skip
    for condition, beginnings in arms.items():
        for of_paper in (True, False):
            which = [new for old, new in tasks.items()
                     if old.startswith(beginnings) and (old in PAPER) == of_paper]  # fmt: skip
            methods = (f"dual-process/{condition}", *SEARCHES)
            if world.trials > 10_000:
                methods = (methods[0], "random-search", "policy-gradient")
            if not which:
                continue
            runs = RUNS["paper"] if of_paper else RUNS["families"]
            if world.trials > 10_000:
                runs = 1 if not of_paper else 5
            text += block(which, methods, runs)
            text += block(which, ["cma-es/bandit"], runs if of_paper else 1)
            text += block(which, ["corrective-alone/best-hands"], 1)
    if world.trials == 10_000:
        text += block(pairs, ["dual-process/EC1", "random-search"], RUNS_OF_PAIRS)
    return text


def suite_of(world, folder, instances):
    """Return the suite of a world as TOML."""
    model = ", ".join(f"{key} = {value!r}" for key, value in world.model.items()).replace("'", '"')
    head = f'title = "{world.title}"\ndescription = "Methods in one world of study worlds."\n'
    head += f"runs = 1\ntrials = {world.trials}\n" + (f"model = {{ {model} }}\n" if model else "")
    return head + blocks_of(world, folder / "tasks" / world.name, instances)


def run_control(folder, instances):
    """Run random search in the paper's world with further seeds, in place of the learner."""
    world = WORLDS["paper"]
    tasks = folder / "tasks" / "paper"
    names = [f"{family}/v1/{number}" for family in FAMILIES for number in numbers(instances)]
    pairs = [str(tasks / f"{task.name}.toml")
             for number in numbers(instances) for task in pair(f"one-armed/v1/{number}")]  # fmt: skip
    text = f'title = "Control"\ndescription = "Random search in place of the learner."\n'
    text += f"runs = 1\ntrials = {world.trials}\n"
    for which, each in ((names, RUNS["families"]), (pairs, RUNS_OF_PAIRS)):
        runs = each * (1 + CONTROL_SETS)
        text += f'\n[[blocks]]\ntasks = {which}\nmethods = ["random-search"]\nruns = {runs}\n'
    file = folder / f"{CONTROL}.toml"
    file.write_text(text.replace("'", '"'), encoding="utf-8")
    print(run_suite(file, folder / CONTROL, executor=Local(1)), flush=True)


def main(folder="results/worlds", instances=INSTANCES, *which):
    """Run the worlds one after the other, then the control; or those that the command names."""
    folder = Path(folder).resolve()
    for name in which or (*WORLDS, LONG.name, CONTROL):
        if name == CONTROL:
            run_control(folder, instances)
            continue
        world = LONG if name == LONG.name else WORLDS[name]
        file = folder / f"{name}.toml"
        text = suite_of(world, folder, instances)
        file.write_text(text, encoding="utf-8")
        print(name, run_suite(file, folder / name, executor=Local(1)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
