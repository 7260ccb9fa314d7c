"""Run suite dose, then random search with the hands that the suite's learner uses at the end.

    python studies/dose/protocols.py results/dose

On each random task, random search has as many trials as the learner. It is run with each hand
sequence of the learner's noiseless trials after learning. Stored runs are not made again.
"""

import sys
from pathlib import Path

from coartic.analysis import load
from coartic.benchmarks.runner import run_suite

SUITE = Path(__file__).with_name("suite.toml")


def of_control(runs):
    """Return blocks of a suite: random search on random tasks for two arms.

    The hand sequences are those of the learner's noiseless trials after learning.
    """
    learner = runs[(runs.method == "dual-process/EC4-subtask") & runs.family.notna()]
    hands = learner.groupby("task", sort=False).replay_hands.unique()
    return "".join(
        f'\n[[blocks]]\ntasks = ["{task}"]\nmethods = ["random-search"]\n'
        f"grid = {{ hands = {sorted(each)} }}\n".replace("'", '"')
        for task, each in hands.items()
    )


def main(folder="results/dose"):
    """Run both parts, one after the other."""
    folder, text = Path(folder), SUITE.read_text("utf-8")
    file = folder.with_suffix(".toml")  # the suite with the blocks that are known so far
    file.parent.mkdir(parents=True, exist_ok=True)
    for blocks in (lambda: "", lambda: of_control(load(folder).runs)):
        text += blocks()
        file.write_text(text, encoding="utf-8")
        print(run_suite(file, folder), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
