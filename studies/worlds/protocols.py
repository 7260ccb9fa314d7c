"""Run methods on the same tasks in ten worlds: the paper's, and worlds that differ in one constant.

    PYTHONPATH=studies python studies/worlds/protocols.py results/worlds
    PYTHONPATH=studies python studies/worlds/protocols.py results/development d000..d001

The results folder has a folder for each world, and beside it the suite that made it, with the task
files of worlds with another radius. Stored runs are not made again. There are stages: one run of
each method on each random task in all worlds, then further runs, then hill climbing, about which
there is no claim, and last the paper's tasks; so an interrupted study has whole worlds. The command
can name worlds and stages. All takes about an hour of CPU time.
"""

import sys
from pathlib import Path

from settings import (
    CONTROL,
    CONTROL_OF_PAIRS,
    CONTROL_SETS,
    CONTROL_SETS_OF_PAIRS,
    FAMILIES,
    INSTANCES,
    LONG,
    PAPER,
    RUNS,
    RUNS_OF_PAIRS,
    STAGES,
    WORLDS,
)

from coartic import load_task
from coartic.benchmarks import run_suite
from coartic.benchmarks.pool import Local
from coartic.tasks.task import task_text
from people.protocols import pair

LEARNERS = {
    "dual-process/EC1": ("ascending", "descending", "one-armed"),
    "dual-process/EC4": ("two-armed", "aligned"),
}
"""Conditions of the learner, with the beginnings of the names of their tasks."""


def numbers(instances):
    """Return the numbers of a range of instances, such as ``d000..d001``."""
    first, last = instances.split("..")
    return [f"{first[0]}{number:03d}" for number in range(int(first[1:]), int(last[1:]) + 1)]


def with_radius(task, world, name):
    """Return a task as it is in a world: with the radius of its goals, and another name."""
    if world.radius is None:
        return task
    return task.model_copy(update={"name": name, "radius": world.radius})


def places_of(world, folder, instances):
    """Return what a suite names a world's tasks, by task: its name, or a file that is written.

    The first mapping has the tasks of the paper and of families, the second the pairs.
    """
    folder.mkdir(parents=True, exist_ok=True)

    def write(task):
        path = folder / f"{task.name}.toml"
        path.write_text(task_text(task), encoding="utf-8")
        return str(path)

    tasks = [*PAPER] if instances == INSTANCES else []  # the paper's tasks are not for development
    tasks += [f"{family}/v1/{number}" for family in FAMILIES for number in numbers(instances)]
    places = dict(zip(tasks, tasks, strict=True))
    if world.radius is not None:
        for name in tasks:
            new = f"{name.replace('/v1/', '-')}-radius-{world.radius}"
            places[name] = write(with_radius(load_task(name), world, new))
    pairs = [task for number in numbers(instances) for task in pair(f"one-armed/v1/{number}")]
    return places, {task.name: write(with_radius(task, world, task.name)) for task in pairs}


def block(places, methods, runs):
    """Return a block of a suite."""
    text = f"\n[[blocks]]\ntasks = {[*places]}\nmethods = {[*methods]}\nruns = {runs}\n"
    return text.replace("'", '"')


def blocks_of(world, folder, instances, stages):
    """Return the blocks of some stages of a world's suite."""
    tasks, pairs = places_of(world, folder, instances)
    text = ""
    for stage in stages:
        if stage == "one-run" and "families" in stages:
            continue  # the next stage has this run, too
        for learner, beginnings in LEARNERS.items():
            places = [
                place
                for name, place in tasks.items()
                if name.startswith(beginnings)
                and (stage == "hill-climbing" or (name in PAPER) == (stage == "paper"))
            ]
            if not places:
                continue
            if stage == "hill-climbing":
                text += block(places, ["hill-climbing"], RUNS["families"])
                continue
            if world is LONG:
                text += block(places, [learner, "random-search"], RUNS[stage])
                text += block(places, ["corrective-alone/best-hands"], 1)
                continue
            text += block(places, [learner, "random-search", "policy-gradient"], RUNS[stage])
            text += block(places, ["cma-es/bandit"], RUNS[stage] if stage == "paper" else 1)
            text += block(places, ["corrective-alone/best-hands"], 1)
        if stage in ("one-run", "families") and world is not LONG:
            text += block(pairs.values(), ["dual-process/EC1", "random-search"], RUNS_OF_PAIRS)
    return text


def head(title, world):
    """Return the head of a suite as TOML."""
    text = f'title = "{title}"\ndescription = "A world of study worlds."\n'
    text += f"runs = 1\ntrials = {world.trials}\n"
    model = ", ".join(f"{key} = {value!r}" for key, value in world.model.items()).replace("'", '"')
    return text + (f"model = {{ {model} }}\n" if model else "")


def run_world(world, folder, instances, stages):
    """Run some stages of a world."""
    file = folder / f"{world.name}.toml"
    blocks = blocks_of(world, folder / "tasks" / world.name, instances, stages)
    file.write_text(head(world.title, world) + blocks, encoding="utf-8")
    print(world.name, run_suite(file, folder / world.name, executor=Local(1)), flush=True)


def run_control(name, folder, instances):
    """Run random search in the paper's world with further seeds, in place of the learner."""
    world = WORLDS["paper"]
    tasks, pairs = places_of(world, folder / "tasks" / name, instances)
    places, runs = pairs.values(), RUNS_OF_PAIRS * (1 + CONTROL_SETS_OF_PAIRS)
    if name == CONTROL:
        places = [place for task, place in tasks.items() if task not in PAPER]
        runs = RUNS["families"] + CONTROL_SETS
    file = folder / f"{name}.toml"
    file.write_text(head("Control", world) + block(places, ["random-search"], runs), "utf-8")
    print(name, run_suite(file, folder / name, executor=Local(1)), flush=True)


def main(folder="results/worlds", instances=INSTANCES, *names):
    """Run stage after stage, each in all worlds, and the control last."""
    folder = Path(folder).resolve()
    stages = [*names] if {*names} & {*STAGES} else [*STAGES]
    wanted = {*names} - {*STAGES} or {*WORLDS, LONG.name, CONTROL, CONTROL_OF_PAIRS}
    for number, stage in enumerate(STAGES):
        if stage not in stages:
            continue
        for world in WORLDS.values():
            if world.name in wanted:
                run_world(world, folder, instances, STAGES[: number + 1])
        if stage == "families" and LONG.name in wanted:
            run_world(LONG, folder, instances, ["one-run"])
        for name in (CONTROL, CONTROL_OF_PAIRS):
            if stage == "families" and name in wanted:
                run_control(name, folder, instances)


if __name__ == "__main__":
    main(*sys.argv[1:])
