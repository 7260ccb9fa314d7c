"""Judge what of Shah, Barto & Fagg (2013) replicates.

    coartic run comparison --out results/comparison
    PYTHONPATH=studies python studies/replication/study.py results/comparison [FOLDER ...]
        [--out FOLDER]

The folder of suite ``comparison`` comes first. Claims for which it has no runs are judged by the
other folders, of suites ``ablations`` and ``families``.

- With ``--out``, the script writes tables, figures and page.html into that folder.
- Without ``--out``, it needs all three folders. It writes tables (without ids of runs), figures and
  README.md into the folder of this study.
- Without folders, it makes figures and page again from the stored tables.
"""

import argparse
import re
from pathlib import Path

import pandas as pd
from claims import CLAIMS, judge_claims
from markdown_it import MarkdownIt
from rewards import compare_rewards, draw_rewards
from solutions import draw_solutions, measure_solutions

from coartic.analysis import load
from common.writing import fill_page, stored_picture

HERE = Path(__file__).parent
STYLE = HERE.parents[1] / "analysis" / "report" / "page.css"
VERDICTS = "not supported", "undecided", "supported"
"""Verdicts in the order of the page, failures first."""


def measure(folders):
    """Return the tables of results folders by name."""
    studies = [load(folder).worlds[""] for folder in folders]
    return {
        "claims": judge_by_first(studies),
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


def rank(verdicts):
    """Return the position in :data:`VERDICTS` of each entry of a column of verdicts."""
    return verdicts.map(VERDICTS.index)


def write(out):
    """Draw the figures, and fill in the page, from the tables in a folder.

    In the folder of this study, the page is README.md. In any other folder it is page.html, which
    also has the evidence of each claim. There, links to the project become names of files, so that
    the folder can be moved.
    """
    stored = {path.stem: pd.read_csv(path, index_col=0) for path in out.glob("*.csv")}
    for name, draw in (("rewards", draw_rewards), ("solutions", draw_solutions)):
        (out / f"{name}.svg").write_bytes(stored_picture(draw, stored[name]))
    if out == HERE:
        text = fill_page(HERE / "README.md.jinja", **stored)
        (out / "README.md").write_text(text, encoding="utf-8")
    else:
        text = fill_page(HERE / "page.md.jinja", rank=rank, **stored)
        text = re.sub(r"\[([^]]+)\]\(\.\./\.\./([^)#]+)[^)]*\)", r"\1 (`\2`)", text)
        body = MarkdownIt("commonmark", {"html": True}).enable("table").render(text)
        body = body.replace("<table>", '<div class="scroll"><table>')
        body = body.replace("</table>", "</table></div>")
        page, style = (HERE / "page.html").read_text("utf-8"), STYLE.read_text("utf-8")
        page = page.replace("{{ style }}", style).replace("{{ body }}", body)
        (out / "page.html").write_text(page, encoding="utf-8")


def main():
    """Measure the folders, if there are any, and write tables, figures and page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path, help="results folders, comparison first")
    parser.add_argument("--out", type=Path, default=HERE, help="folder of tables and page")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    tables = measure(asked.folders) if asked.folders else {}
    for name, table in tables.items():
        if asked.out == HERE:
            table = table.drop(columns="run_ids", errors="ignore")
        table.to_csv(asked.out / f"{name}.csv", float_format="%.6g", lineterminator="\n")
    write(asked.out)


if __name__ == "__main__":
    main()
