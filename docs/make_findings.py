"""Write the pages whose numbers come from stored results: ``python docs/make_findings.py``.

``docs/stored`` has tables and figures of suites, with a folder for each suite. ``studies`` has
those of studies. The templates ``*.md.jinja`` in this folder are filled in from them. With ``--from
results`` the tables and figures that the pages ask for are first made again from the results
folders below ``results``, and with ``--from shipped`` from the shipped results.
"""

from __future__ import annotations

import argparse
import lzma
import re
import shutil
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import finding_figures
import pandas as pd
from scipy import stats

from coartic.analysis import FIGURES, TABLES, Study, by_task, load, mean
from coartic.analysis.statistics import task_mean
from coartic.runs.shipped import PACKED, SHIPPED, SHIPPED_FOLDER, shipped_hashes
from coartic.runs.store import RUNS_FILE
from common.writing import fill_page, stored_picture
from worlds.settings import FAMILIES, WORLDS

DOCS = Path(__file__).parent
STUDIES = DOCS.parent / "studies"
STORED = DOCS / "stored"
NEW = dict[str, Study]()
"""Results that the command line names, by suite: what the pages ask for is made again of them."""
WIDTH = 3.5
"""Width of the figures of suites, in inches."""


def unpack_shipped(folder: Path) -> Path:
    """Unpack the shipped results into a folder for each suite below ``folder``, and return it."""
    for suite in shipped_hashes():
        (folder / suite).mkdir()
        packed = SHIPPED_FOLDER / f"{suite}{PACKED}"
        (folder / suite / RUNS_FILE).write_bytes(lzma.decompress(packed.read_bytes()))
    return folder


def make_table(study: Study, name: str) -> pd.DataFrame:
    """Return a table of a study of one world, as it is stored: without ids of runs.

    Table ``by-task`` is no table of the report: pages compute means over tasks from it.
    """
    if name == "by-task":
        return by_task(study.runs).set_index("task")
    return TABLES[name](study).drop(columns="run_ids")


@cache
def table(suite: str, name: str, world: str = "") -> pd.DataFrame:
    """Return a stored table of a suite or a study in one world, with its rows by name.

    If the suite is in :data:`NEW`, the table is first made again.
    """
    folder = STUDIES / suite if (STUDIES / suite).is_dir() else STORED / suite
    path = folder / f"{f'{name}-in-{world}' if world else name}.csv"
    if suite in NEW:
        frame = make_table(NEW[suite].worlds[world], name)
        frame.to_csv(path, float_format="%.6g", lineterminator="\n")
    return pd.read_csv(path, index_col=0)


def row(suite: str, name: str, which: str) -> dict[Any, Any]:
    """Return a row of a stored table. Raises KeyError if the table has no such row."""
    return table(suite, name).loc[which].to_dict()


def claim(name: str, study: str = "replication") -> dict[Any, Any]:
    """Return a judged claim of a study by its id."""
    return row(study, "claims", name)


def cells_of_the_paper() -> pd.DataFrame:
    """Return the rewards of the paper's cells, without the rows of single hand sequences."""
    rewards = table("replication", "rewards")
    return rewards[rewards.hands.isna()]


def verdicts(*, others: bool = False, published: bool = False) -> Counter[str]:
    """Return the numbers of claims on the paper's tasks, by verdict.

    With ``others``, the three claims that carry the paper's point are left out. With ``published``,
    claims that use reconstructed goals are left out.
    """
    judged = table("replication", "claims")
    judged = judged[judged.suite != "families"]
    if published:
        judged = judged[~judged.statement.str.contains("†")]
    if others:
        words = tomllib.loads((STUDIES / "replication" / "claims.toml").read_text("utf-8"))
        judged = judged[["short" not in words[name] for name in judged.index]]
    return Counter(judged.replicates)


def seen(evidence: str, words: str, which: int = 0) -> str:
    """Return the number that follows some words in the evidence, with its interval if it has one.

    Raises IndexError if there is no such number.
    """
    estimate = r":?\s*(−?\d+(?:\.\d+)?(?: \[[^]]*\])?)"
    number_behind = re.escape(words) + estimate
    return str(re.findall(number_behind, evidence, re.IGNORECASE)[which])


def p_of_shares(values: dict[Any, Any], published_runs: int) -> float:
    """Return p of Fisher's exact test that ours and published runs learn a sequence as often."""
    counts = (values["published_runs"], published_runs), (values["runs"], values["of_runs"])
    return float(stats.fisher_exact([[n, of - n] for n, of in counts]).pvalue)


def published_spreads() -> pd.DataFrame:
    """Return the published spreads (±) with the tests of both readings.

    The published spread of a hand sequence is compared with the runs that have this sequence.
    """
    spreads = table("replication", "rewards").sort_values("hands", kind="stable")
    spreads = spreads.drop_duplicates(["task", "condition", "published_sd"]).dropna(subset="p_sd")
    return spreads.sort_index()


def gain_of_best_hands() -> float:
    """Return the gain of the best hands of the corrective process over the initial hands.

    The gain is in per cent of the distance from the initial solution to the best known reward. It
    is a mean over the random tasks of families with up to eight goals.
    """
    tasks = table("families", "by-task").query("method == 'corrective-alone/given'")
    share = tasks.share[~tasks.index.str.startswith("many-goals")]  # 0 is the best hands: negative
    return float((-100 * share / (1 - share)).mean())


@cache
def early_less_late(family: str) -> dict[str, float]:
    """Return how much more 100 trials with drift gain than 10,000 trials of the paper's learner.

    ``more`` is a mean over the tasks of a family, in percentage points of the distance to the best
    known reward, with its interval.
    """
    runs = pd.read_csv(STUDIES / "dial" / "runs.csv.xz").query(f"family == '{family}'")
    way = runs.best_known - runs.corrective_best
    gains = {n: 100 * (runs[f"reward_{n}"] - runs.corrective_best) / way for n in (100, 10_000)}
    tasks = [
        gains[n][(runs.setting == setting) & (way > 0)].groupby(runs.task).mean()
        for n, setting in ((100, "1 0.01 next-goal"), (10_000, "0 0.05"))
    ]
    return mean((tasks[0] - tasks[1]).dropna()).columns("more")


FOREIGN = ["task", "method", "setting", "run", "trials", "reward", "best_known", "gap"]
POSTURE = ["at_x", "at_y", *(f"at_{joint}" for joint in range(1, 5))]
"""Columns of the posture at goal 1 of the one-armed tasks: base and joints of the right arm."""


def foreign_rows(study: Study) -> pd.DataFrame:
    """Return the runs of suite ``foreign`` or ``tuning``, with a row for each run.

    Runs on the paper's one-armed tasks have the posture at goal 1.
    """
    runs = study.runs[study.runs.status == "ok"]
    runs = runs.assign(method=runs.method.replace(r"dual-process/EC\d", "learner", regex=True))
    rows = runs.set_index("run_id")[FOREIGN].reindex(columns=[*FOREIGN, *POSTURE])
    for task, label in study.cells:
        if task in ("ascending", "descending"):
            executed = study.executed(task, label)
            arm = executed.task.robot.joints("right")
            for run_id, q in zip(executed.run_ids, executed.configurations[:, 0], strict=True):
                rows.loc[run_id, POSTURE] = [*q[:2], *q[arm]]
    return rows.set_index("task")


def foreign_gaps() -> pd.DataFrame:
    """Return the gaps of suite ``foreign`` (in per cent), with a row for each method and setting.

    - ``gap``: gap on the paper's tasks, with an interval for other runs;
    - ``random``: gap on random tasks, with an interval for other tasks;
    - ``difference``: posture difference at the first goal of ascending and descending.
    """
    runs = pd.read_csv(STORED / "foreign" / "runs.csv").fillna({"setting": ""})
    names = (runs.method + " " + runs.setting).str.strip()
    table = {}
    for name, of_method in runs.groupby(names, sort=False):
        is_random = of_method.task.str.contains("/")
        paper, drawn = of_method[~is_random], of_method[is_random]
        row = task_mean([100 * gaps for _, gaps in paper.groupby("task").gap]).columns("gap")
        row |= mean(100 * drawn.gap).columns("random") if len(drawn) else {}
        hits = [paper[paper.task == task][POSTURE].mean() for task in ("ascending", "descending")]
        table[name] = row | {"difference": float(((hits[0] - hits[1]) ** 2).sum() ** 0.5)}
    return pd.DataFrame.from_dict(table, orient="index")


def shipped_gaps(method: str) -> dict[str, float]:
    """Return a row as in :func:`foreign_gaps` for a method of the shipped suites.

    The tasks are the same. On each random task, the gap is a mean over three runs.
    """
    paper = row("comparison", "ranking", method)
    tasks = table("families", "by-task").reset_index()
    tasks = tasks[tasks.task.str[-4:].isin(["i000", "i001", "i002"])]
    one, others = ("dual-process/EC1", "dual-process/EC4") if "dual" in method else (method, method)
    wanted = tasks.task.str.startswith("one-armed/").map({True: one, False: others})
    drawn = tasks[(tasks.method == wanted) & ~tasks.task.str.startswith("many-goals/")]
    gaps = {f"gap{end}": 100 * paper[f"gap{end}"] for end in ("", "_low", "_high")}
    gaps["difference"] = table("comparison", "contexts").set_index("method").distance[one]
    return gaps | mean(100 * drawn.gap).columns("random")


MAX_LISTED = 6
"""Largest number of cells of study ``worlds`` that a sentence lists."""


def in_worlds(claim: str) -> str:
    """Return in words in which worlds and families a claim of study ``worlds`` holds.

    A claim about lean has the family *one-armed* alone. Cells with a verdict are listed if they
    are at most six, and otherwise counted.
    """
    judged = table("worlds", "results").dropna(subset="verdict")
    judged = judged[judged.claim == claim]
    has_families = set(judged.group) != {"one-armed"}
    parts = []
    for verdict, words in (("holds", "it holds"), ("reversed", "reversed"), ("open", "open")):
        cells = judged[judged.verdict == verdict]
        if cells.empty and verdict != "holds":
            continue
        where = {
            world.title: [family for family in FAMILIES if family in {*cells.group[in_world]}]
            for name, world in WORLDS.items()
            if (in_world := cells.world == name).any()
        }
        names = [
            f"{title} ({', '.join(families)})" if has_families else title
            for title, families in where.items()
        ]
        counted = f" in {len(cells)}"
        if verdict == "holds":
            counted += f" of {len(judged)} {'cells' if has_families else 'worlds'}"
        listed = f": {', '.join(names)}" if 0 < len(cells) <= MAX_LISTED else ""
        parts.append(words + counted + listed)
    return f"{'; '.join(parts)}."


def filled_pages() -> dict[str, str]:
    """Return every page that is made from a template, by its path below ``docs``."""
    published = tomllib.loads((STUDIES / "replication" / "published.toml").read_text("utf-8"))
    values = {
        "table": table,
        "row": row,
        "claim": claim,
        "cells_of_the_paper": cells_of_the_paper,
        "verdicts": verdicts,
        "seen": seen,
        "published_spreads": published_spreads,
        "p_of_shares": p_of_shares,
        "gain_of_best_hands": gain_of_best_hands,
        "early_less_late": early_less_late,
        "in_worlds": in_worlds,
        "foreign_gaps": foreign_gaps,
        "shipped_gaps": shipped_gaps,
        "published": published["general"],
    }
    return {
        str(path.relative_to(DOCS).with_suffix("")): fill_page(path, **values)
        for path in sorted(DOCS.rglob("*.md.jinja"))
    }


def figures() -> dict[str, bytes]:
    """Return every figure of the findings as SVG, by its path below ``docs``."""
    return {
        f"stored/findings/{name}.svg": stored_picture(
            draw, table, *[early_less_late] * (name == "early-gain")
        )
        for name, draw in finding_figures.FIGURES.items()
    }


def draw_figure(study: Study, name: str) -> bytes:
    """Return a figure of a study of one world as SVG, as it is stored."""
    return stored_picture(lambda: FIGURES[name](study, width=WIDTH).figure)


def forget_stored(results: dict[str, Study]) -> None:
    """Remove the stored tables and figures of suites whose results are given.

    Pages then store those that they ask for (:data:`NEW`). The runs of suite ``foreign`` are
    stored at once.
    """
    for suite, name in (("foreign", "runs"), ("tuning", "tuning")):
        if suite in results:
            rows = foreign_rows(results[suite]).dropna(axis="columns", how="all")
            file = STORED / "foreign" / f"{name}.csv"
            rows.to_csv(file, float_format="%.6g", lineterminator="\n")
    for suite in {kept.name for kept in STORED.iterdir()} & {*results} - {"foreign", "tuning"}:
        NEW[suite] = results[suite]
        shutil.rmtree(STORED / suite)
        (STORED / suite).mkdir()


def store_figures(pages: Iterable[str]) -> None:
    """Draw the figures of the suites in :data:`NEW` that pages (texts) show."""
    for suite, name in {*re.findall(r"\bstored/([\w-]+)/([\w-]+)\.svg\)", "\n".join(pages))}:
        if suite in NEW:
            drawn = draw_figure(NEW[suite].worlds[""], name)
            (STORED / suite / f"{name}.svg").write_bytes(drawn)


def main() -> None:
    """Store new results if the command line names them, then write the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--from", dest="results", type=Path, help="Folder of the suites' results, or 'shipped'."
    )
    results = parser.parse_args().results
    with tempfile.TemporaryDirectory() as unpacked:
        if results is not None:
            below = unpack_shipped(Path(unpacked)) if str(results) == SHIPPED else results
            found = sorted(below.glob(f"*/{RUNS_FILE}"))
            forget_stored({path.parent.name: load(path.parent) for path in found})
        pages = filled_pages()
        store_figures([*pages.values(), (DOCS.parent / "README.md").read_text("utf-8")])
    for name, text in pages.items():
        (DOCS / name).write_text(text, encoding="utf-8")
    (STORED / "findings").mkdir(exist_ok=True)
    for name, drawing in figures().items():
        (DOCS / name).write_bytes(drawing)


if __name__ == "__main__":
    main()
