"""Searches for what the paper does not print, and judges its claims under every choice.

``python docs/scripts/reconstruct.py goals|readings|claims --help``, in a checkout in which coartic
is installed. docs/reconstruction.md describes the search; its results come with the package
(``coartic/tasks/members``, ``analysis/reconstruction``, ``analysis/claims/ensemble.csv``).
"""

from __future__ import annotations

import argparse
import sys

import pandas as pd
from reconstruction.ensemble import QUICK, Effort, reconstruct
from reconstruction.readings import combinations, judge_readings
from reconstruction.search import search_for

from coartic import CoarticError
from coartic.analysis import load
from coartic.analysis.claims.specifications import judge_specifications, shares
from coartic.cli.terminal import say, show_frame
from coartic.files import check_folder, folder_named, publish


def goals(given: argparse.Namespace) -> dict[str, pd.DataFrame]:
    """Search for goals that give the printed results; the ensemble, and sets left by each step."""
    effort = QUICK if given.quick else Effort()
    search = search_for(given.task, readings=given.reading, jobs=given.jobs, quick=given.quick)
    ensemble = reconstruct(search, effort, say)
    tried = pd.DataFrame(search.tried.items(), columns=["stage", "sets of goals"])
    say(
        f"The nearest set lies {ensemble.distance[0]:.2f} standard errors from the printed results."
    )
    return {f"{given.task}-members.csv": ensemble, f"{given.task}-tried.csv": tried}


def readings(given: argparse.Namespace) -> dict[str, pd.DataFrame]:
    """Judge every reading by the printed results of the one-armed tasks."""
    table = judge_readings(
        combinations(given.pairs),
        runs=given.runs,
        trials=given.trials,
        jobs=given.jobs,
        progress=lambda combined, p: say(f"{combined}: p = {p:g}"),
    )
    show_frame(table[["readings", "log likelihood", "p", "verdict"]])
    return {"readings.csv": table}


def claims(given: argparse.Namespace) -> dict[str, pd.DataFrame]:
    """Judge the paper's claims under other readings and goals."""
    table = judge_specifications(
        map(load, map(folder_named, given.folders)),
        jobs=given.jobs,
        progress=lambda specification: say(f"Judged: {specification}"),
    )
    if table.empty:
        raise CoarticError(
            "no claim of the paper can be judged there. Run its conditions with 10 000 trials."
        )
    counts = shares(table)
    show_frame(counts)
    return {"specifications.csv": table, "shares.csv": counts}


def parser() -> argparse.ArgumentParser:
    """Arguments of the three commands."""
    every = argparse.ArgumentParser(add_help=False)
    every.add_argument("--out", required=True, metavar="FOLDER", help="folder for the results")
    every.add_argument("--jobs", type=int, default=-1, metavar="N", help="-1 is one for each core")
    whole = argparse.ArgumentParser(description=__doc__)
    commands = whole.add_subparsers(required=True)
    for command in (goals, readings, claims):
        one = commands.add_parser(command.__name__, parents=[every], help=command.__doc__)
        one.set_defaults(command=command)
        if command is goals:
            one.add_argument("task", help="task whose goals are not printed")
            one.add_argument("--reading", action="append", default=[], metavar="NAME=VALUE")
            one.add_argument("--quick", action="store_true", help="a small search, to try it out")
        elif command is readings:
            one.add_argument("--runs", type=int, default=1000, help="runs of each reading and task")
            one.add_argument("--trials", type=int, default=10_000, help="trials of each run")
            one.add_argument("--pairs", action="store_true", help="also every two of them together")
        else:
            one.add_argument("folders", nargs="+", help="results folders, one of each reading")
    return whole


def main() -> None:
    """Run a command and write its tables."""
    given = parser().parse_args()
    try:
        out = folder_named(given.out, "--out")
        check_folder(out, [])
        tables = given.command(given)
        files = {
            name: table.to_csv(index=False, lineterminator="\n").encode()
            for name, table in tables.items()
        }
        publish(out, files)
    except CoarticError as error:
        sys.exit(f"Error: {error}")
    say(*(f"Written: {out / name}" for name in files))


if __name__ == "__main__":
    main()
