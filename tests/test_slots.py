"""Runs side by side: each comes out as it does alone."""

from dataclasses import replace

import numpy.testing as npt
import pytest

from coartic import PAPER, MotionModel, learn, learn_many, load_task
from coartic.benchmarks.worker import fail
from coartic.motion.batch import SLOTS
from tests.support.suites import KNOWN, InProcess, cell_on, run_and_write

SOON_FAILED = MotionModel(max_iterations=60)


def shown(movements):
    return [(m.goal, m.hand, m.kind, m.ticks, tuple(m.target)) for m in movements]


def assert_same(a, b):
    assert a.seed == b.seed
    assert a.counters == b.counters
    assert a.best_trial == b.best_trial
    assert a.replay_reward == b.replay_reward
    npt.assert_array_equal(a.rewards.data, b.rewards.data)
    for name in ("completed", "values", "targets"):
        npt.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("initial", "solution", "replay"):
        assert shown(getattr(a, name)) == shown(getattr(b, name))


@pytest.mark.parametrize(
    ("task", "condition", "model"),
    [
        ("two-armed-1", "EC4", PAPER),
        ("two-armed-1", "EC4", SOON_FAILED),
        ("two-armed-2", "EC2", PAPER),
        ("two-armed-2", "EC4-subtask", SOON_FAILED),
        ("ascending", "EC1-uncorrected", PAPER),
    ],
)
def test_a_run_is_the_same_whoever_is_beside_it(task, condition, model):
    task = load_task(task)
    seeds = [*range(SLOTS), 17, *range(SLOTS, SLOTS + 3)]  # more than there are slots, one twice
    for trials in (1, 25):
        options = {"trials": trials, "model": model}
        together = learn_many(task, condition, seeds=seeds, jobs=1, **options)
        assert [run.seed for run in together] == seeds
        some = learn_many(task, condition, seeds=seeds[::-7], jobs=2, **options)
        for run, same in zip(together[::-7], some, strict=True):
            assert_same(run, same)
        for run in together[5 :: SLOTS // 3]:
            assert_same(run, learn(task, condition, seed=run.seed, **options))
    if model is SOON_FAILED:
        assert any(run.counters.failed_trials for run in together)


class Nobody(InProcess):
    """Its processes end wherever runs are performed side by side."""

    def perform(self, jobs):
        for job, outcomes in super().perform(jobs):
            lost = len(job.numbers) > 1
            yield job, fail(job, "crashed", "exit code 9", 1.0) if lost else outcomes


LEARNER = cell_on(load_task("ascending"), KNOWN["dual-process/EC1"])
ALONE = cell_on(load_task("ascending"), KNOWN["corrective-alone/given"])


def test_what_goes_wrong_side_by_side_is_performed_again_alone(tmp_path):
    tables = []
    for number, executor in enumerate((InProcess(), Nobody())):
        options = {"runs": SLOTS + 2, "trials": 3, "executor": executor}
        tables.append(run_and_write(tmp_path / str(number), [LEARNER, ALONE], **options).runs)
    assert (tables[0].status == "ok").all()
    assert tables[0].result.tolist() == tables[1].result.tolist()
    assert [set(runs.together) for runs in tables] == [{1, 2, SLOTS}, {1}]


class Forges(InProcess):
    """Has two of many runs state what is no solution."""

    def perform(self, jobs):
        for job, outcomes in super().perform(jobs):
            if len(outcomes) == SLOTS:
                fifth, seventh = (outcomes[run].parts["solution"] for run in (5, 7))
                fifth[0] = replace(fifth[0], target=fifth[0].target[1:])
                seventh.pop()
            yield job, outcomes


def test_what_is_no_solution_is_that_of_one_run_alone(tmp_path):
    """Of runs side by side each is executed by itself; those alone are performed again."""
    forged, honest = (
        run_and_write(tmp_path / each.__name__, [LEARNER], runs=SLOTS, trials=3, executor=each())
        for each in (Forges, InProcess)
    )
    assert forged.runs.result.tolist() == honest.runs.result.tolist()
    assert (forged.runs.status == "ok").all()
    again = forged.runs.together == 1
    assert again[again].index.tolist() == [5, 7]
