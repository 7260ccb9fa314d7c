"""Run suite methods.toml, then random search that keeps its best trial ever more often.

    python studies/memory/protocols.py results/memory
    python studies/memory/protocols.py results/memory-development d000..d005

runs on the paper's tasks and on instances of five families, i080 to i119 or those that are named.
Both scales, with postures and with targets kept, have the hand sequences with which a tenth or more
of the learner's runs end, so that they come after the learner. What is done is not done again.
It takes some ten CPU hours.
"""

import sys
from pathlib import Path

from cells import LEAST_SHARE

from coartic.analysis import load
from coartic.benchmarks.runner import run_suite

SUITE, INSTANCES = Path(__file__).with_name("methods.toml"), "i080..i119"


def scales(runs):
    """Return blocks of random search in one part, and in more with postures or targets kept, with
    the hands of the learner, as often as the learner ran."""
    text = ""
    learner = runs[
        runs.method.isin(["dual-process/EC1", "dual-process/EC4"]) & (runs.setting == "")
    ]
    for task, of_task in learner.groupby("task", sort=False):
        shares = of_task.hands.value_counts(normalize=True)
        hands = f"hands = {sorted(shares.index[shares >= LEAST_SHARE])}"
        more = 'stages = [2, 4, 10, 30, 100, 1_000], keep = ["postures", "targets"]'
        for grid in (hands, f"{hands}, {more}"):
            text += f'\n[[blocks]]\ntasks = ["{task}"]\nmethods = ["random-search"]\n'
            text += f"runs = {len(of_task)}\ngrid = {{ {grid} }}\n".replace("'", '"')
    return text


def main(folder="results/memory", instances=INSTANCES):
    """Run both parts, one after the other."""
    folder, text = Path(folder), SUITE.read_text("utf-8").replace(INSTANCES, instances)
    file = folder.with_suffix(".toml")  # the suite, as far as it is known
    file.parent.mkdir(parents=True, exist_ok=True)
    for blocks in (lambda: "", lambda: scales(load(folder).runs)):
        text += blocks()
        file.write_text(text, encoding="utf-8")
        print(run_suite(file, folder), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
