"""Run random search that keeps its best trial ever more often, and the methods next to it.

    python studies/memory/protocols.py results/memory
    python studies/memory/protocols.py results/memory-development d000..d005

runs on the paper's tasks and on instances of five families, i080 to i119 or those that are named.
Both scales, with postures and with targets kept, have the hand sequences with which a tenth or more
of the learner's runs end, so that they come after the learner. What is done is not done again.
It takes some ten CPU hours; the parts come in the order of their weight for the answer.
"""

import sys
from pathlib import Path

from coartic.analysis import load
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.pool import Local
from coartic.benchmarks.runner import perform

PAPER = {"EC1": ["ascending", "descending"], "EC4": ["two-armed-1", "two-armed-2"]}
FAMILIES = {"EC1": ["one-armed"], "EC4": ["two-armed", "aligned", "redundancy", "long"]}
INSTANCES = "i080..i119"
RUNS, RUNS_OF_PAPER = 3, 20
TRIALS = 10_000
FIRST, REST = [10, 100, 1_000], [2, 4, 30]
"""Stages r above 1, those of the most weight first."""
FEWER, MORE = [30, 100, 300, 500, 1_000, 3_000], [100_000, 1_000_000]
"""Numbers of the learner's trials besides 10,000."""
LEAST_SHARE = 0.1
"""Least share of the learner's runs on a task that have a hand sequence of the scales."""
HEAD = f"""\
name = "memory"
title = "A dose of memory"
description = "Random search that keeps its best trial, by how often it does, next to the learner"
runs = {RUNS}
trials = {TRIALS}
time_limit_s = 3600
"""


def block(tasks, methods, **more):
    """Return a block of a suite as TOML; ``more`` are numbers, lists and tables of these."""
    lines = [f"tasks = {tasks}", f"methods = {methods}"]
    for name, value in more.items():
        if isinstance(value, dict):
            pairs = ", ".join(f"{key} = {each!r}" for key, each in value.items())
            value = f"{{ {pairs} }}"
        lines.append(f"{name} = {value}")
    return "\n[[blocks]]\n" + "\n".join(lines).replace("'", '"') + "\n"


def on_all(instances, method, several=RUNS_OF_PAPER, once=RUNS, **more):
    """Return blocks of a method on all tasks; ``{}`` in its id is the learner's condition."""
    text = ""
    for condition, families in FAMILIES.items():
        drawn = [f"{family}/v1/{instances}" for family in families]
        methods = [method.format(condition)]
        text += block(PAPER[condition], methods, runs=several, **more)
        text += block(drawn, methods, runs=once, **more)
    return text


def scales(study, stages):
    """Return blocks of random search in these numbers of stages, with the hands of the learner."""
    text = ""
    learner = study.runs[study.runs.method.isin(["dual-process/EC1", "dual-process/EC4"])]
    for task, runs in learner[learner.setting == ""].groupby("task", sort=False):
        shares = runs.hands.value_counts(normalize=True)
        hands = sorted(shares.index[shares >= LEAST_SHARE])
        count = RUNS if "/" in task else RUNS_OF_PAPER
        if stages == [1]:
            text += block([task], ["random-search"], runs=count, grid={"hands": hands})
        else:
            grid = {"hands": hands, "stages": stages, "keep": ["postures", "targets"]}
            text += block([task], ["random-search"], runs=count, grid=grid)
    return text


def main(folder, instances=INSTANCES):
    """Run all parts, one after the other."""
    folder, text = Path(folder), HEAD
    file = folder.with_suffix(".toml")  # the suite, as far as it is known
    file.parent.mkdir(parents=True, exist_ok=True)

    def run(blocks):
        nonlocal text
        text += blocks
        file.write_text(text, encoding="utf-8")
        print(perform(plan_suite(file), folder, executor=Local(-1)), flush=True)

    run(on_all(instances, "dual-process/{}"))
    for stages in ([1], FIRST, REST):
        run(scales(load(folder), stages))
    run(on_all(instances, "posture-based/two-goals", 1, 1))
    run(on_all(instances, "hill-climbing") + on_all(instances, "dual-process/{}-informed"))
    run(on_all(instances, "dual-process/{}", grid={"trials": FEWER}))
    run(on_all(instances, "cma-es/bandit"))
    run(on_all(instances, "posture-qp/goals-ahead", 1, 1))
    for trials in MORE:
        run(on_all(instances, "dual-process/{}", parameters={"trials": trials}))


if __name__ == "__main__":
    main(*sys.argv[1:] or ["results/memory"])
