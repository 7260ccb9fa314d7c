"""Runs in several worlds: each world is ranked by itself, by values that noise does not flatter."""

import io
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import (
    CoarticError,
    MotionModel,
    corrective_trial,
    execute,
    execute_noisy,
    load_task,
)
from coartic.analysis import FIGURES, TABLES, frames, load, ranking, runtimes, verify
from coartic.analysis.figures.drawings import practice_curves
from coartic.analysis.optima import BestKnown, best_known, run_values
from coartic.analysis.report import build
from coartic.analysis.report.build import write_report
from coartic.analysis.report.player import player
from coartic.analysis.standings import reference, standings
from coartic.cli.read import say_ranking
from coartic.motion.initial_hands import best_hands
from coartic.motion.solution import corrective_movements
from coartic.runs.plan import judge_seed, reference_seed
from coartic.runs.record import judge
from coartic.runs.store import open_store
from coartic.tasks.optima import best_shipped
from tests.support.made_up import runs_in_noise, runs_of, study_of
from tests.support.strategies import failing_task, tiny_task
from tests.support.suites import KNOWN, cell_on, edit, run_and_write

NOISE, MAXIMUM = "motor_noise=0.01", "norm=maximum"
NOISY, BY_COORDINATE = MotionModel(motor_noise=0.01), MotionModel(norm="maximum")
TASK = "ascending"
BEST = 305.5
"""Best known mean ticks in the planted world with noise."""


def planted(*rows, best=BEST):
    """A study of the paper's world and one with noise, whose best known rewards are planted."""
    paper = [*runs_of(TASK, "a", [-300, -302]), *runs_of(TASK, "b", [-310, -312]),
             *runs_of(TASK, "c", [-305, -306])]  # fmt: skip
    of_noise = [*runs_in_noise(TASK, "a", [310.0, 312.0]), *runs_in_noise(TASK, "b", [309.0, None])]
    study = study_of([*paper, *of_noise, *rows])
    for world, of_world in study.worlds.items():
        known = BestKnown(-292, -292) if not world else BestKnown(-best, None, only_here=True)
        vars(of_world).update(optima={TASK: known})
    return study


def test_like_is_ranked_with_like():
    """b failed once in noise, c has no run there, and d none in the paper's world; e is better
    than the reference by chance. All are methods of files, which a command can still add."""
    study = planted(*runs_in_noise(TASK, "d", [311.0]), *runs_in_noise(TASK, "e", [304.0, 305.0]))
    assert [*study.worlds] == ["", NOISE]
    paper, noise = map(standings, study.worlds.values())
    absent = (
        "no runs in this world; coartic run with its method file makes them, if it can run here"
    )
    assert paper.why.to_dict() == {"a": "", "c": "", "b": "", "d": absent, "e": absent}
    assert noise.why.to_dict() == {
        "e": "", "a": "", "d": "", "b": "1 of 2 runs failed", "c": absent
    }  # fmt: skip
    assert paper.gap["a"] == pytest.approx((301 - 292) / 292)
    gaps = {"e": (304.5 - BEST) / BEST, "a": (311 - BEST) / BEST, "d": (311 - BEST) / BEST}
    assert noise.gap.dropna().to_dict() == pytest.approx(gaps)
    tables = [TABLES["not-ranked"](of_world) for of_world in study.worlds.values()]
    counts = [dict(zip(table.method, table.runs, strict=True)) for table in tables]
    assert counts == [{"d": 0, "e": 0}, {"b": 2, "c": 0}]


def test_the_zero_of_the_share_meets_the_draws_of_each_run():
    """The corrective process with its best hands, by the seed of the judge of each number."""
    study = planted().worlds[NOISE]
    hands, _ = best_hands(load_task(TASK))
    zeros = [
        -execute_noisy(
            TASK, [corrective_movements(hands)], 0.01, 100, judge_seed(0, TASK, n)
        ).mean()
        for n in (0, 1)
    ]
    assert zeros[0] != zeros[1]
    runs = study.runs.set_index(["method", "run"])
    for n in (0, 1):
        assert {runs.corrective_best["a", n], runs.corrective_best["b", n]} == {zeros[n]}
    assert study.corrective_best[TASK] == pytest.approx(np.mean(zeros))
    shares = [(-310 - zeros[0]) / (-BEST - zeros[0]), (-312 - zeros[1]) / (-BEST - zeros[1])]
    assert standings(study).share["a"] == pytest.approx(np.mean(shares))
    assert runs.gap["a", 1] == pytest.approx((312 - BEST) / BEST)


def test_no_share_where_nothing_but_chance_is_gained():
    """The corrective process needs some 320.5 ticks: 0.2 % more than the second reference."""
    for best, has_share in ((400.0, False), (320.0, False), (310.0, True)):
        rows = standings(planted(best=best).worlds[NOISE])
        assert np.isfinite(rows.share["a"]) == has_share
        assert rows.without_gain["a"] == (not has_share)


def test_imports_are_those_of_methods_of_the_world():
    """Of a method from a file that has runs only in the paper's world."""
    rows = [runs_of(TASK, "b", [-300]), runs_of(TASK, "c", [-301])]
    study = study_of([*rows[0], *rows[1], *runs_in_noise(TASK, "b", [310.0])])
    study.imports.update(b=["numpy 2"], c=["scipy 1"])
    imports = {world: {*of_world.imports} for world, of_world in study.worlds.items()}
    assert imports == {"": {"b", "c"}, NOISE: {"b"}}


def test_values_of_all_worlds_are_in_one_frame():
    runs = planted().runs
    assert runs.value.tolist()[:6] == [-300, -302, -310, -312, -305, -306]
    assert runs.value.tolist()[6:9] == [-310, -312, -309]
    assert np.isnan(runs.value.iloc[9])
    assert runs.motor_noise.tolist() == [0.0] * 6 + [0.01] * 4
    assert runs.world.tolist() == [""] * 6 + [NOISE] * 4
    assert {*runs.norm} == {"euclidean"}
    assert {*runs.base_weight} == {1.0}
    assert run_values(pd.DataFrame({"reward": [-3, None]})).tolist()[:1] == [-3.0]


def test_a_ranking_of_two_worlds_is_refused():
    """Also of a file, where the empty name of the paper's world is read as missing."""
    runs = planted().runs
    stored = pd.read_csv(io.StringIO(runs.to_csv(index=False)))
    for frame in (runs, stored):
        for function in (ranking, frames.by_task):
            with pytest.raises(CoarticError, match=rf"the paper's world and the world {NOISE}; .*"):
                function(frame)
        rows = ranking(frame[frame.world == NOISE])
        assert rows.gap["a"] == pytest.approx((311 - BEST) / BEST)
        assert rows.why["b"] == "1 of 2 runs failed"
    assert frames.by_task(runs[runs.world == NOISE]).reward.tolist() == [-311.0, -309.0]
    assert frames.shares(runs).notna().sum() == 9  # runs are not compared with each other


def test_a_value_above_the_best_known_is_chance_only_in_noise():
    frame = pd.DataFrame({"method": "a", "task": "t", "reward": [np.nan], "mean_ticks": 290.0,
                          "best_known": -292.0})  # fmt: skip
    (gap,) = frames.by_task(frame.assign(motor_noise=0.01)).gap
    assert gap == pytest.approx(-2 / 292)
    with pytest.raises(CoarticError, match="above best_known"):
        frames.by_task(frame)
    with pytest.raises(CoarticError, match="must be minus the ticks"):
        frames.by_task(frame.assign(mean_ticks=-290.0))


def test_a_mean_that_is_missing_counts_as_a_failed_run():
    """An execution failed, and the corrective process has no ticks to stand for it."""
    missing = runs_in_noise(TASK, "d", [320.0, None], status="ok", failed_executions=[0, 3])
    rows = standings(planted(*missing).worlds[NOISE])
    assert (rows.why["d"], rows.failed["d"]) == ("1 of 2 runs failed", 1)
    assert rows.note["d"] == "3 executions failed"


def test_what_compares_runs_needs_one_world():
    study = planted()
    words = rf"the paper's world and the world {NOISE}, .*: study.worlds\['{NOISE}'\]"
    for needs in (
        lambda: study.optima, lambda: study.cells, lambda: study.corrective_best,
        lambda: study.sequences(TASK), lambda: study.executed(TASK, "a"),
        lambda: study.signature("first"), lambda: standings(study), lambda: runtimes(study),
        lambda: TABLES["ranking"](study), lambda: FIGURES["ranking"](study),
    ):  # fmt: skip
        with pytest.raises(CoarticError, match=words):
            needs()
    one = study.worlds[NOISE]
    assert one.worlds == {NOISE: one}
    assert len(study.methods) == 3


def test_tests_and_differences_are_of_values():
    """A learner and an own method with as many runs in noise as tests need: 3 ticks apart."""
    ticks = np.arange(10.0)
    study = planted(
        *runs_in_noise(TASK, "dual-process/EC1", [*310 + ticks / 10]),
        *runs_in_noise(TASK, "mine", [*307 + ticks / 10]),
    )
    noise = study.worlds[NOISE]
    ranked = TABLES["ranking"](noise)
    assert ranked.loc["mine", ["better", "worse"]].tolist() == [1, 0]
    (row,) = TABLES["differences"](noise).query("against == 'mine'").to_dict("records")
    assert row["method"] == "learner"
    assert row["difference"] == pytest.approx(3 / BEST)
    rows = TABLES["methods"](noise)
    assert rows.reward[f"{TASK} mine"] == pytest.approx(-307.45)
    assert player(noise) == ""  # the figure only moves in the paper's world


def test_a_failed_execution_costs_twice_the_corrective_process():
    """The left hand cannot leave the start where noise does not move it; the right one can."""
    task = failing_task(hands="L")
    answer = corrective_movements("L")
    means, failed = judge(task, [answer], NOISY, [3], 50)
    ticks = execute_noisy(task, [answer], 0.01, 50, 3)
    assert failed.tolist() == [np.isnan(ticks).sum()] == [50]
    assert means.tolist() == [2 * best_hands(task)[1]]


METHODS = "corrective-alone/best-hands", "random-search", "cma-es/bandit"
OWN = tiny_task(name="own", goals=[[4.0, 1.2], [4.2, 1.5]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Runs in the paper's world, with noise (without CMA-ES on the own task), and in the maximum
    norm (without random search)."""
    tasks = load_task(TASK), OWN
    cells = [cell_on(task, KNOWN[name]) for task in tasks for name in METHODS]
    noisy = [replace(cell, model=NOISY) for cell in cells[:5]]
    chosen = [replace(cell, model=BY_COORDINATE) for cell in cells if "search" not in cell.label]
    place = tmp_path_factory.mktemp("worlds") / "results"
    return run_and_write(place, [*cells, *noisy, *chosen], trials=60).folder


@pytest.fixture(scope="module")
def study(folder):
    return load(folder)


def test_references_in_noise_are_executed_afresh(study):
    """Of the runs on an own task the best by 1,000 executions with a seed of their own."""
    noise = study.worlds[NOISE]
    runs = noise.runs[noise.runs.task == OWN.name]
    with open_store(study.folder) as store:
        answers = {run_id: store.run(run_id).part("solution") for run_id in runs.run_id}
    seed = reference_seed(0, OWN.name)
    ticks = execute_noisy(OWN, answers.values(), 0.01, 1_000, seed).mean(axis=1)
    means = dict(zip(answers, ticks, strict=True))
    best = noise.optima[OWN.name]
    tried = runs.sort_values("mean_ticks").run_id[:5]
    assert best.reward == pytest.approx(-min(means[run_id] for run_id in tried))
    assert (best.bound, best.only_here, best.proven) == (None, True, False)
    if best.run_id:
        assert -best.reward == pytest.approx(means[best.run_id])
    assert {*runs.best_known} == {best.reward}
    assert reference(noise, [OWN.name]) == "best of this folder"


def test_shipped_references_are_those_of_the_world(study):
    """A run that is better by its 1,000 executions takes the place of a shipped solution."""
    assert study.worlds[""].optima[TASK].source == "shipped"
    best = study.worlds[NOISE].optima[TASK]
    assert (best.source, best.reward) == ("shipped", best_shipped(load_task(TASK), NOISY).reward)
    rows = study.worlds[NOISE].stored
    models = dict.fromkeys(rows.task.unique(), NOISY)
    better = best_known(
        rows, [load_task(TASK)], models=models, fresh=lambda _, ids: [-290.5] * len(ids)
    )
    assert better[TASK].reward == -290.5
    assert better[TASK].source != "shipped"


def test_other_lengths_have_other_zeros_and_references(study):
    """In the maximum norm nothing is shipped, and the corrective process has its own ticks."""
    of_norm = study.worlds[MAXIMUM]
    hands, ticks = best_hands(load_task(TASK), BY_COORDINATE)
    assert ticks < best_hands(load_task(TASK))[1]
    assert of_norm.corrective_best[TASK] == -ticks
    assert of_norm.sequences(TASK).iloc[0][["hands", "reward"]].tolist() == [hands, -ticks]
    best = of_norm.runs[of_norm.runs.task == TASK].reward.max()
    assert (of_norm.optima[TASK].reward, of_norm.optima[TASK].only_here) == (best, True)
    rows = standings(of_norm)
    assert rows.why["random-search"] == "no runs in this world"
    assert rows.gap["cma-es/bandit"] >= 0.0
    alone = of_norm.signature("whole", TASK, "corrective-alone/best-hands")
    assert alone.tolist() == [0.0]
    assert TABLES["tasks"](of_norm).best_hands[TASK] == -ticks


def test_answers_in_noise_are_executed_without_it(study):
    """In their world, and the corrective process corrects what misses."""
    noise = study.worlds[NOISE]
    stored = noise.movements()
    assert stored.keys() == {*noise.runs.run_id}
    executed = noise.executed(TASK, "random-search")
    assert len(executed.runs) == 2
    for run_id, run in zip(executed.run_ids, executed.runs, strict=True):
        assert all(movement.ticks is None for movement in stored[run_id])
        due = execute(TASK, stored[run_id])
        assert run.completed
        assert (run.ticks, run.hands) == (due.ticks, due.hands)
        alone = corrective_trial(TASK, run.hands)
        saved = np.subtract(run.ticks_by_goal(), alone.ticks_by_goal())
        assert executed.against_same_hands[executed.run_ids.index(run_id)].tolist() == [*saved]
    assert {*noise.solutions.run_id} == {*noise.runs.run_id}
    assert {*study.solutions.run_id} == {*study.runs.run_id}


def test_the_learning_curve_in_noise_shows_practice(study):
    noise = study.worlds[NOISE]
    curves = practice_curves(noise)
    curve = curves[(curves.task == TASK) & (curves.method == "cma-es/bandit")]
    runs = noise.cells[TASK, "cma-es/bandit"]
    means = -np.mean([json.loads(text) for text in runs.practice], axis=0)
    assert curve["mean"].to_numpy() == pytest.approx(means)
    assert curve.trial.tolist() == [3, 9, 15, 21, 27, 33, 39, 45, 51, 57]  # of 60 trials
    assert "in each tenth" in FIGURES["learning-curves"](noise).caption
    assert not len(TABLES["learning"](noise))
    assert not len(TABLES["runtimes"](noise))
    with pytest.raises(CoarticError, match=f"the world {NOISE}, where the reward of a single"):
        runtimes(noise)


def test_report_and_tables_name_the_worlds(study, tmp_path, monkeypatch):
    monkeypatch.setattr(build, "picture", lambda *_: b"")  # drawn for the page already
    files, failures = write_report(study, tmp_path / "report")
    assert failures == {}
    page = (tmp_path / "report" / "report.html").read_text()
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len({*ids})
    assert page.count("<h2 id=") == page.count("<section ")
    for world, name in ((NOISE, "motor-noise-0-01"), (MAXIMUM, "norm-maximum")):
        section = page.partition(f'<h2 id="world-{name}">')[2].partition("</section>")[0]
        assert f"The world {world}" in section
        assert "best of this folder" in section
        assert f'id="figure-ranking-{name}"' in section
        assert f"T_not-ranked-{name}" in section
        assert "no runs in this world" in section or world == NOISE
        assert f"figures/learning-curves-{name}.svg" in files
    table = pd.read_csv(tmp_path / "report" / "tables" / "ranking.csv", keep_default_na=False)
    assert table.world.tolist() == [""] * 3 + [NOISE] * 2 + [MAXIMUM] * 2
    latex = (tmp_path / "report" / "tables" / "ranking.tex").read_text()
    assert latex.count("begin{longtable}") == 3
    assert "the world motor\\_noise=0.01" in latex
    assert "{tab:coartic-ranking-norm-maximum}" in latex


def test_commands_name_the_worlds(study, coartic, capsys):
    say_ranking(study, study.folder)
    paper, noise, of_norm = capsys.readouterr().out.split("The world ")
    assert paper.startswith("The paper's world:\n")
    assert noise.startswith(f"{NOISE}:\n")
    assert "best known reward or best of this folder in this world" in " ".join(noise.split())
    assert "Not ranked  1 of 2 tasks: CMA-ES" in noise
    assert "no runs in this world: random search" in of_norm
    assert "optimum/search" not in of_norm  # it takes no other norm
    _, listed, _ = coartic("list", study.folder)
    assert listed.count(NOISE) == len(study.worlds[NOISE].runs)
    run_id = study.worlds[NOISE].runs.run_id.iloc[0]
    code, out, _ = coartic("verify", study.folder, "--run", run_id)
    assert (code, f"World       {NOISE}" in out, "mean ticks" in out) == (0, True, True)
    _, cited, _ = coartic("cite", study.folder)
    assert "runs in the paper's world, the world motor\\_noise=0.01 and the world norm" in cited
    code, out, error = coartic("verify", study.folder)
    assert (code, "Nothing differs." in out, error) == (0, True, "")


def test_a_report_of_one_world_with_noise(tmp_path):
    cells = [replace(cell_on(OWN, KNOWN[name]), model=NOISY) for name in METHODS[:2]]
    study = run_and_write(tmp_path / "results", cells, trials=20)
    assert study.worlds == {NOISE: study}
    write_report(study, tmp_path / "report", for_paper=False)
    page = (tmp_path / "report" / "report.html").read_text()
    assert f"in the world {NOISE}, made with coartic" in page
    assert "Running times are not shown" in page
    table = pd.read_csv(tmp_path / "report" / "tables" / "ranking.csv")
    assert {*table.world} == {NOISE}


def test_a_task_that_the_corrective_process_does_not_complete(tmp_path):
    """There is no zero; all runs fail, and are listed."""
    task = failing_task(hands="L").model_copy(update={"hands": ("left",)})
    cells = [replace(cell_on(task, KNOWN[name]), model=NOISY) for name in METHODS]
    study = run_and_write(tmp_path / "results", cells, trials=20)
    assert np.isnan(study.corrective_best[task.name])
    assert study.runs.value.isna().all()
    assert study.optima == {}
    assert TABLES["failed"](study).failed.sum() == len(study.runs)


EDITS = {
    "no answer in noise": "movements = json_set(movements, '$.solution[0][3]', 5)",
    "the task has no middle hand": "movements = json_set(movements, '$.solution[1][1]', 'middle')",
    "reward is None": "reward = -300",
    "replay_reward is None": "replay_reward = -300",
    "hands is RR": "hands = 'LL'",
    "that its id says": "run = 60",
    "its seed is another": "seed = seed + 1",
    "a joint or a trial was changed": "result = 'x'",
}


@pytest.mark.parametrize("words", EDITS)
def test_an_edit_of_an_answer_is_found(folder, tmp_path, words):
    copy = shutil.copytree(folder, tmp_path / "edited")
    where = "run_id = (SELECT min(run_id) FROM runs WHERE world LIKE 'motor%' AND task = 'own')"
    edit(copy, f"UPDATE results SET {EDITS[words]} WHERE {where}")
    wrong = verify.check_runs(copy).wrong
    assert len(wrong) == 1
    assert words in wrong[0]


def test_another_world_is_found(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "edited")
    edit(copy, f"UPDATE cells SET world = '' WHERE world = '{NOISE}'")
    report = verify.check_runs(copy)
    with open_store(folder) as store:
        assert len(report.wrong) == (store.runs().world == NOISE).sum()
