"""Places in the ranking: intervals over other tasks and other runs, and which neighbours differ."""

import html
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import TABLES
from coartic.analysis.optima import BestKnown
from coartic.analysis.report.build import write_report
from coartic.analysis.standings import PLACES, neighbours, standings
from coartic.analysis.statistics import (
    are_separated,
    means_of_other_runs,
    means_on_other_tasks,
    place_intervals,
)
from coartic.analysis.study import load
from coartic.cli.read import say_ranking
from coartic.estimates import FEWER_RESAMPLES, SEED
from tests.support.made_up import change_runs, runs_of, study_of
from tests.support.suites import cells_of, run_and_write

BEST = -100
FAMILIES = ("one-armed/v1", "two-armed/v1")
PAPER = ("ascending", "two-armed-1")


def instances(family, count):
    return [f"{family}/i{number:03d}" for number in range(count)]


def planted(ticks, tasks, **more):
    """The study of methods that are so many ticks behind the optimum: a list for each task."""
    rows = [
        run for method, of_tasks in ticks.items()
        for task, of_runs in zip(tasks, of_tasks, strict=True)
        for run in runs_of(task, method, [BEST - each for each in of_runs])
    ]  # fmt: skip
    return study_of(rows, optima={task: BestKnown(BEST, BEST) for task in tasks}, **more)


def places(study):
    rows = TABLES["ranking"](study)
    return [(row.place, row.place_low, row.place_high) for row in rows.itertuples()]


def separated(study):
    """Of all but the last method, which has none."""
    *others, last = TABLES["ranking"](study).separated
    assert pd.isna(last)
    return others


def draws(sizes):
    """The rows of each resample of each stratum."""
    rng = np.random.default_rng(SEED)
    return [rng.integers(size, size=(FEWER_RESAMPLES, size)).tolist() for size in sizes]


def slowly(resampled):
    """Places and neighbours from the means of each resample, by loops."""
    count, lowest, highest = len(resampled[0]), [], []
    for means in resampled:
        lowest.append([1 + sum(other < mine - 1e-12 for other in means) for mine in means])
        highest.append([sum(other <= mine + 1e-12 for other in means) for mine in means])
    few = math.floor(0.025 * (len(resampled) - 1))
    due = [
        (sorted(row[k] for row in lowest)[few], sorted(row[k] for row in highest)[-1 - few])
        for k in range(count)
    ]
    apart = []
    for k in range(count - 1):
        low, high = np.percentile([row[k + 1] - row[k] for row in resampled], [2.5, 97.5])
        apart.append(low > 1e-12 or high < -1e-12)
    return due, apart


def test_tasks_are_resampled_within_families_by_brute_force():
    """All methods have the same tasks; one task of no family is in each resample."""
    rng = np.random.default_rng(3)
    strata = [rng.exponential(1 + np.arange(5) / 8, (size, 5)) for size in (6, 1, 9)]
    drawn, resampled = draws([6, 1, 9]), []
    for number in range(FEWER_RESAMPLES):
        tasks = [
            scores[row].tolist()
            for scores, of in zip(strata, drawn, strict=True)
            for row in of[number]
        ]
        resampled.append([sum(of) / 16 for of in zip(*tasks, strict=True)])
    means = means_on_other_tasks(strata)
    np.testing.assert_allclose(means, resampled)
    due, apart = slowly(resampled)
    assert place_intervals(means) == due
    assert are_separated(means) == apart
    assert len({*due}) > 2


def test_runs_are_resampled_within_tasks_by_brute_force():
    rng = np.random.default_rng(4)
    samples = [[rng.normal(mean, 1, size) for size in (5, 8)] for mean in (0.0, 0.1, 2.0)]
    drawn, resampled = draws([5, 8] * 3), []
    for number in range(FEWER_RESAMPLES):
        cells = [of[number] for of in drawn]
        runs = [[sum(cell[row] for row in cells.pop(0)) / len(cell) for cell in method]
                for method in samples]  # fmt: skip
        resampled.append([sum(of) / 2 for of in runs])
    means = means_of_other_runs(samples)
    np.testing.assert_allclose(means, resampled)
    assert (place_intervals(means), are_separated(means)) == slowly(resampled)
    assert place_intervals(means) == [(1, 2), (1, 2), (3, 3)]


def test_ties_take_all_places_of_their_methods():
    tied = np.array([[0.2, 0.1, 0.2, 0.2 + 1e-12]])
    assert place_intervals(tied) == [(2, 4), (1, 1), (2, 4), (2, 4)]
    assert are_separated(tied) == [True, True, False]


def test_a_method_that_is_better_on_every_task_is_separated():
    """By one tick, where tasks differ by much more."""
    tasks = [name for family in FAMILIES for name in instances(family, 4)]
    base = [[20 * number] for number in range(8)]
    worse = [[ticks + 1] for (ticks,) in base]
    last = [[ticks + 9] for (ticks,) in base]
    study = planted({"mine": worse, "yours": base, "theirs": last}, tasks)
    assert [*TABLES["ranking"](study).method] == ["yours", "mine", "theirs"]
    assert places(study) == [("1", 1, 1), ("2", 2, 2), ("3", 3, 3)]
    assert separated(study) == [True, True]
    assert neighbours(study) == "0 of 2 neighbours are not separated."


def test_exchangeable_methods_are_not_separated():
    """Each is better on half of the tasks; equal ones tie in every resample."""
    tasks = instances(FAMILIES[0], 8)
    ticks = {"mine": [[10], [30]] * 4, "yours": [[30], [11]] * 4, "last": [[90]] * 8}
    study = planted(ticks, tasks)
    assert places(study) == [("1–2", 1, 2), ("1–2", 1, 2), ("3", 3, 3)]
    assert separated(study) == [False, True]
    assert neighbours(study) == "1 of 2 neighbours is not separated."
    same = planted({"mine": ticks["mine"], "yours": ticks["mine"]}, tasks)
    assert places(same) == [("1–2", 1, 2)] * 2
    assert separated(same) == [False]
    assert neighbours(same) == "1 of 1 neighbour is not separated."


def test_each_family_keeps_its_number_of_tasks():
    """A method that is better in one family, and worse by less in the other, is better in every
    resample; where all tasks are of one family, some resamples have few of the former."""
    ticks = {"mine": [[20]] * 5 + [[60]] * 5, "yours": [[30]] * 5 + [[52]] * 5}
    two = planted(ticks, [name for family in FAMILIES for name in instances(family, 5)])
    assert places(two) == [("1", 1, 1), ("2", 2, 2)]
    assert separated(two) == [True]
    one = planted(ticks, instances(FAMILIES[0], 10))
    assert places(one) == [("1–2", 1, 2)] * 2
    assert separated(one) == [False]


def test_two_instances_of_a_family_are_too_few():
    ticks = {"mine": [[20]] * 5, "yours": [[30]] * 5}
    tasks = [*instances(FAMILIES[0], 3), *instances(FAMILIES[1], 2)]
    study = planted(ticks, tasks)
    assert standings(study)[[*PLACES[1:]]].isna().all(axis=None)
    assert neighbours(study) == ""
    assert "separated" in TABLES["ranking"](study)


def test_only_runs_are_resampled_on_fixed_tasks(capsys):
    """A deterministic method has one run, whose gap is exact; others need five."""
    runs = [20, 24, 22, 26, 28]
    ticks = {"plan": [[23]] * 2, "mine": [runs] * 2, "yours": [[each + 30 for each in runs]] * 2}
    study = planted(ticks, PAPER, deterministic=["plan"])
    assert places(study) == [("1–2", 1, 2), ("1–2", 1, 2), ("3", 3, 3)]
    assert separated(study) == [False, True]
    sentence = "1 of 2 neighbours is not separated. Only runs are resampled, because the tasks "
    assert neighbours(study) == f"{sentence}are fixed."
    change_runs(study, "commit", "")
    say_ranking(study, Path("out"))
    heading, *lines = capsys.readouterr().out.strip().splitlines()
    assert heading.split()[:2] == ["method", "place"]
    assert [line.split()[1] for line in lines[:2]] == ["1–2", "1–2"]
    assert f"Places {neighbours(study)}" in " ".join(" ".join(lines).split())

    few = planted({**ticks, "yours": [[50] * 4] * 2}, PAPER, deterministic=["plan"])
    assert neighbours(few) == ""
    change_runs(few, "commit", "")
    say_ranking(few, Path("out"))
    assert "lace" not in capsys.readouterr().out


def test_methods_that_are_not_ranked_have_no_place():
    """One that lacks a task would be the first."""
    tasks = instances(FAMILIES[0], 4)
    study = planted({"mine": [[20]] * 4, "yours": [[30]] * 4}, tasks)
    alone = planted({"mine": [[20]] * 4}, tasks)
    rows = runs_of(tasks[0], "theirs", [BEST])
    more = study_of([*study.runs.to_dict("records"), *rows], optima=study.optima)
    assert places(more) == places(study)
    assert standings(more).place["theirs"] == ""
    assert places(alone) == [("1", 1, 1)]
    assert neighbours(alone) == ""


def test_the_page_has_the_sentence_below_the_ranking(tmp_path):
    """With one arm, the given hands are the best."""
    cells = cells_of("paper", tasks=["ascending"], methods=["corrective-alone/*"])
    run_and_write(tmp_path / "results", cells, runs=1)
    study = load(tmp_path / "results")
    write_report(study, tmp_path / "report", for_paper=False)
    page = html.unescape((tmp_path / "report" / "report.html").read_text("utf-8"))
    below = page.partition('id="T_ranking"')[2].partition("</table>")[2]
    text = " ".join(re.sub("<[^>]+>", " ", below).split())
    assert text.startswith(neighbours(study))
    written = pd.read_csv(tmp_path / "report" / "tables" / "ranking.csv", dtype=str)
    assert written[[*PLACES]].fillna("").to_numpy().tolist() == [
        ["1–2", "1", "2", "False"],
        ["1–2", "1", "2", ""],
    ]
