"""Does the order of methods survive motor noise, and what if they learn in noise?

    python studies/noise/protocols.py results/noise
    PYTHONPATH=studies python studies/noise/study.py results/noise

Against the expected answer to the first question, that CMA-ES keeps a smaller lead over the paper's
learner: a lead that is as large as without noise, or larger, or reversed, or that cannot be seen.
README.md has all hypotheses and rules.
"""

import sys
from pathlib import Path

from order import read, tabulate_gaps, tabulate_pairs

from coartic.analysis import figures
from common.writing import write_study

GROUPS = {"paper": "the paper's tasks", "families": "200 random tasks"}


def measure(folder):
    """Return the tables of question 1 by name."""
    rows = read(Path(folder) / "order")
    return {
        "runs": rows.set_index("run_id"),
        "results": tabulate_gaps(rows),
        "pairs": tabulate_pairs(rows),
    }


@figures.styled
def draw(results):
    """Draw the gap by motor noise, a panel for each group of tasks."""
    figure, panels = figures.panels((1, 2), (figures.TWO, 3))
    for axes, (group, title) in zip(panels.flat, GROUPS.items(), strict=True):
        of_group = results[(results.group == group) & ~results.signal_dependent]
        for name, of_method in of_group.groupby("name", sort=False):
            figures.means(axes, of_method, x="motor_noise", y="gap", label=name)
        axes.set_title(title)
        axes.set_xlabel("motor noise (rad)")
    panels.flat[0].set_ylabel("gap (%)")
    panels.flat[0].legend()
    return figure


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(sys.argv[1]) if sys.argv[1:] else {}, draw)
