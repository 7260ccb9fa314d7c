"""How far methods end from the optimum, who is ahead, and what it costs: by hand."""

import itertools
import json
import math
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError
from coartic.analysis import FIGURES, TABLES, ranking, running_times, standings, tables
from coartic.analysis.methods import (
    BY_TRIAL,
    WITHOUT_REWARD,
    headline_methods,
)
from coartic.analysis.report.sections import SECTIONS, failed_methods, finding
from coartic.analysis.statistics import holm, stratified_test
from coartic.analysis.study import Study
from coartic.analysis.tables import shown_columns
from coartic.analysis.words import number
from tests.support.made_up import MadeUp, change_runs, made_up_optima, row, runs_of, study_of
from tests.support.made_up import study_of_rewards as study

EC1, BOTH = "dual-process/EC1", "learner"
LEARNER = {("ascending", EC1): [-300, -301, -302, -303],
           ("two-armed-1", "dual-process/EC4"): [-480, -481, -482, -483]}  # fmt: skip
CMA = {("ascending", "cma-es/bandit"): [-293, -294, -293, -294],
       ("two-armed-1", "cma-es/bandit"): [-466, -467, -468, -466]}  # fmt: skip


def test_conditions_for_one_arm_and_for_two_are_ranked_as_one():
    """EC1 with EC4, or one of them; EC1 alone if it ran on both tasks itself."""
    better = {("two-armed-1", "dual-process/EC3"): [-470, -471, -470, -471]}
    rows = standings.standings(study(LEARNER | better))
    assert rows.why.to_dict() == {BOTH: "", "dual-process/EC3": "1 of 2 tasks"}
    one = {cell: of for cell, of in LEARNER.items() if cell[1] == EC1}
    assert standings.standings(study(one)).why.to_dict() == {BOTH: ""}
    alone = standings.standings(study(LEARNER | {("two-armed-1", EC1): [-500] * 4}))
    assert alone.why.to_dict() == {EC1: "", "dual-process/EC4": "1 of 2 tasks"}


def test_a_method_that_makes_one_trial_does_not_use_its_reward():
    """The corrective process alone uses the reward of its only trial, and of every hand
    sequence."""
    alone = study({("ascending", "corrective-alone/given"): [-319]} | LEARNER)
    assert alone.methods.information["corrective-alone/given"] == BY_TRIAL  # of ten trials
    change_runs(alone, "trials", 1, alone.runs.method == "corrective-alone/given")
    again = MadeUp(alone, optima=made_up_optima("ascending", "two-armed-1"))
    assert again.methods.information["corrective-alone/given"] == WITHOUT_REWARD
    assert again.methods.information[BOTH] == BY_TRIAL


def test_the_interval_of_a_share_by_brute_force():
    rng = np.random.default_rng(5)
    spends = [rng.lognormal(3, 1, (runs, 20)).round() for runs in (6, 9)]
    spends[1][rng.random(spends[1].shape) < 0.3] = math.inf
    at = np.quantile(spends[0], [0.1, 0.5])
    drawn = [
        np.mean([(part[rng.integers(0, len(part), len(part))][..., None] <= at).mean((0, 1))
                 for part in spends], axis=0) for _ in range(2000)
    ]  # fmt: skip
    due = np.quantile(drawn, [0.025, 0.975], axis=0)
    assert np.array(running_times.interval_by_budget(spends, at)) == pytest.approx(due, abs=0.015)


def test_a_failed_run_reaches_nothing():
    """Of four runs the first is cold, so that its time is not known, and two fail."""
    learner, other = "dual-process/EC1", "posture-based/two-goals"
    rewards = {learner: [-300] * 4, other: [-305, -305, None, None]}
    seen = study({("ascending", method): of for method, of in rewards.items()})
    change_runs(seen, "reason", "time limit", seen.runs.reward.isna())
    (failed,) = TABLES["failed"](seen).to_dict("records")
    assert (failed["method"], failed["failed"]) == (other, 2)
    assert failed["reasons"] == "2 × time limit"
    assert TABLES["runtimes"](seen).reached[other] == pytest.approx(2 / 4 * 10 / 20)
    times = running_times.times_of(seen, "ascending", other, "solve_s")
    assert np.isfinite(times).sum(axis=1).tolist() == [10, 0, 0]


SPREAD = np.array([0, 1, -1, 0, 1, -2, 0, 2, -1, 0])
TEN = {("ascending", "dual-process/EC1"): list(SPREAD - 303),
       ("two-armed-1", "dual-process/EC4"): list(SPREAD - 485)}  # fmt: skip


def strangers(*methods, runs):
    """Rows of methods from files, each so many ticks better than the learner on both tasks."""
    return {
        (task, name): [mean + better + (-1) ** k for k in range(runs)]
        for name, better in methods
        for task, mean in (("ascending", -303), ("two-armed-1", -485))
    }


def test_better_and_worse_are_of_one_methods_tests():
    """Holm's correction is over one method's tasks, so that other methods change nothing."""
    unsure = {(task, "unsure"): [reward + 9, reward - 8] * 5
              for task, reward in (("ascending", -303), ("two-armed-1", -485))}  # fmt: skip
    seen = study(TEN | unsure | strangers(("mine", 2), ("yours", 3), ("theirs", 0), runs=10))
    rows = TABLES["ranking"](seen)[["better", "worse"]]
    assert rows.loc["mine"].tolist() == [2, 0]
    assert rows.loc["unsure"].tolist() == [0, 0]  # half a tick better on both tasks
    assert rows.loc[BOTH].isna().all()  # the learner is not compared with itself


@pytest.mark.parametrize("runs", [6, 10])
def test_a_test_that_cannot_reject_counts_nothing(runs):
    """Signs of runs against a number have a p of 2/64 or 2/1024 at least; on two tasks it is twice
    that."""
    few = {key: rewards[:runs] for key, rewards in TEN.items()}
    plan = {(task, "my-plan"): [reward] for task, reward in
            (("ascending", -293), ("two-armed-1", -466))}  # fmt: skip
    seen = study(few | plan, deterministic=["my-plan"])
    row_of = TABLES["ranking"](seen).loc["my-plan"]
    expected = (2, 0) if runs == 10 else (math.nan, math.nan)
    assert (row_of.better, row_of.worse) == pytest.approx(expected, nan_ok=True)


def test_without_an_optimum_gaps_are_to_the_best_of_the_folder():
    """-293 and -480 of the learner, where goals are larger than those of the shipped tasks."""
    mine = {("ascending", "mine"): [-300, -293], ("two-armed-1", "mine"): [-500, -490]}
    seen = study(LEARNER | mine)
    larger = [task.model_copy(update={"radius": 0.11}) for task in seen.tasks.values()]
    unknown = study_of(seen.runs.assign(commit=""), larger)
    ranked = TABLES["ranking"](unknown)
    gaps = {"mine": [3.5 / 293, 15 / 480], BOTH: [8.5 / 293, 1.5 / 480]}
    for method, of_method in gaps.items():
        assert ranked.gap[method] == pytest.approx(sum(of_method) / 2)
    assert TABLES["tasks"](unknown).source.tolist() == ["mine", "dual-process/EC4"]


def test_ranked_is_who_solved_all_tasks():
    """The others have a reason, and their gaps on single tasks."""
    others = {("ascending", "mine"): [-300, -301, -302], ("ascending", "failed"): [-292] * 3,
              ("two-armed-1", "failed"): [-465, None, None]}  # fmt: skip
    seen = study(LEARNER | CMA | others)
    assert TABLES["ranking"](seen).index.tolist() == ["cma-es/bandit", BOTH]
    others = TABLES["not-ranked"](seen)
    why = {"mine": "1 of 2 tasks", "failed": "2 of 6 runs failed"}
    assert others.why.to_dict() == why
    assert others.tasks.to_dict() == {"mine": 1, "failed": 1}  # of all runs
    assert others["on ascending"].to_dict() == pytest.approx({"mine": 9 / 292, "failed": 0})
    assert others.gap.isna().all()
    (axes,) = FIGURES["ranking"](seen).figure.axes
    names = {text.get_text() for text in axes.get_yticklabels()}
    assert names - {""} == {"CMA-ES", "learner (EC1, EC4)"}
    ranked = ranking(seen.runs)
    assert ranked.gap.dropna().to_dict() == TABLES["ranking"](seen).gap.to_dict()
    assert ranked.why[ranked.why != ""].to_dict() == why


def with_trials(seen, by_method, of_command=None):
    """The study, its methods asked for numbers of trials, 10 for others than are named."""
    plan = []
    for job in seen.plan:
        asked = {"trials": by_method.get(job.cell.method.name, 10)}
        method = replace(job.cell.method, defaults=asked)
        cell = replace(job.cell, method=method, parameters=asked)
        plan.append(replace(job, cell=cell, trials=of_command))
    runs = seen.stored.assign(trials=seen.stored.method.map(by_method).fillna(10).astype(int))
    changed = Study(seen.folder, plan, seen.made_with, runs)
    return MadeUp(changed, optima=seen.optima, rewards=seen.rewards)


BEST = {("ascending", "mine"): [-292] * 3, ("two-armed-1", "mine"): [-465] * 3}


@pytest.mark.parametrize(
    ("trials", "of_command", "budget", "why"),
    [
        ({"mine": 40}, None, 10, "40 trials, not 10"),
        ({"mine": 40}, 40, 40, ""),  # which the command asks for
        ({"mine": 40, "cma-es/bandit": 40}, 99, 40, ""),  # most algorithms have it
        ({"mine": 0}, None, 10, ""),  # without trials
    ],
)
def test_methods_are_ranked_and_compared_with_equal_trials(trials, of_command, budget, why):
    seen = with_trials(study(LEARNER | CMA | BEST), trials, of_command)
    assert standings.ranking_budget(seen) == budget
    rows = standings.standings(seen)
    assert rows.why["mine"] == why
    assert rows.gap["mine"] == 0  # of all tasks, with whatever trials
    unlike = {name for name in rows.index if trials.get(name, 10) not in (budget, 0)}
    assert {*TABLES["not-ranked"](seen).index} == unlike
    alike = {name for name, made in trials.items() if made == trials["mine"]} - {"mine"}
    assert {*TABLES["differences"](seen).method} == alike
    lines = [line for line in said(seen) if " points " not in line]
    assert any("mine" in line for line in lines) == (not why)


def test_a_method_of_a_file_that_stops_early_has_a_note():
    seen = with_trials(study(LEARNER | BEST), {})
    assert standings.standings(seen).note["mine"] == ""
    change_runs(seen, "trials", 4, seen.runs.run.eq(1) & seen.runs.method.eq("mine"))
    early = MadeUp(seen, optima=seen.optima, rewards=seen.rewards)
    assert standings.standings(early).note["mine"] == "made 4 to 10 of 10 trials"


def test_two_budgets_are_refused_in_a_frame():
    seen = with_trials(study(LEARNER | CMA | BEST), {"mine": 40, "cma-es/bandit": 0})
    with pytest.raises(CoarticError, match="10 and 40 trials.*budget == 10"):
        ranking(seen.runs)
    frame = seen.runs
    ranked = ranking(frame[frame.budget.isna() | (frame.budget == 10)])
    assert ranked.index.tolist() == ["cma-es/bandit", BOTH]
    assert (ranked.why == "").all()


def test_a_study_of_numbers_of_trials_is_ranked_whole():
    settings = "trials=10", "trials=40"
    seen = with_settings(*settings)
    assert standings.ranking_budget(seen) is None
    rows = TABLES["ranking"](seen)
    assert rows.index.tolist() == [f"learner {setting}" for setting in settings[::-1]]


def test_an_own_method_is_compared_on_the_tasks_that_it_solved():
    """A positive difference is in its favour; the built-in method with the smallest gap is first,
    and methods with failed runs there, or with another use of the reward, are left out."""
    built_in = {("ascending", "hill-climbing"): [-300, None],
                ("ascending", "corrective-alone/given"): [-319]}  # fmt: skip
    seen = study(TEN | CMA | built_in | {("ascending", "mine"): [-309, -301]})
    change_runs(seen, "trials", 1, seen.runs.method == "corrective-alone/given")
    seen = MadeUp(seen, optima=made_up_optima("ascending", "two-armed-1"))
    rows = TABLES["differences"](seen)
    others = ["cma-es/bandit", "learner"]
    assert rows.index.tolist() == [f"mine {name}" for name in others]
    differences = [1.5 / 292 - 13 / 292, 11 / 292 - 13 / 292]
    assert rows.difference.tolist() == pytest.approx(differences)
    shown = shown_columns(TABLES["differences"], seen, rows)["difference"].texts
    assert shown[0] == number(100 * differences[0], 1)  # per cent, as the gaps
    assert math.isnan(rows.difference_low.iloc[0])  # of two runs there is no interval
    assert (rows.tasks == 1).all()
    same = {("ascending", "same"): list(SPREAD - 303)}
    both = TABLES["differences"](study(TEN | same | strangers(("better", 2), runs=10)))
    assert (both.difference_low[both.against == "better"] > 0).all()
    # Runs with the same seeds are not matched.
    assert (both.difference_low[both.against == "same"] < 0).all()


def test_the_sentence_says_how_far_an_own_method_is_behind_or_ahead():
    """Points are positive, with their intervals, and p is said to be corrected, once."""
    ten = {cell: (rewards * 3)[:10] for cell, rewards in CMA.items()}
    seen = study(TEN | ten | strangers(("mine", 4), runs=10))
    rows = TABLES["differences"](seen).set_index("method").difference
    (line,) = [line for line in said(seen) if " points " in line]
    (cma, learner) = (number(100 * abs(rows[name]), 1) for name in ("cma-es/bandit", BOTH))
    assert line.startswith(f"“mine” is {cma} [")
    assert re.search(rf"{cma} \[\d[^−]*\] points behind CMA-ES \(p.<.0.001\), {learner} \[", line)
    assert "] ahead of the learner (EC1, EC4) (p" in line
    assert line.endswith("p is corrected over 2 comparisons, intervals are not.")


def test_methods_with_failed_runs_are_named_first():
    seen = study(TEN | {("ascending", "flaky"): [-300, None], ("two-armed-1", "flaky"): [-480] * 2})
    assert failed_methods(seen) == ["1 of 4 runs failed (flaky): it is not ranked."]
    assert "only ranked method using" in said(seen)[0]
    assert failed_methods(study(TEN)) == []


def test_all_methods_are_compared_with_a_method_of_choice():
    """Own and built-in methods alike, with p corrected for their number."""
    eight = {cell: rewards * 2 for cell, rewards in CMA.items()}
    seen = study(TEN | eight | strangers(("a", 2), ("b", 0), runs=10))
    others = {"b", "cma-es/bandit", BOTH}
    with_a = TABLES["differences"](MadeUp(seen, against="a", optima=seen.optima))
    assert {*with_a.method} == others
    assert (with_a.against == "a").all()
    ahead = np.mean([2 / -best.reward for best in seen.optima.values()])  # two ticks on each task
    assert with_a.difference["a b"] == pytest.approx(ahead)

    def gaps(name):
        return [of_task.to_numpy(float) for _, of_task in
                standings.runs_on(seen, name, seen.tasks).groupby("task").gap]  # fmt: skip

    p = [stratified_test([*zip(gaps(name), gaps("a"), strict=True)]) for name in with_a.method]
    assert with_a.p_holm.tolist() == pytest.approx(holm(p))
    assert (with_a.p_holm < 0.05).all()


def with_settings(*settings, tasks=("ascending",), more=()):
    """The learner with settings of its noise, each 4 ticks nearer than the setting before."""
    rows = [
        run for task in tasks for nearer, setting in enumerate(settings)
        for run in runs_of(task, EC1, [4 * nearer - cost for cost in (500, 501, 503, 501, 502)],
                           setting=setting)
    ]  # fmt: skip
    return study_of([*rows, *more], optima=made_up_optima(*tasks))


def test_settings_are_ranked_as_methods_are():
    between = runs_of("ascending", "hill-climbing", [-494] * 3)
    own = [run for at in ("", "width=0.2") for run in runs_of("ascending", "mine", [-510] * 3,
                                                               setting=at)]  # fmt: skip
    seen = with_settings("", "noise_sd=0.1", "noise_sd=0.2", more=[*between, *own])
    ranked = TABLES["ranking"](seen)
    settings = ["learner noise_sd=0.2", "hill-climbing", "learner noise_sd=0.1", "learner"]
    assert ranked.index.tolist() == [*settings, "mine", "mine width=0.2"]
    means = [493.4, 494, 497.4]
    assert ranked.gap.tolist()[:3] == pytest.approx([(mean - 292) / 292 for mean in means])
    assert (ranked.gap_low < ranked.gap_high)[settings[::2]].all()
    page = tables.html_of(TABLES["ranking"], seen, ranked)
    is_bold = ['class="own ' in row for row in page.split("<tr>")[2:]]
    assert is_bold == [label.startswith("mine") for label in ranked.index]


def test_ranked_tasks_have_the_order_of_the_study():
    """Tests draw signs by position: the order of a set would change p from run to run."""
    tasks = "two-armed-2", "ascending", "two-armed-1"
    assert standings.ranked_tasks(with_settings("", "noise_sd=0.1", tasks=tasks)) == tasks


def test_learners_over_all_tasks_stand_for_their_conditions():
    """The paper's and the informed one, each under its conditions for one arm and for two."""
    learner, informed = (
        [f"dual-process/{name}{ending}" for name in ("EC1", "EC4")] for ending in ("", "-informed")
    )
    rewards = {
        (task, label): [-400, -401, -402]
        for one, two in (learner, informed)
        for task, label in (("ascending", one), ("two-armed-1", two))
    }
    learned = study(rewards)
    together = [BOTH, "informed learner"]
    assert headline_methods(learned.methods.loc[learned.runs.ranked_as.unique()]) == together
    titles = ["learner (EC1, EC4)", "informed learner (EC1, EC4)"]
    assert learned.methods.title[together].tolist() == titles
    both = study({("two-armed-1", label): [-400, -401, -402] for label in learner})
    assert [*both.methods.index] == learner  # EC1 adds no task


def said(seen):
    """The finding on the ranking, its lines."""
    return finding(seen, SECTIONS[0])


def grid(gap, spread=(-1, 0, 0, 0, 1), **values):
    """A study of the learner with each combination of values, the first of which are the defaults.

    ``gap`` is a function of the values: the mean ticks by which runs miss the optimum.
    """
    rows = []
    for combination in itertools.product(*values.values()):
        parameters = dict(zip(values, combination, strict=True))
        setting = ", ".join(f"{name}={value}" for name, value in parameters.items()
                            if value != values[name][0])  # fmt: skip
        rewards = [-292 - gap(*combination) - more for more in spread]
        rows += runs_of("ascending", EC1, rewards, setting=setting,
                        parameters=json.dumps(dict(sorted(parameters.items()))))  # fmt: skip
    return study_of(rows, optima=made_up_optima("ascending"))


NOISE, EPSILON = [0.05, 0.02, 0.1], [0.2, 0.1]


def by_value(seen):
    """The rows of table ``parameters``, by parameter and value."""
    return TABLES["parameters"](seen).set_index(["parameter", "value"])


def test_each_parameter_has_a_sentence_and_a_panel_with_its_means_over_the_others():
    """Of two, three or more; values in the order of their size, the paper's marked."""
    noise = [0.05, 0.02, 0.1]
    seen = grid(
        lambda noise, epsilon, width: int(100 * noise) + 40 * (epsilon == 0.1),
        noise_sd=noise, epsilon=EPSILON, width=[1, 2],
    )  # fmt: skip
    titles = seen.methods.title
    assert titles[EC1] == "learner EC1 (noise_sd 0.05, epsilon 0.2, width 1, the paper's)"
    rows = by_value(seen)
    for value in noise:
        mean = (100 * value + 20) / 292
        assert rows.gap["noise_sd", str(value)] == pytest.approx(mean)
        assert rows.at_best["noise_sd", str(value)] == pytest.approx(100 * value / 292)
    assert rows.gap["epsilon"].to_dict() == pytest.approx(
        {"0.2": 17 / 3 / 292, "0.1": 137 / 3 / 292}
    )
    assert rows.equal.groupby("parameter").all().to_dict() == {
        "noise_sd": False, "epsilon": False, "width": True,
    }  # fmt: skip
    best, *effects = said(seen)[:4]
    assert best.startswith("The best setting of the learner EC1 is noise_sd 0.02, epsilon 0.2, ")
    assert "cannot be told apart from noise_sd 0.02, epsilon 0.2, width 2" in best
    assert "not made of the best value" not in best
    assert effects == [
        "noise_sd, 0.02 to 0.1: changes the gap by 2.7 points on average over the other "
        "parameters, and by 2.7 at their best values; it is smallest at 0.02.",
        "epsilon, 0.1 and 0.2: changes the gap by 13.7 points on average over the other "
        "parameters, and by 13.7 at their best values; it is smallest at 0.2.",
        "width, 1 and 2: changes nothing; every run has the same reward at each value.",
    ]
    plot = FIGURES["ranking"](seen)
    axes = plot.figure.axes[:3]
    assert [panel.get_xlabel() for panel in axes] == ["noise_sd", "epsilon", "width"]
    for panel in axes:
        gaps = rows.gap[panel.get_xlabel()]
        drawn = next(line for line in panel.lines if len(line.get_xdata()) == len(gaps))
        assert drawn.get_ydata() == pytest.approx(100 * gaps.to_numpy())
        assert [text.get_text() for text in panel.get_xticklabels()] == [*gaps.index]
    assert "noise_sd 0.02" in plot.alt


def test_the_default_of_a_method_from_a_file_is_named_and_drawn():
    """Stored runs leave most parameters out that have their default."""
    rows = [
        run for sd in (0.01, 0.03, 0.1)
        for run in runs_of("ascending", "mine", [-300 - int(abs(100 * sd - 3)) - k % 2
                                                 for k in range(6)],
                           setting=f"sd={sd}" * (sd != 0.03),
                           parameters=json.dumps({} if sd == 0.03 else {"sd": sd}))
    ]  # fmt: skip
    seen = study_of(rows, optima=made_up_optima("ascending"))
    plan = [
        replace(job, cell=replace(job.cell, method=replace(job.cell.method, defaults={"sd": 0.03})))
        for job in seen.plan
    ]
    changed = Study(seen.folder, plan, seen.made_with, seen.stored)
    seen = MadeUp(changed, optima=seen.optima, rewards=seen.rewards)
    assert seen.methods.title["mine"] == "mine (sd 0.03, default)"
    assert seen.varied.sd.tolist() == [0.01, 0.03, 0.1]
    (best, effect) = said(seen)[:2]
    assert best.startswith("The best setting of “mine” is sd 0.03: its gap to the optimum is 2.9")
    assert effect == "sd, 0.01 to 0.1: changes the gap by 2.4 points; it is smallest at 0.03."
    (axes,) = FIGURES["ranking"](seen).figure.axes
    names = [text.get_text() for text in axes.get_xticklabels()]
    assert names == ["0.01", "0.03\n(default)", "0.1"]
    assert len(axes.lines[0].get_xdata()) == 3


def test_opposite_effects_are_not_lost_in_their_mean():
    """What is best depends on the other parameter: means are equal, single settings are not."""
    seen = grid(
        lambda noise, epsilon: 5 + 30 * ((noise == 0.02) == (epsilon == 0.1)),
        noise_sd=NOISE[:2], epsilon=EPSILON,
    )  # fmt: skip
    effects = sorted(said(seen)[1:3])
    for name, other, line in zip(["epsilon", "noise_sd"], ["noise_sd", "epsilon"], effects,
                                 strict=True):  # fmt: skip
        assert line.startswith(name)
        assert f"no difference is shown on average over {other} (gaps are 0.0 points" in line
        assert "apart, and 10.3 at its best value)" in line


def test_the_sentence_says_if_the_best_setting_is_not_made_of_the_best_values():
    seen = grid(
        lambda noise, epsilon: 2 if (noise, epsilon) == (0.1, 0.1) else 40 * (noise == 0.1) + 8,
        noise_sd=NOISE[1:], epsilon=EPSILON,
    )  # fmt: skip
    best, *_ = said(seen)
    assert "is epsilon 0.1, noise_sd 0.1" in best
    assert "on average over the others, noise_sd is best at 0.02." in best


def test_values_are_compared_at_equal_values_of_the_other_parameters():
    """Where a setting is missing, as if parameters were varied one at a time, or fails."""
    rows = []
    for noise, epsilon, cost in ((0.05, 0.2, 300), (0.1, 0.2, 320), (0.05, 0.1, 310)):
        parameters = {"noise_sd": noise, "epsilon": epsilon}
        rows += runs_of("ascending", EC1, [-cost - k for k in range(5)],
                        setting=f"noise_sd={noise}, epsilon={epsilon}",
                        parameters=json.dumps(parameters))  # fmt: skip
    seen = study_of(rows, optima=made_up_optima("ascending"))
    gaps = by_value(seen).gap
    assert gaps["noise_sd"].to_dict() == pytest.approx({"0.05": 10 / 292, "0.1": 30 / 292})
    assert gaps["epsilon"].to_dict() == pytest.approx({"0.2": 10 / 292, "0.1": 20 / 292})
    apart = study_of([*rows[5:]], optima=made_up_optima("ascending"))
    assert not len(TABLES["parameters"](apart))
    assert all("not compared" in line for line in said(apart)[1:3])


def test_a_parameter_is_left_out_if_the_settings_of_a_value_share_no_run():
    """As in a folder that was interrupted; the other parameter is compared."""
    rows = []
    for noise, epsilon in itertools.product(NOISE[:2], EPSILON):
        parameters = {"noise_sd": noise, "epsilon": epsilon}
        numbers = (0, 1) if epsilon == EPSILON[0] else (2, 3)
        rows += [
            row(EC1, -300 - run, task="ascending", run=run,
                setting=f"noise_sd={noise}, epsilon={epsilon}", parameters=json.dumps(parameters))
            for run in (numbers if noise == NOISE[0] else range(4))
        ]  # fmt: skip
    seen = study_of(rows, optima=made_up_optima("ascending"))
    assert {*by_value(seen).index.get_level_values("parameter")} == {"epsilon"}


def test_intervals_and_tests_of_values_resample_runs_with_all_their_settings():
    """Runs with the same number are one unit: equal settings do not make more of them."""
    spread = (-1, 2, 4, 7, 8, 13)
    one = grid(lambda noise: int(100 * noise), spread, noise_sd=NOISE)
    two = grid(lambda noise, width: int(100 * noise), spread, noise_sd=NOISE, width=[1, 2])
    columns = ["gap", "gap_low", "gap_high", "p_holm"]
    pd.testing.assert_frame_equal(
        by_value(two).loc["noise_sd", columns], by_value(one)[columns].droplevel(0)
    )


def test_settings_behind_the_corrective_process_are_counted():
    """-319 is the reward of the corrective process alone: 27 ticks from the optimum."""
    seen = grid(
        lambda noise, epsilon: (40 if noise > 0.05 else 28 if noise > 0.02 else 20),
        (-4, -3, 0, 3, 4), noise_sd=NOISE, epsilon=EPSILON,
    )  # fmt: skip
    change_runs(seen, "corrective_best", -319.0)
    *_, last = said(seen)
    assert last == (
        "4 of 6 settings stay behind the corrective process with its best hands, 2 of them within "
        "chance."
    )


def test_a_parameter_that_is_not_run_on_all_tasks_is_not_varied():
    rows = runs_of("ascending", EC1, [-300], parameters='{"noise_sd": 0.05}')
    rows += runs_of("two-armed-1", EC1, [-500], setting="noise_sd=0.1",
                    parameters='{"noise_sd": 0.1}')  # fmt: skip
    assert study_of(rows).varied.empty
