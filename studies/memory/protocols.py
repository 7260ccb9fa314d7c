"""Run suite methods.toml, then random search that keeps its best trial more and more often.

    python studies/memory/protocols.py results/memory
    python studies/memory/protocols.py results/memory-development d000..d005

The tasks are those of the paper and instances of five families: i080 to i119, or those that the
command names. Random search keeps either postures or targets. It is run with the hand sequences in
which at least a tenth of the learner's runs end, so it is run after the learner. Stored runs are
not made again. All takes about ten CPU hours.
"""

import sys
from pathlib import Path

from cells import MIN_SHARE

from coartic.analysis import load
from coartic.benchmarks.runner import run_suite

SUITE, INSTANCES = Path(__file__).with_name("methods.toml"), "i080..i119"


def scales(runs):
    """Return blocks of a suite: random search in one stage, and in several stages.

    With several stages, postures or targets are kept. Random search has the hands of the learner,
    and as many runs.
    """
    text = ""
    learner = runs[
        runs.method.isin(["dual-process/EC1", "dual-process/EC4"]) & (runs.setting == "")
    ]
    for task, of_task in learner.groupby("task", sort=False):
        shares = of_task.hands.value_counts(normalize=True)
        hands = f"hands = {sorted(shares.index[shares >= MIN_SHARE])}"
        more = 'stages = [2, 4, 10, 30, 100, 1_000], keep = ["postures", "targets"]'
        for grid in (hands, f"{hands}, {more}"):
            text += f'\n[[blocks]]\ntasks = ["{task}"]\nmethods = ["random-search"]\n'
            text += f"runs = {len(of_task)}\ngrid = {{ {grid} }}\n".replace("'", '"')
    return text


def main(folder="results/memory", instances=INSTANCES):
    """Run both parts, one after the other."""
    folder, text = Path(folder), SUITE.read_text("utf-8").replace(INSTANCES, instances)
    file = folder.with_suffix(".toml")  # the suite with the blocks that are known so far
    file.parent.mkdir(parents=True, exist_ok=True)
    for blocks in (lambda: "", lambda: scales(load(folder).runs)):
        text += blocks()
        file.write_text(text, encoding="utf-8")
        print(run_suite(file, folder), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
