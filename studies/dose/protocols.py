"""Run suite dose, then random search with the hands in which its learner ends.

    python studies/dose/protocols.py results/dose

Random search has as many trials as the learner and each hand sequence with which a noiseless trial
of it ends on a random task. What is done is not done again.
"""

import sys
from pathlib import Path

from coartic.analysis import load
from coartic.benchmarks.runner import run_suite

SUITE = Path(__file__).with_name("suite.toml")


def of_control(runs):
    """Return blocks of random search on random tasks for two arms, with the hands of the learner's
    noiseless trials."""
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
    file = folder.with_suffix(".toml")  # the suite, as far as it is known
    file.parent.mkdir(parents=True, exist_ok=True)
    for blocks in (lambda: "", lambda: of_control(load(folder).runs)):
        text += blocks()
        file.write_text(text, encoding="utf-8")
        print(run_suite(file, folder), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
