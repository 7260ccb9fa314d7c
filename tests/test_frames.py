"""Plain frames of results and claims of a study: against slow and obvious counts."""

import doctest
import importlib
import itertools

import numpy as np
import pandas as pd
import pytest

import coartic
from coartic import CoarticError
from coartic.analysis import TABLES, ecdf, frames, load, ranking
from coartic.analysis.signatures import SIGNATURES
from tests.support.made_up import row, study_of


@pytest.mark.parametrize(
    "module",
    [
        *("analysis.figures.plot", "analysis.figures.style", "analysis.frames", "analysis.methods"),
        *("analysis.recordings", "analysis.running_times", "analysis.signatures"),
        *("analysis.statistics", "analysis.words", "learner.learning"),
    ],
)
def test_examples(module):
    code = importlib.import_module(f"coartic.{module}")
    failed, attempted = doctest.testmod(code, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0 < attempted


def test_the_ecdf_is_the_share_of_pairs_that_are_reached():
    """Nothing is reached of a run without a reward, or of a task that a method lacks."""
    rng, targets = np.random.default_rng(0), [0.8, 0.4, 0.1]
    keys = itertools.product(("one", "two", "three"), ("left", "right"), range(3), range(4))
    frame = pd.DataFrame(keys, columns=["method", "task", "run", "step"])
    frame = frame.assign(
        trials=25 * frame.step + rng.integers(1, 26, len(frame)),  # four improvements of a run
        reward=-200.0 + 25 * frame.step + rng.integers(0, 25, len(frame)), best_known=-100,
    )  # fmt: skip
    frame = frame[(frame.method != "two") | (frame.task == "left")].copy()
    frame.loc[(frame.method == "one") & (frame.run == 2), "reward"] = np.nan
    curves = ecdf(frame, targets)
    for method, of_method in frame.groupby("method"):
        curve = curves[curves.method == method]
        for budget in range(1, 102, 10):
            made = of_method[of_method.trials <= budget]
            gaps = (made.groupby(["task", "run"]).reward.max() + 100) / -100
            reached = sum((gaps <= target).sum() for target in targets)
            seen = curve.share[curve.trials <= budget]
            due = reached / (6 * len(targets))
            assert (seen.iloc[-1] if len(seen) else 0) == pytest.approx(due)


def small_frame(**changes):
    """Two methods with a run each on one task."""
    frame = pd.DataFrame({"method": ["a", "b"], "task": "t", "run": 0, "trials": [1, 9],
                          "reward": [-300, -310], "best_known": -292})  # fmt: skip
    return frame.assign(**changes)


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ("reward has 300.0 in row 0: .*minus the ticks",
         {"reward": [300, 380], "best_known": 292}),
        ("reward has -291.0 in row 1: it is above best_known", {"reward": [-300, -291]}),
        ("task has 't' in row 0: .*one best_known", {"best_known": [-292, -200]}),
        ("reward has -inf in row 1: .*finite", {"reward": [-300, -np.inf]}),
        ("method has (nan|None) in row 1: .*name", {"method": ["a", None]}),
        ("status has 'crashed' in row 0: .*reward", {"status": ["crashed", "ok"]}),
        ("status has 'ok' in row 0: .*reward", {"status": "ok", "reward": [np.nan, -300]}),
    ],
)  # fmt: skip
def test_a_frame_that_cannot_be_meant_is_refused(words, changes):
    with pytest.raises(CoarticError, match=words):
        frames.ranking(small_frame(**changes))


def test_what_is_no_frame_and_no_argument_is_refused():
    frame = small_frame()
    for words, compute, *given in (
        ("no rows", frames.by_task, frame[:0]),
        ("the frame is a list; it must be a pandas.DataFrame", frames.ranking, [1]),
        ("no column reward", frames.by_task, frame.drop(columns="reward")),
        ("status has 'crashed'", frames.by_task, frame.assign(status=["crashed", "ok"])),
        ("by is empty.*names", frames.means, frame, [], ["reward"]),
        ("trials has 0.0 in row 0", ecdf, frame.assign(trials=[0, 9]), [0.1]),
        *(("targets are", ecdf, frame, gaps) for gaps in ([], [-0.1], [1.001])),
    ):
        with pytest.raises(CoarticError, match=words):
            compute(*given)


def test_a_method_with_several_settings_has_a_row_for_each():
    frame = small_frame(method="a", setting=["", "h=2"])
    frame = pd.concat([frame, small_frame(method=["b", "a"], setting=["h=1", None], run=1)])
    ranked = frames.ranking(frame.reset_index(drop=True))
    assert ranked.gap.round(4).to_dict() == {"b": 0.0274, "a": 0.0445, "a h=2": 0.0616}
    assert ranked.runs.to_dict() == {"b": 1, "a": 2, "a h=2": 1}
    assert [*ecdf(frame, [0.1]).method.unique()] == ["a", "a h=2", "b"]


def test_a_task_that_a_method_lacks_is_not_reached():
    none = ecdf(small_frame(method="none", reward=np.nan), [0.05])
    assert none.to_dict("records") == [{"method": "none", "trials": np.inf, "share": 0.0}]
    unknown = small_frame(task=["easy", "unknown"], method="a", best_known=[-300, np.nan])
    assert ecdf(unknown, [0.05]).share.tolist() == [1.0]
    with pytest.raises(CoarticError, match="best_known has no reward; targets need"):
        ecdf(unknown.assign(best_known=np.nan), [0.05])


def test_ranked_is_who_solved_all_tasks_of_the_frame():
    """A failed run counts on its task; a task without a best known reward counts for nobody."""
    rewards = {"a": [-110, -120], "b": [-105, -130], "c": [-101, np.nan], "d": [-100]}
    frame = pd.DataFrame(
        {"method": method, "task": task, "reward": reward, "best_known": -100}
        for method, of_method in rewards.items()
        for task, reward in zip("xy", of_method, strict=False)
    )
    unknown = {"method": "a", "task": "z", "reward": -1, "best_known": np.nan}
    ranked = frames.ranking(pd.concat([frame, pd.DataFrame([unknown])], ignore_index=True))
    assert ranked.gap.dropna().to_dict() == pytest.approx({"a": 0.15, "b": 0.175})
    why = {"a": "", "b": "", "c": "1 of 2 runs failed", "d": "1 of 2 tasks"}
    assert ranked.why.to_dict() == why
    assert ranked.tasks.tolist() == [2, 2, 1, 1]
    assert ranked.runs.to_dict() == {"a": 3, "b": 2, "c": 2, "d": 1}
    assert ranked.failed["c"] == 1


def test_searches_with_another_base_have_no_gap():
    """They solve another task, and may better the best known of this one. The ``base`` of a learner
    is a condition."""
    tidied = study_of([
        row("optimum/search", -300, task="ascending"),
        row("optimum/search", -250, task="ascending", run=1, parameters='{"base": "xy"}'),
        row("dual-process/custom", -310, task="ascending", parameters='{"base": "EC1"}'),
    ]).runs  # fmt: skip
    assert tidied.best_known.tolist() == [-292, pd.NA, -292]
    assert tidied.gap.tolist() == pytest.approx([8 / 292, np.nan, 18 / 292], nan_ok=True)
    gaps = frames.ranking(tidied).gap.to_dict()
    assert gaps == pytest.approx({"optimum/search": 8 / 292, "dual-process/custom": 18 / 292})


def test_runs_are_tidy(traced):
    """Columns of a folder's runs against its tasks; signatures and postures against executions."""
    runs = traced.runs[traced.runs.task == "two-armed-1"]
    best = coartic.objective("two-armed-1").best_known
    assert runs.gap.to_numpy() == pytest.approx((-best - runs.reward).to_numpy(float) / best)
    of_learner = runs.label == "dual-process/EC3"
    learned = traced.executed("two-armed-1", "EC3")
    assert learned.run_ids == tuple(runs.run_id[of_learner])
    postures = traced.configurations("two-armed-1", "dual-process/EC3")
    np.testing.assert_array_equal(postures, [run.configurations for run in learned.runs])
    replays = traced.executed("two-armed-1", "dual-process/EC3", replay=True)
    for name, signature in SIGNATURES.items():
        values = traced.signature(name, replay=True)[runs.index]
        np.testing.assert_array_equal(values[of_learner], signature.each(replays))
        assert values[~runs.method.str.startswith("dual-process")].isna().all()


def test_a_notebook_changes_no_later_table(traced):
    """Everything that a study returns is changed in place, as far as it can be."""
    cell = "two-armed-1", "dual-process/EC3"
    wanted, seen = load(traced.folder), load(traced.folder)

    def shown(study):
        tables = {name: table(study) for name, table in TABLES.items()}
        return [tables, ranking(study.runs), study.signature("first"), study.sequences(cell[0]),
                study.solutions, study.configurations(*cell)]  # fmt: skip

    for _ in range(2):  # before and after the tables are made
        frames = [seen.stored, seen.runs, seen.methods, seen.solutions, seen.varied,
                  seen.sequences(cell[0]), seen.cells[cell], *dict(seen.cells).values(),
                  *(table(seen) for table in TABLES.values())]  # fmt: skip
        for frame in frames:
            frame["gap"] = 7.0
            for name in {"reward", "value", "title", "method"} & {*frame}:
                frame[name] = frame[name].iloc[::-1].to_numpy()
            frame.pop(frame.columns[0])
        for values in (seen.signature("first", *cell), seen.signature("first")):
            values[:] = 7.0
        seen.configurations(*cell)[:] = 7.0
        seen.runs["reward"].array[:] = 7  # which pandas would not copy on write
        mappings = (seen.tasks, seen.optima, seen.declared, seen.models, seen.worlds,
                    seen.corrective_best, seen.individual_tasks, seen.movements())  # fmt: skip
        for mapping in mappings:
            mapping.clear()
        executed = seen.executed(*cell)
        arrays = (executed.hands, executed.configurations, executed.starts,
                  executed.against_same_hands, executed.runs[0].configurations)  # fmt: skip
        for array in arrays:
            with pytest.raises(ValueError, match="read-only"):
                array[:] = 7.0
        (tables, *others), (due, *other_due) = shown(seen), shown(wanted)
        assert len(due["methods"]) > 1
        for name, table in due.items():
            pd.testing.assert_frame_equal(tables[name], table)
        for other, value in zip(others, other_due, strict=True):
            assert (
                np.array_equal(other, value)
                if isinstance(value, np.ndarray)
                else (other.equals(value))
            )


def planted_scores():
    """Rewards of three methods on three tasks, of which the last leaves nothing to gain."""
    tasks = {"near": (-320, -300), "far": (-600, -500), "nothing": (-40, -40)}
    spread = np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
    parts = [
        pd.DataFrame({"method": method, "task": task, "reward": np.add(reward, noise),
                      "corrective_best": zero, "best_known": best})
        for method, rewards, noise in (("best", (-300, -500, -40), 0 * spread),
                                       ("middle", (-310.5, -550.5, -43), spread),
                                       ("planner", (-320, -630, -40), [0]))
        for reward, (task, (zero, best)) in zip(rewards, tasks.items(), strict=True)
    ]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def test_the_share_of_the_possible_gain_by_hand():
    planted = planted_scores()
    ranked = frames.ranking(planted)
    assert list(ranked.index) == ["best", "middle", "planner"]
    assert ranked.share.tolist() == pytest.approx([1.0, 0.485, -0.15])  # of two tasks
    assert ranked.without_gain.tolist() == [1, 1, 1]
    assert ranked.share_low["middle"] < 0.485 < ranked.share_high["middle"]
    assert ranked.gap["middle"] == pytest.approx((10.5 / 300 + 50.5 / 500 + 3 / 40) / 3, abs=1e-3)
    assert frames.shares(planted)[planted.task == "nothing"].isna().all()
    # Less than 1 % of the ticks: 2 of 300 (although another task has the same best known reward).
    for zero, has_share in ((-302, False), (-302.9, False), (-303, True)):
        little = planted.corrective_best.where(planted.task != "near", zero)
        little = planted.assign(corrective_best=little)
        same = planted.assign(task="other", best_known=-300, corrective_best=-400)
        of_runs = frames.shares(pd.concat([little, same[planted.task == "near"]]))
        assert of_runs.notna()[: len(planted)][planted.task == "near"].all() == has_share
        ranked = frames.ranking(little)
        assert ranked.without_gain.tolist() == [1 + (not has_share)] * 3
    with pytest.raises(CoarticError, match="corrective_best has -290.* above best_known"):
        frames.shares(planted.assign(corrective_best=-290))
