"""Judge what of Shah, Barto & Fagg (2013) replicates.

    coartic run comparison --out results/comparison
    PYTHONPATH=studies python studies/replication/study.py results/comparison [FOLDER ...]
        [--out FOLDER]

The folder of suite ``comparison`` comes first. Claims for which it has no runs are judged by the
other folders, of suites ``ablations`` and ``families``.

- With ``--out``, the script writes tables, figures and page.html into that folder.
- Without ``--out``, it needs all three folders. It writes tables (without ids of runs) and figures
  into the folder of this study; ``docs/scripts/fill_tables.py`` then fills its page.
- Without folders, it makes the figures again from the stored tables.
"""

import argparse
from pathlib import Path

import pandas as pd
from claims import CLAIMS, judge_claims
from page import page_of
from rewards import compare_rewards, draw_rewards
from solutions import draw_solutions, measure_solutions

from coartic.analysis import load
from stored import stored_picture, write_tables

HERE = Path(__file__).parent
VERDICTS = "supported", "undecided", "not supported"


def measure(folders):
    """Return the tables of results folders by name."""
    studies = [load(folder).worlds[""] for folder in folders]
    claims = judge_by_first(studies)
    return {
        "claims": claims,
        "verdicts": count_verdicts(claims),
        "rewards": compare_rewards(studies[0]),
        "solutions": measure_solutions(studies[0]),
    }


def judge_by_first(studies):
    """Judge each claim by the first study that has runs for it."""
    first, *others = (judge_claims(study, CLAIMS.index) for study in studies)
    for judged in others:
        lacking = first.index[first.suite == ""]
        first.loc[lacking] = judged.loc[lacking]
    return first


def count_verdicts(claims):
    """Count the verdicts on judged claims, by the goals that they are about."""
    judged = claims[claims.suite != ""]
    drawn = judged.suite == "families"
    ours = judged.statement.str.contains("†")
    groups = {"printed": ~drawn & ~ours, "reconstructed": ~drawn & ours, "random tasks": drawn,
              "all": drawn | ~drawn}  # fmt: skip
    rows = {
        name: {
            f"{prefix}{verdict.replace(' ', '_')}": (judged[column][group] == verdict).sum()
            for prefix, column in (("", "replicates"), ("beyond_", "more_than_one_selection"))
            for verdict in VERDICTS
        }
        for name, group in groups.items()
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def write(out):
    """Draw the figures, and make the page of a user's folder, from the tables in a folder."""
    stored = {path.stem: pd.read_csv(path, index_col=0) for path in out.glob("*.csv")}
    for name, draw in (("rewards", draw_rewards), ("solutions", draw_solutions)):
        (out / f"{name}.svg").write_bytes(stored_picture(draw, stored[name]))
    if out != HERE:
        (out / "page.html").write_text(page_of(stored), encoding="utf-8")


def main():
    """Measure the folders, if there are any, and write tables, figures and page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path, help="results folders, comparison first")
    parser.add_argument("--out", type=Path, default=HERE, help="folder of tables and page")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    tables = measure(asked.folders) if asked.folders else {}
    if asked.out == HERE:
        tables = {
            name: table.drop(columns="run_ids", errors="ignore") for name, table in tables.items()
        }
    write_tables(asked.out, tables)
    write(asked.out)


if __name__ == "__main__":
    main()
