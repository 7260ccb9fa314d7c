"""How far methods end from the optimum, who is ahead, and what it costs: by hand."""

import math
import pickle
import re
from dataclasses import replace

import numpy as np
import pytest

from coartic.analysis import standings
from coartic.analysis.method_frame import (
    BY_TRIAL,
    WITHOUT_REWARD,
    headline_methods,
    methods_of,
)
from coartic.analysis.report import about, render
from coartic.analysis.report.render import shown_columns
from coartic.analysis.sections import FIGURES, SECTIONS, TABLES, costs
from coartic.analysis.statistics import running_times
from coartic.analysis.statistics.hypotheses import holm, stratified_test
from coartic.analysis.study import Study
from coartic.analysis.words import number
from coartic.cli.read import say_ranking
from tests.support.made_up import MadeUp, made_up_optima, runs_of, study_of
from tests.support.made_up import study_of_rewards as study
from tests.support.processes import ROOT

EC1 = "dual-process/EC1"
LEARNER = {("ascending", EC1): [-300, -301, -302, -303],
           ("two-armed-1", "dual-process/EC4"): [-480, -481, -482, -483]}  # fmt: skip
CMA = {("ascending", "cma-es/bandit"): [-293, -294, -293, -294],
       ("two-armed-1", "cma-es/bandit"): [-466, -467, -468, -466]}  # fmt: skip


def test_the_learner_is_joined_with_each_form():
    better = {("two-armed-1", "dual-process/EC3"): [-470, -471, -470, -471]}
    seen = study(LEARNER | better)
    assert standings.board(seen).index[0] == "dual-process (EC1, EC3)"


def test_a_method_that_makes_one_trial_does_not_use_its_reward():
    """The corrective process alone uses the reward of its only trial, and of every hand
    sequence."""
    alone = study({("ascending", "corrective-alone/given"): [-319]} | LEARNER)
    assert alone.methods.information["corrective-alone/given"] == BY_TRIAL  # of ten trials
    alone.runs.loc[alone.runs.method == "corrective-alone/given", "trials"] = 1
    again = MadeUp(alone, optima=made_up_optima("ascending", "two-armed-1"))
    assert again.methods.information["corrective-alone/given"] == WITHOUT_REWARD
    assert again.methods.information["dual-process (EC1, EC4)"] == BY_TRIAL


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
    seen.runs.loc[seen.runs.reward.isna(), "reason"] = "time limit"
    (failed,) = TABLES["failed"](seen).to_dict("records")
    assert (failed["method"], failed["failed"]) == (other, 2)
    assert failed["reasons"] == "2 × time limit"
    assert TABLES["runtimes"](seen).reached[other] == pytest.approx(2 / 4 * 10 / 20)
    times = costs.times_of(seen, "ascending", other, "solve_s")
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


def test_a_method_from_a_file_changes_nobody_elses_p():
    """Holm's correction is over one method's tasks, and a difference to the best is one test."""
    alone = study(TEN | strangers(("mine", 2), runs=10))
    beside = study(TEN | strangers(("mine", 2), ("yours", 3), ("theirs", 0), runs=10))
    mine = TABLES["against-learner"](alone).loc[["ascending mine", "two-armed-1 mine"]]
    again = TABLES["against-learner"](beside).loc[mine.index]
    assert mine.p_holm.tolist() == again.p_holm.tolist()
    assert (mine.p_holm < 0.05).all()
    unsure = {(task, "unsure"): [reward + 9, reward - 8] * 5
              for task, reward in (("ascending", -303), ("two-armed-1", -485))}  # fmt: skip
    row_of = TABLES["ranking"](study(TEN | unsure)).loc["unsure"]
    assert (row_of.better, row_of.worse) == (0, 0)  # half a tick better on both tasks


@pytest.mark.parametrize("runs", [3, 6, 10])
def test_a_test_that_cannot_reject_counts_nothing(runs):
    """Signs of runs against a number have a p of 2/8, 2/64 or 2/1024 at least; on two tasks it is
    twice that."""
    few = {key: rewards[:runs] for key, rewards in TEN.items()}
    plan = {(task, "my-plan"): [reward] for task, reward in
            (("ascending", -293), ("two-armed-1", -466))}  # fmt: skip
    seen = study(few | plan, deterministic=["my-plan"])
    rows = TABLES["against-learner"](seen)
    assert rows.least_p["ascending my-plan"] == pytest.approx(2 / 2**runs)
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
    gaps = {"mine": [3.5 / 293, 15 / 480], "dual-process (EC1, EC4)": [8.5 / 293, 1.5 / 480]}
    for method, of_method in gaps.items():
        assert ranked.gap[method] == pytest.approx(sum(of_method) / 2)
    columns = shown_columns(TABLES["ranking"], ranked)
    headings = {name: column.header for name, column in columns.items()}
    assert headings["gap"].startswith("gap to the best of this folder (%)")
    for words in (*said(unknown, "ranking"), FIGURES["ranking"](unknown).alt, *headings.values()):
        assert not re.search("optimum|known", words)
    assert TABLES["tasks"](unknown).source.tolist() == ["mine", "dual-process/EC4"]
    one = MadeUp(seen, optima=made_up_optima("ascending"), rewards=seen.rewards)
    assert TABLES["ranking"](one).loc["mine", "on ascending"] == pytest.approx(4.5 / 292)


def test_the_ranking_figure_has_every_name_gap_and_interval():
    rewards = {"best": -292, "far": -3000, "dual-process/EC1": -305}
    runs = {("ascending", name): [reward] for name, reward in rewards.items()}
    seen = study(runs | {("ascending", "spread"): [-294, -296, -299, -301]})
    (axes,) = FIGURES["ranking"](seen).figure.axes
    places = {text.get_text(): text.get_position()[1] for text in axes.get_yticklabels()}
    right = {text.get_text(): text.xy[1] for text in axes.texts}
    for name, gap in {"best": "0.0", "far": "927.4", "learner EC1": "4.5"}.items():
        assert right[gap] == places[name]
    (spread,) = (text for text in right if text.startswith("1.9 ["))
    assert right[spread] == places["spread"]
    bars = [bar for bars in axes.collections for bar in bars.get_segments() if len(bar)]
    (ends,) = (bar[:, 0] for bar in bars if bar[0, 1] == places["spread"])
    assert ends[0] < 100 * 5.5 / 292 < ends[1]


ON_ONE = {("ascending", "mine"): [-300, -301, -302]}


def test_what_a_method_did_not_run_on_leaves_it_its_gap_there():
    seen = study(LEARNER | CMA | ON_ONE)
    ranked = TABLES["ranking"](seen)
    assert ranked.index.tolist()[:2] == ["cma-es/bandit", "dual-process (EC1, EC4)"]
    assert ranked.gap["mine"] == pytest.approx(9 / 292)
    assert ranked.tasks[["cma-es/bandit", "mine"]].tolist() == [2, 1]
    assert ranked.ranked[["cma-es/bandit", "mine"]].tolist() == [True, False]
    (axes,) = FIGURES["ranking"](seen).figure.axes
    assert "mine (1 of 2 tasks)" in [text.get_text() for text in axes.get_yticklabels()]
    assert TABLES["runtimes"](seen).tasks[["mine", "cma-es/bandit"]].tolist() == [1, 2]


def with_trials(seen, by_method, suite_trials=None):
    """The study, its methods asked for numbers of trials, 10 for others than are named."""
    plan = []
    for job in seen.plan:
        asked = {"trials": by_method.get(job.cell.method.name, 10)}
        method = replace(job.cell.method, defaults=asked)
        cell = replace(job.cell, method=method, parameters=asked)
        plan.append(replace(job, cell=cell, suite_trials=suite_trials))
    optima = made_up_optima("ascending", "two-armed-1")
    parts = {"optima": optima, "rewards": lambda: iter(())}
    runs = seen.runs.assign(trials=seen.runs.method.map(by_method).fillna(10).astype(int))
    return MadeUp(Study(seen.folder, plan, seen.made_with, runs), **parts)


SIXTEEN = [
    "cma-es/bandit", "cma-es/goal-by-goal", "hill-climbing", "random-search",
    "corrective-alone/given", "corrective-alone/best-hands", "posture-qp/goals-ahead",
    "posture-qp/current-goal", "posture-based/two-goals", "posture-based/one-goal",
    "nullspace-qp/next-goal-posture", "nullspace-qp/least-motion",
    *(f"trajectory-optimisation/{each}" for each in ("path-length", "acceleration", "jerk")),
    "trajectory-optimisation/hand-jerk",
]  # fmt: skip
BEST = {("ascending", "mine"): [-292] * 3, ("two-armed-1", "mine"): [-465] * 3}


@pytest.mark.parametrize(
    ("trials", "by_suite", "equal", "is_ranked"),
    [
        ({"mine": 40}, None, 10, False),
        ({"mine": 40}, 10, 10, False),
        ({"mine": 40}, 40, 40, True),  # which the suite asks for
        ({"mine": 40, "cma-es/bandit": 40}, 99, 40, True),  # most algorithms have it
        ({"mine": 4}, None, 10, True),
        ({}, None, 10, True),
    ],
)
def test_a_method_with_more_trials_stands_below(trials, by_suite, equal, is_ranked):
    seen = with_trials(study(LEARNER | CMA | BEST), trials, by_suite)
    assert standings.equal_trials(seen) == equal
    board = standings.board(seen)
    assert board.ranked["mine"] == is_ranked
    assert board.index.tolist().index("mine") == (0 if is_ranked else len(board) - 1)
    assert TABLES["ranking"](seen).index[0] == board.index[0]
    unlike = {name for name in board.index if trials.get(name, 10) != equal}
    unlike |= {"dual-process (EC1, EC4)"} if equal != 10 else set()
    named = {name for name in board.index if "trials)" in standings.shown_name(seen, name)}
    assert named == unlike
    first, *others = said(seen, "ranking")
    assert ("not with equal trials" in first) == bool(unlike)
    assert ("mine leaves" in first.replace(" (4 trials)", "")) == is_ranked
    below = "mine 0.0 % is not ranked: 40 trials, not 10; on these CMA-ES has"
    assert any(each.replace("\xa0", " ").startswith(below) for each in others) != is_ranked


def test_what_is_not_ranked_is_compared_on_the_tasks_of_its_gap():
    """CMA-ES and mine ran on a third task, which is not compared."""
    climbing = {(task, "hill-climbing"): [-490] * 3 for task, _ in CMA}
    third = {("two-armed-2", "cma-es/bandit"): [-612] * 3, ("two-armed-2", "mine"): [-306] * 3}
    seen = with_trials(study(LEARNER | CMA | climbing | BEST | third), {"mine": 40})
    seen = MadeUp(seen, optima=made_up_optima("ascending", "two-armed-1", "two-armed-2"))
    assert standings.common_tasks(seen) == ("ascending", "two-armed-1")
    (sentence,) = standings.not_ranked(seen)
    assert sentence.endswith("on these CMA-ES has 0.4 %.")


def test_what_was_asked_for_has_a_row_below():
    seen = study(LEARNER | CMA)
    also = frozenset({"dual-process/EC4"})
    assert "dual-process/EC4" not in standings.board(seen).index
    board = standings.board(seen, also)
    assert not board.ranked["dual-process/EC4"]
    assert board.index[-1] == "dual-process/EC4"
    (sentence,) = standings.not_ranked(seen, also)
    assert "is not ranked: 1 of 2 tasks; on it CMA-ES has" in sentence


def test_the_terminal_prints_ten_methods_own_methods_and_what_was_named(capsys):
    rewards = {
        ("ascending", name): [-300 - n, -301 - n, -302 - n] for n, name in enumerate(SIXTEEN)
    }
    rewards |= {
        ("two-armed-1", name): [-500 - n, -501 - n, -502 - n] for n, name in enumerate(SIXTEEN)
    }
    last = {("ascending", "mine"): [-319] * 3, ("two-armed-1", "mine"): [-600] * 3}
    rows = [{**run, "commit": ""} for cell, of in (rewards | LEARNER | last).items()
            for run in runs_of(*cell, of)]  # fmt: skip
    optima = made_up_optima("ascending", "two-armed-1")
    seen = study_of(rows, optima=optima)
    titles = seen.methods.title

    def printed(*asked):
        say_ranking(seen, asked)
        lines = capsys.readouterr().out.splitlines()
        return [line.partition("  ")[0] for line in lines[1:] if re.search(r"  +\d+$", line)]

    usual = printed()
    assert len(usual) == 10  # nine of 17, and the method from a file
    assert {"learner (EC1, EC4)", "random search", "mine"} < {*usual}
    assert titles[SIXTEEN[-1]] not in usual
    assert printed("dual-process/EC1", "dual-process/EC4") == usual
    assert {*printed(SIXTEEN[-1])} == {*usual, titles[SIXTEEN[-1]]}


def test_an_own_method_is_compared_on_the_tasks_that_it_solved():
    """A positive difference is in its favour; the built-in method with the smallest gap is first,
    and methods with failed runs there, or with another use of the reward, are left out."""
    built_in = {("ascending", "hill-climbing"): [-300, None],
                ("ascending", "corrective-alone/given"): [-319]}  # fmt: skip
    seen = study(TEN | CMA | built_in | {("ascending", "mine"): [-309, -301]})
    seen.runs.loc[seen.runs.method == "corrective-alone/given", "trials"] = 1
    seen = MadeUp(seen, optima=made_up_optima("ascending", "two-armed-1"))
    table, rows = TABLES["differences"], TABLES["differences"](seen)
    others = ["cma-es/bandit", "dual-process/EC1"]
    assert rows.index.tolist() == [f"mine {name}" for name in others]
    differences = [1.5 / 292 - 13 / 292, 11 / 292 - 13 / 292]
    assert rows.difference.tolist() == pytest.approx(differences)
    assert math.isnan(rows.difference_low.iloc[0])  # of two runs there is no interval
    assert (rows.tasks == 1).all()
    texts = render.shown_columns(table, rows)["difference"].texts
    assert texts[0] == number(100 * rows.difference.iloc[0], 1)  # per cent, as the gaps
    assert "positive: this method is better" in table.caption
    better = TABLES["differences"](study(TEN | strangers(("mine", 2), runs=10)))
    assert (better.difference_low > 0).all()
    same = TABLES["differences"](study(TEN | {("ascending", "mine"): list(SPREAD - 303)}))
    assert same.difference_low.iloc[0] < 0  # runs with the same seeds are not matched


def test_a_method_that_stops_early_or_solves_nothing_says_so():
    rows = [
        *(run for cell, of in TEN.items() for run in runs_of(*cell, of)),
        *runs_of("ascending", "early", [-305] * 3, trials=[3, 2, 3]),
        *runs_of("ascending", "never", [None] * 3),
    ]
    seen = study_of(rows, optima=made_up_optima("ascending", "two-armed-1"))
    early = standings.shown_name(seen, "early")
    assert "at most 3 of 10 trials" in early
    assert f"{early} against built-in methods" in " ".join(said(seen, "ranking"))
    sentences = standings.not_ranked(seen)
    assert "never is not ranked: 0 of 2 tasks, 3 failed runs." in sentences


def test_a_run_that_failed_after_some_trials_has_no_early_gap():
    rows = [
        *runs_of("ascending", "hill-climbing", [-300, -301, -302]),
        *runs_of("ascending", "mine", [-300, -301, None]),
    ]
    rewards = {row["run_id"]: np.array([-310.0, -305.0]) for row in rows}
    seen = study_of(rows, optima=made_up_optima("ascending"), rewards=lambda: iter(rewards.items()))
    early = TABLES["ranking"](seen).gap_early
    assert early["hill-climbing"] == pytest.approx((305 - 292) / 292)
    assert math.isnan(early["mine"])


def test_all_methods_are_compared_with_a_method_of_choice():
    """Own and built-in methods alike, with p corrected for their number."""
    plan = {("ascending", "corrective-alone/given"): [-319],
            ("two-armed-1", "corrective-alone/given"): [-675]}  # fmt: skip
    seen = study(TEN | CMA | plan | strangers(("a", 2), ("b", 0), runs=10))
    others = {"b", "cma-es/bandit", "corrective-alone/given", "dual-process (EC1, EC4)"}
    with_a, with_b = (
        TABLES["differences"](MadeUp(seen, against=each, optima=seen.optima)) for each in "ab"
    )
    assert {*with_a.method} == others
    assert (with_a.against == "a").all()
    here, there = with_a.loc["a b"], with_b.loc["b a"]
    ahead = np.mean([2 / -best.reward for best in seen.optima.values()])  # two ticks on each task
    assert here.difference == -there.difference == pytest.approx(ahead)
    gaps = {
        name: [
            values if len(values := of_task.to_numpy(float)) > 1 else values.item()
            for _, of_task in standings.runs_on(seen, name, seen.tasks).groupby("task").gap
        ]
        for name in (*with_a.method, "a")
    }
    p = [stratified_test([*zip(gaps[name], gaps["a"], strict=True)]) for name in with_a.method]
    assert with_a.p_holm.tolist() == pytest.approx(holm(p))
    assert (with_a.p_holm < 0.05).all()


def with_parameters():
    """A method from a file, and a built-in one without its defaults, beside the learner."""
    seen = study(TEN | strangers(("mine", 2), ("hill-climbing", -5), runs=10))
    learns = seen.runs.method.str.contains("/EC")
    runs = seen.runs.assign(setting=np.where(learns, "", "width=0.2"))
    return study_of(runs, optima=seen.optima, rewards=lambda: iter(()))


def with_settings(*settings, tasks=("ascending",), more=()):
    """The learner with settings of its noise, each 4 ticks nearer than the setting before."""
    rows = [
        run for task in tasks for nearer, setting in enumerate(settings)
        for run in runs_of(task, EC1, [-500 + 4 * nearer, -501 + 4 * nearer, -503 + 4 * nearer],
                           setting=setting)
    ]  # fmt: skip
    return study_of([*rows, *more], optima=made_up_optima(*tasks))


def test_settings_stand_behind_their_method_in_the_ranking():
    """Behind its defaults, though their gaps are smaller, and each with its interval."""
    between = runs_of("ascending", "hill-climbing", [-499] * 3)
    seen = with_settings("", "noise_sd=0.1", "noise_sd=0.2", more=between)
    ranked = TABLES["ranking"](seen)
    settings = [f"{EC1} noise_sd=0.2", f"{EC1} noise_sd=0.1"]
    assert ranked.index.tolist() == ["hill-climbing", EC1, *settings]
    of_settings = ranked.loc[settings]
    means = [1480 / 3, 1492 / 3]
    assert of_settings.gap.tolist() == pytest.approx([(mean - 292) / 292 for mean in means])
    assert (of_settings.gap_low < of_settings.gap_high).all()
    own = [run for at in ("", "width=0.2") for run in runs_of("ascending", "mine", [-510] * 3,
                                                               setting=at)]  # fmt: skip
    with_own = TABLES["ranking"](with_settings("", "noise_sd=0.1", more=own))
    folded = dict(zip(with_own.index, render.classes_of(TABLES["ranking"], with_own), strict=True))
    assert folded == {EC1: "", f"{EC1} noise_sd=0.1": "setting", "mine": "own",
                      "mine width=0.2": "own"}  # fmt: skip


def test_a_title_that_another_method_has_is_not_taken():
    names = ["cma-es/bandit", "mine", "yours", "his", "hers"]
    seen = study({("ascending", name): [-300, -301] for name in names})
    titles = {"mine": "CMA-ES", "yours": "Steps", "his": "Walk", "hers": "Walk"}
    declared = {name: replace(info, title=titles.get(name, info.title))
                for name, info in seen.declared.items()}  # fmt: skip
    shown = methods_of(seen.runs, declared).title
    assert shown[names].tolist() == ["CMA-ES", "mine", "Steps", "his", "hers"]


def test_common_tasks_have_the_order_of_the_study():
    """Tests draw signs by position: the order of a set would change p from run to run."""
    tasks = "two-armed-2", "ascending", "two-armed-1"
    assert standings.common_tasks(with_settings("", "noise_sd=0.1", tasks=tasks)) == tasks


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
    together = ["dual-process (EC1, EC4)", "dual-process (EC1-informed, EC4-informed)"]
    assert headline_methods(learned.methods) == together
    titles = ["learner (EC1, EC4)", "informed learner (EC1, EC4)"]
    assert learned.methods.title[together].tolist() == titles
    both = study({("two-armed-1", label): [-400, -401, -402] for label in learner})
    assert [*both.methods.index] == learner  # EC1 adds no task


SENTENCES = {
    "ranking: the learner is second of three": lambda: study(
        TEN | strangers(("mine", 2), ("yours", -3), runs=10)
    ),
    "ranking: a method ran on one task of two": lambda: study(LEARNER | CMA | ON_ONE),
    "ranking: a method from a file has parameters": with_parameters,
    "ranking: the learner is alone": lambda: study(TEN),
    "ranking: a run of an own method failed": lambda: study(
        LEARNER | {("ascending", "mine"): [-490, None], ("two-armed-1", "mine"): [-490, -491]}
    ),
    "ranking: methods between those that are named": lambda: study(
        LEARNER
        | CMA
        | {
            (task, method): [cost + better for cost in costs]
            for (task, _), costs in CMA.items()
            for better, method in ((-2, "cma-es/goal-by-goal"), (-4, "hill-climbing"))
        }
    ),
    "cost: the learner and CMA-ES": lambda: study(LEARNER | CMA),
}
GOLDEN = (ROOT / "tests" / "golden.md").read_text("utf-8")
"""Whole sentences of reports on these studies: one that is worded anew is changed there alone."""


def said(seen, section):
    """The sentence of a section, its lines."""
    return about.finding(seen, next(each for each in SECTIONS if each.id == section))


@pytest.mark.parametrize("name", SENTENCES)
def test_sentences_are_those_of_the_golden_page(name):
    lines = "\n".join(said(SENTENCES[name](), name.partition(":")[0]))
    assert f"## {name}\n\n{lines}\n\n## " in f"{GOLDEN}\n## "


def test_a_study_pickles_with_what_was_asked_of_it(traced):
    """As other libraries send it to their workers."""
    before = TABLES["ranking"](traced)
    copy = pickle.loads(pickle.dumps(traced))
    assert copy.runs.equals(traced.runs)
    assert TABLES["ranking"](copy).equals(before)
