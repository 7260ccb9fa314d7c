"""Runs side by side: each comes out as it does alone."""

import json

import numpy as np
import numpy.testing as npt
import pytest
from numba import config, njit
from numba.core.codegen import get_host_cpu_features

from coartic import PAPER, MotionModel, Robot, learn, learn_many, load_task
from coartic.benchmarks.harness import _lots, perform_missing, records_of
from coartic.benchmarks.sandbox import failure
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.store import Store
from coartic.benchmarks.suites import Cell
from coartic.motion.compiled import entry
from coartic.motion.corrective import _errors
from coartic.motion.lanes import LANES, board, lanes_for, near, place
from coartic.motion.movement import Goal
from coartic.motion.trigonometry import LARGEST
from tests.support.strategies import UNEVEN
from tests.support.suites import KNOWN, InProcess, paper_cells, run_specs

SOON_FAILED = MotionModel(max_iterations=60)


def shown(movements):
    return [(m.goal, m.hand, m.kind, m.ticks, tuple(m.target)) for m in movements]


def assert_same(a, b):
    assert a.seed == b.seed
    assert a.counters == b.counters
    assert a.best_trial == b.best_trial
    assert a.replay_completed == b.replay_completed
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
        ("two-armed-1", "EC4-nullspace", PAPER),
        ("two-armed-2", "EC4-biased", SOON_FAILED),
        ("ascending", "EC1-uncorrected", PAPER),
    ],
)
def test_a_run_is_the_same_whoever_is_beside_it(task, condition, model):
    task = load_task(task)
    seeds = [*range(LANES), 17, *range(LANES, LANES + 3)]  # more than there are lanes, one twice
    for trials in (1, 25):
        options = {"trials": trials, "model": model}
        together = learn_many(task, condition, seeds=seeds, jobs=1, **options)
        assert [run.seed for run in together] == seeds
        some = learn_many(task, condition, seeds=seeds[::-7], jobs=2, **options)
        for run, same in zip(together[::-7], some, strict=True):
            assert_same(run, same)
        for run in together[5 :: LANES // 3]:
            assert_same(run, learn(task, condition, seed=run.seed, **options))
    if model is SOON_FAILED:
        assert any(run.counters.failed_trials for run in together)


@entry
def _board(lanes, lane, run, q, arm):
    board(lanes.at, lane, run, q, arm)


@entry
def _place(at, count):
    place(at, count, near(at, count))


@pytest.mark.parametrize("count", [1, 2, 9, LANES])
@pytest.mark.parametrize("far", [False, True])
def test_lanes_do_not_mix(count, far):
    """Arms of either hand side by side, also where one of them has turned too far."""
    robot, rng = UNEVEN, np.random.default_rng(count)
    starts = rng.normal(0, 0.5, (count, robot.dof))
    starts[-1, robot.joints("left")] += LARGEST if far else 0.0
    arms = [robot.arm("left" if k % 2 or far else "right") for k in range(count)]
    lanes = lanes_for(robot)  # with what was in them before

    def placed(chosen):
        for lane, number in enumerate(chosen):
            _board(lanes, lane, number, starts[number], arms[number])
        _place(lanes.at, len(chosen))
        return lanes.at["x"][:, : len(chosen)].copy(), lanes.at["y"][:, : len(chosen)].copy()

    xs, ys = placed(range(count))
    for number, arm in enumerate(arms):
        (x,), (y,) = (found.T for found in placed([number]))
        npt.assert_array_equal(xs[:, number], x)
        npt.assert_array_equal(ys[:, number], y)
        hand = "left" if arm.first == robot.arm("left").first else "right"
        expected = robot.forward_kinematics(starts[number], hand)
        npt.assert_allclose((xs[-1, number], ys[-1, number]), expected, atol=1e-9)


@njit
def _seen(at, count, goal, square):
    """As corrections begin each of their steps; all of one takes seconds to compile."""
    place(at, count, near(at, count))
    _errors(at, count, goal, square)


def vectors():
    """The widest registers with doubles that Numba may use, as the listing names them."""
    has = (config.CPU_FEATURES or get_host_cpu_features()).split(",")
    for feature, register in (("+avx512f", "zmm"), ("+avx", "ymm"), ("+sse2", "xmm")):
        if feature in has:
            return register
    return None


@pytest.mark.skipif(not vectors(), reason="no vector instructions that this test knows")
def test_the_listing_holds_vector_instructions():
    """More links than four, where LLVM's own bound on unrolling would end it."""
    robot, task = Robot(left_links=(0.8,) * 5, right_links=(0.8,) * 5), load_task("ascending")
    lanes, goal = lanes_for(robot), Goal(*task.goal_array[0], task.radius)
    for lane in range(2):
        _board(lanes, lane, lane, np.zeros(robot.dof), robot.arm("right"))
    _seen(lanes.at, 2, goal, np.inf)
    listing = _seen.inspect_asm(_seen.signatures[-1])  # takes as long as compiling
    on_vectors = [line.split()[0] for line in listing.splitlines() if vectors() in line]
    assert sum(name.endswith("mulpd") for name in on_vectors) > 2 * 15 * 5  # two series a link
    assert any("cmple" in name for name in on_vectors)  # of the error with the tolerance


class Nobody(InProcess):
    """An executor whose processes end wherever runs are performed side by side."""

    def __init__(self):
        self.sizes = []

    def perform(self, jobs):
        for job in jobs:
            self.sizes.append(len(job["seeds"]))
            if len(job["seeds"]) > 1:
                yield failure(job["run_id"], "crashed", "exit code 9", 1.0)
            else:
                yield from super().perform([job])


def results(store):
    packs = store.packs()
    return {run_id: (packs[run_id].result(), packs[run_id].rewards) for run_id in packs}


def test_what_goes_wrong_side_by_side_is_performed_again_in_parts(tmp_path):
    cells = paper_cells(tasks=["ascending"], methods=["dual-process/EC1", "corrective-alone/given"])
    planned = [spec for _, spec in run_specs(cells, runs=LANES + 2, seed=0, trials=3)]
    found = []
    for number, executor in enumerate((InProcess(), Nobody())):
        store = Store(tmp_path / str(number))
        with store.locked():
            progress = perform_missing(planned, store, executor)
        assert (progress.done, progress.failed) == (len(planned), 0)
        found.append(store)
    assert results(found[0]) == results(found[1])
    assert sorted(executor.sizes) == [1] * (LANES + 3) + [2] + [9] * 8 + [LANES]
    beside = {record.timing.together for record in map(found[0].read, found[0].packs())}
    assert beside == {1, 2, LANES}
    assert {found[1].read(run_id).timing.together for run_id in found[1].packs()} == {1}


def test_side_by_side_has_the_time_of_one():
    (cell,) = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])
    limits = Limits(60.0)
    planned = [spec for _, spec in run_specs([cell], runs=4, seed=0, trials=3, limits=limits)]
    job = planned[0].setting.job(planned)
    assert job["run_id"] == planned[0].run_id
    assert job["seeds"] == [spec.seed for spec in planned]
    assert json.loads(json.dumps(job)) == job
    assert job["time_limit_s"] == planned[0].job()["time_limit_s"] == 60.0


def test_long_runs_are_fewer_side_by_side():
    entry = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])[0].entry
    assert [entry.most_together({"trials": n}) for n in (10, 10_000, 1_000_000, 10**7)] == [
        LANES,
        LANES,
        4,
        1,
    ]


def test_few_runs_of_several_cells_are_divided_among_workers():
    cells = [
        Cell(load_task("ascending"), KNOWN[name])
        for name in ("dual-process/EC1", "corrective-alone/given")
    ]
    planned = [spec for _, spec in run_specs(cells, runs=20, seed=0, trials=3)]
    assert [len(lot) for lot in _lots(planned, {}, 2)] == [11, 9, 1]
    assert [len(lot) for lot in _lots(planned, {planned[3].run_id: 1}, 2)] == [3, 1, 11, 5, 1]


@pytest.mark.parametrize(
    ("runs", "workers", "sizes"),
    [
        (40, 2, [20, 20]),
        (20, 8, [8, 8, 4]),
        (2 * LANES + 20, 2, [LANES, LANES, 10, 10]),
        (2 * LANES + 3, 2, [LANES, LANES, 3]),
        (LANES, 1, [LANES]),
    ],
)
def test_a_cell_is_divided_among_workers(runs, workers, sizes):
    (cell,) = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])
    planned = [spec for _, spec in run_specs([cell], runs=runs, seed=0, trials=3)]
    lots = list(_lots(planned, {}, workers))
    assert [len(lot) for lot in lots] == sizes
    assert [spec for lot in lots for spec in lot] == planned


def test_what_is_no_solution_is_that_of_one_run_of_a_lot_alone():
    """Of runs side by side each is executed by itself."""
    (cell,) = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])
    planned = [spec for _, spec in run_specs([cell], runs=LANES, seed=0, trials=3)]
    (answer,) = InProcess().perform([planned[0].setting.job(planned)])
    said = json.loads(answer["outcome"])
    fifth, seventh = (said["answer"]["runs"][run]["solution"] for run in (5, 7))
    fifth[0]["target"].pop()
    seventh[:] = [row for row in seventh if row["goal"] < 3]
    forged = records_of({**answer, "outcome": json.dumps(said)}, planned)
    honest = records_of(answer, planned)
    assert [run for run, record in enumerate(forged) if record.status != "ok"] == [5, 7]
    assert [record.status for record in (forged[5], forged[7])] == ["solver-failed"] * 2
    for run, (one, other) in enumerate(zip(forged, honest, strict=True)):
        assert run in (5, 7) or one.result() == other.result()
