"""Make the runs of study practice: first the learner, then the other methods with its hands.

    python studies/practice/protocols.py results/practice
    python studies/practice/protocols.py results/practice-development development

Run n of each cell on a task has the hands in which the learner's run n ends in the same world:
those of its best trial without noise, and those of its next action with noise. Both runs have the
same seed. Stored runs are not made again, so an interrupted command can be repeated.

The 560 runs on development instances took 61 CPU seconds, 0.11 each. By that the 6,040 runs on test
instances and the paper's tasks take 11 minutes of CPU time, and judging them some more.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

from coartic.analysis import load
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.runner import perform

HERE = Path(__file__).parent
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
NOISES = (0.0, 0.01)
"""Motor noise of the two worlds, in length units (base) and rad (joints)."""
PAPER_TASKS = ("ascending", "descending", "two-armed-1", "two-armed-2")
TARGETS = "hill-climbing/targets"
CELLS = {
    "a": ("hill-climbing", {"spread": "fixed"}),
    "b": ("hill-climbing", {"spread": "learned"}),
    "c": ("policy-gradient", {"spread": "fixed"}),
    "d": ("policy-gradient", {"spread": "learned"}),
    "targets, fixed": (TARGETS, {"spread": "fixed"}),
    "targets, learned": (TARGETS, {"spread": "learned"}),
}
"""Methods and parameters of the cells, all with their default setting."""
SECOND = {
    "b second": ("hill-climbing", {"spread": "learned", "window": 50}),
    "c second": ("policy-gradient", {"spread": "fixed", "batch": 50, "step": 2.0}),
    "d second": ("policy-gradient", {"spread": "learned", "spread_step": 0.03}),
}
"""The second-best settings in docs/stored/tuning/rivals.csv. Cell a was not tuned."""
JUDGED = ("a", "b", "c", "d")
PARTS = {
    "test": (
        "i000..i019",
        (3, 20),
        (
            dict.fromkeys(JUDGED, (1, 5)),
            dict.fromkeys(CELLS, (1, 5)),
            dict.fromkeys([*CELLS, *SECOND], (1, 5)),
            dict.fromkeys(CELLS, (3, 20)) | dict.fromkeys(SECOND, (1, 5)),
        ),
    ),
    "development": ("d003..d010", (1, 0), (dict.fromkeys(CELLS, (1, 0)),)),
}
"""For each part the instances of each family, the numbers of the learner's runs on an instance and
on a task of the paper, and stages. A stage has such numbers for each cell. After each stage the
folder has all cells of the stage with these numbers of runs."""


def block(tasks, method, parameters, runs, noise, hands=()):
    """Return a block of a suite as TOML. With ``hands`` parameter ``sequence`` takes each."""
    lines = [
        "[[blocks]]",
        f"tasks = {json.dumps([*tasks])}",
        f'methods = ["{method}"]',
        f"runs = {runs}",
    ]
    if noise:
        lines.append(f"model = {{ motor_noise = {noise} }}")
    if parameters:
        of_toml = ", ".join(f"{name} = {json.dumps(value)}" for name, value in parameters.items())
        lines.append(f"parameters = {{ {of_toml} }}")
    if hands:
        lines.append(f"grid = {{ sequence = {json.dumps([*hands])} }}")
    return "\n".join(lines) + "\n\n"


def learners(part):
    """Return the blocks of the learner, which uses one arm or two as the task does."""
    instances, (of_instance, of_paper), _ = PARTS[part]
    text = ""
    for noise in NOISES:
        for family in FAMILIES:
            learner = "dual-process/EC1" if family == "one-armed" else "dual-process/EC4"
            text += block([f"{family}/v1/{instances}"], learner, {}, of_instance, noise)
        if of_paper:
            text += block(PAPER_TASKS[:2], "dual-process/EC1", {}, of_paper, noise)
            text += block(PAPER_TASKS[2:], "dual-process/EC4", {}, of_paper, noise)
    return text


def hands_of(folder):
    """Return the hands in which the learner's runs end, by task, motor noise and run."""
    learner = {}
    for study in load(folder).worlds.values():
        solved = study.runs[study.runs.status == "ok"]
        of_learner = solved[solved.method.str.startswith("dual-process/")]
        keys = zip(of_learner.task, of_learner.motor_noise, of_learner.run, strict=True)
        learner |= dict(zip(keys, of_learner.hands, strict=True))
    return learner


def others(stage, hands):
    """Return the blocks of a stage: one for each cell on each task in each world."""
    text = ""
    for task, noise in dict.fromkeys((task, noise) for task, noise, _ in hands):
        for cell, (of_instance, of_paper) in stage.items():
            runs = of_instance if "/" in task else of_paper
            found = {hands.get((task, noise, run)) for run in range(runs)} - {None}
            if found:
                method, parameters = (CELLS | SECOND)[cell]
                text += block([task], method, parameters, runs, noise, sorted(found))
    return text


def with_hands(plan, hands):
    """Return a plan in which each job has only the runs that have the learner's hands."""
    jobs = []
    for job in plan:
        sequence = job.cell.parameters.get("sequence")
        key = job.cell.task.name, job.cell.model.motor_noise
        numbers = [n for n in job.numbers if sequence in (None, hands.get((*key, n)))]
        if numbers:
            jobs.append(replace(job, numbers=tuple(numbers)))
    return jobs


def main(folder="results/practice", part="test"):
    """Run the learner, then the stages."""
    folder = Path(folder)
    file = folder.with_suffix(".toml")  # the suite with the blocks that are known so far
    file.parent.mkdir(parents=True, exist_ok=True)
    text = 'name = "practice"\ntitle = "What the learner lacks"\n'
    text += 'description = "Methods that practise with the hands of the learner."\n'
    text += "runs = 1\ntrials = 10_000\n\n" + learners(part)
    file.write_text(text, encoding="utf-8")
    print(perform(plan_suite(file), folder), flush=True)
    hands = hands_of(folder)
    for stage in PARTS[part][2]:
        file.write_text(text + others(stage, hands), encoding="utf-8")
        files = [HERE / "keeps_targets.py"] if "targets, fixed" in stage else []
        plan = plan_suite(file, method_files=files)
        print(perform(with_hands(plan, hands), folder), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
