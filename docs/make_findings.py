"""Write the pages whose numbers come from stored results.

    python docs/make_findings.py

``docs/stored`` has a folder for each suite, with its tables and figures. ``studies`` has a folder
for each study, with its tables. The script fills in the templates ``*.md.jinja`` of this folder
from these tables. With ``--from results``, the tables and figures that the pages use are first made
again from the results folders below ``results``; with ``--from shipped``, they are made again from
the shipped results.
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
"""Maps the name of each suite whose results the command line names to the study. Tables and figures
of these suites are made again when a page uses them."""
WIDTH = 3.5
"""Width of the figures of suites, in inches."""


def unpack_shipped(folder: Path) -> Path:
    """Unpack the shipped results into ``folder``, with a subfolder for each suite.

    Returns ``folder``.
    """
    for suite in shipped_hashes():
        (folder / suite).mkdir()
        packed = SHIPPED_FOLDER / f"{suite}{PACKED}"
        (folder / suite / RUNS_FILE).write_bytes(lzma.decompress(packed.read_bytes()))
    return folder


def make_table(study: Study, name: str) -> pd.DataFrame:
    """Return a table of a study as it is stored, without ids of runs.

    The study must have one world. ``name`` is the id of a table of the report, or ``by-task``. The
    latter is not a table of the report, but the result of :func:`coartic.analysis.by_task`, from
    which pages compute means over tasks.
    """
    if name == "by-task":
        return by_task(study.runs).set_index("task")
    return TABLES[name](study).drop(columns="run_ids")


@cache
def table(suite: str, name: str, world: str = "") -> pd.DataFrame:
    """Return a stored table of a suite or a study, indexed by row names.

    If the suite is in :data:`NEW`, the table is first made again and stored. ``world`` is the world
    of the table; the empty string stands for the paper's world.
    """
    folder = STUDIES / suite if (STUDIES / suite).is_dir() else STORED / suite
    path = folder / f"{f'{name}-in-{world}' if world else name}.csv"
    if suite in NEW:
        frame = make_table(NEW[suite].worlds[world], name)
        frame.to_csv(path, float_format="%.6g", lineterminator="\n")
    return pd.read_csv(path, index_col=0)


def row(suite: str, name: str, which: str) -> dict[Any, Any]:
    """Return a row of a stored table as a dict.

    Raises KeyError if the table has no row with the name ``which``.
    """
    return table(suite, name).loc[which].to_dict()


def claim(name: str, study: str = "replication") -> dict[Any, Any]:
    """Return a judged claim of a study as a dict; ``name`` is its id."""
    return row(study, "claims", name)


def cells_of_the_paper() -> pd.DataFrame:
    """Return the rewards of the paper's cells, without the rows of single hand sequences."""
    rewards = table("replication", "rewards")
    return rewards[rewards.hands.isna()]


def verdicts(*, others: bool = False, published: bool = False) -> Counter[str]:
    """Return the number of claims about the paper's tasks for each verdict.

    The result is a dict that maps each verdict to the number of claims. If ``others`` is True, the
    three claims that carry the main point of the paper are left out. If ``published`` is True,
    claims about tasks with reconstructed goals are left out.
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
    """Return the number that follows some words in a claim's evidence.

    The number has its interval, if the evidence has it. If the words occur several times, ``which``
    says which occurrence is meant, from 0. The result is a string. Raises IndexError if there is no
    such number.
    """
    estimate = r":?\s*(−?\d+(?:\.\d+)?(?: \[[^]]*\])?)"
    number_behind = re.escape(words) + estimate
    return str(re.findall(number_behind, evidence, re.IGNORECASE)[which])


def p_of_shares(values: dict[Any, Any], published_runs: int) -> float:
    """Return the p-value of Fisher's exact test that compares our runs with the published runs.

    The null hypothesis is that our runs and the published runs learn a hand sequence equally often.
    ``values`` is a row of a stored table: ``runs`` of our ``of_runs`` runs learned the sequence,
    and ``values["published_runs"]`` of the published runs, whose number is the argument
    ``published_runs``.
    """
    counts = (values["published_runs"], published_runs), (values["runs"], values["of_runs"])
    return float(stats.fisher_exact([[n, of - n] for n, of in counts]).pvalue)


def published_spreads() -> pd.DataFrame:
    """Return the published spreads (±) of rewards, with tests of both readings.

    A spread can be read as a standard deviation or as a standard error. The published spread of a
    hand sequence is compared with our runs that have this sequence.
    """
    spreads = table("replication", "rewards").sort_values("hands", kind="stable")
    spreads = spreads.drop_duplicates(["task", "condition", "published_sd"]).dropna(subset="p_sd")
    return spreads.sort_index()


def gain_of_best_hands() -> float:
    """Return how much the corrective process gains from best instead of initial hands.

    The gain is in per cent of the distance from the reward with the initial hands to the best known
    reward. It is a mean over the random tasks of families with up to eight goals.
    """
    tasks = table("families", "by-task").query("method == 'corrective-alone/given'")
    share = tasks.share[~tasks.index.str.startswith("many-goals")]  # 0 is the best hands: negative
    return float((-100 * share / (1 - share)).mean())


@cache
def early_less_late(family: str) -> dict[str, float]:
    """Return how much more the informed learner gains than the paper's learner.

    The informed learner has 100 trials, and the paper's learner has 10,000 trials. The result is a
    dict with ``more`` and the ends of its interval, ``more_low`` and ``more_high``. ``more`` is the
    difference of the gains, a mean over the tasks of a family. A gain is in per cent of the
    distance from the reward of the corrective process to the best known reward.
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
"""Columns of the posture at goal 1 of the one-armed tasks: base (length units) and joints of the
right arm (rad)."""


def foreign_rows(study: Study) -> pd.DataFrame:
    """Return the runs of suite ``foreign`` or ``tuning``, with a row for each run.

    The frame is indexed by task. Only solved runs are included. Runs on the paper's one-armed tasks
    also have the posture at goal 1 (:data:`POSTURE`).
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
    """Return the gaps of suite ``foreign``, with a row for each method and setting.

    - ``gap``: mean gap on the paper's tasks, in per cent, with its interval for other runs;
    - ``random``: mean gap on random tasks, in per cent, with its interval for other tasks;
    - ``difference``: posture difference between ascending and descending at their first goal, in
      length units and rad.
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
    """Return the gaps of a method of the shipped suites, as a row of :func:`foreign_gaps`.

    The random tasks are those of suite ``foreign``. On each random task, the gap is a mean over
    three runs.
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
"""Largest number of comparisons (pairs of world and family) of study ``worlds`` that a sentence
lists."""


def in_worlds(claim: str) -> str:
    """Return in words in which worlds and families a claim of study ``worlds`` holds.

    A comparison is a pair of a world and a family; a claim about the lean has only the family
    *one-armed*. For each verdict, up to six comparisons are listed by name; more are only counted.
    """
    judged = table("worlds", "results").dropna(subset="verdict")
    judged = judged[judged.claim == claim]
    has_families = set(judged.group) != {"one-armed"}
    parts = []
    for verdict, words in (("holds", "it holds"), ("reversed", "reversed"), ("open", "open")):
        compared = judged[judged.verdict == verdict]
        if compared.empty and verdict != "holds":
            continue
        where = {
            world.title: [family for family in FAMILIES if family in {*compared.group[in_world]}]
            for name, world in WORLDS.items()
            if (in_world := compared.world == name).any()
        }
        names = [
            f"{title} ({', '.join(families)})" if has_families else title
            for title, families in where.items()
        ]
        counted = f" in {len(compared)}"
        if verdict == "holds":
            counted += f" of {len(judged)} {'comparisons' if has_families else 'worlds'}"
        listed = f": {', '.join(names)}" if 0 < len(compared) <= MAX_LISTED else ""
        parts.append(words + counted + listed)
    return f"{'; '.join(parts)}."


def filled_pages() -> dict[str, str]:
    """Fill in all templates, and return the pages by path below ``docs``."""
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
    """Draw the figures of the findings, and return SVGs by path below ``docs``."""
    return {
        f"stored/findings/{name}.svg": stored_picture(
            draw, table, *[early_less_late] * (name == "early-gain")
        )
        for name, draw in finding_figures.FIGURES.items()
    }


def draw_figure(study: Study, name: str) -> bytes:
    """Return a figure of a study's report as SVG, as it is stored.

    The study must have one world. ``name`` is the id of the figure.
    """
    return stored_picture(lambda: FIGURES[name](study, width=WIDTH).figure)


def forget_stored(results: dict[str, Study]) -> None:
    """Remove the stored tables and figures of the suites for which new results are given.

    ``results`` maps names of suites to studies, which are added to :data:`NEW`. Later, each page
    stores the tables that it uses again. The tables of suites ``foreign`` and ``tuning`` are stored
    at once instead.
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
    """Draw and store the figures of the suites in :data:`NEW` that pages show.

    ``pages`` are the texts of the pages.
    """
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
