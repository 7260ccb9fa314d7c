"""Count the people who tell the six models apart, from the recovery that is stored.

    python studies/fit/needed.py

prints a table in Markdown: the least odd number of people of whom more than half get the right
model with a probability of 95 %, if the share of right models is at the lower end of its 95 %
interval (Clopper & Pearson), and in brackets the simulated people with the right model.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

GROUPS = {"one arm": ("ascending", "descending"),
          "two arms": ("two-armed-1", "two-armed-2"),
          "20 random tasks": ("random",)}  # fmt: skip
CASES = (("complete", 30), ("complete", 100), ("complete", 300), ("noisy", 30), ("noisy", 100))


def people_needed(right, people):
    """Return the number of people for ``right`` of ``people`` simulated ones."""
    lower = stats.beta.ppf(0.025, right, people - right + 1)
    numbers = np.arange(1, 1000, 2)
    return int(numbers[stats.binom.sf(numbers // 2, numbers, lower) >= 0.95][0])


def main():
    """Print the table."""
    table = pd.read_csv(Path(__file__).with_name("results.csv"), index_col="row")
    heads = [f"{trials}{', noise' * (data == 'noisy')}" for data, trials in CASES]
    print(f"| trials | {' | '.join(heads)} |\n| --- |{' ---: |' * len(CASES)}")
    for title, groups in GROUPS.items():
        cells = []
        for data, trials in CASES:
            cell = table[table.group.isin(groups) & (table.data == data) & (table.trials == trials)]
            people, right = int(cell.people.sum()), round((cell.right * cell.people).sum())
            cells.append(f"{people_needed(right, people)} ({right}/{people})" if people else "–")
        print(f"| {title} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
