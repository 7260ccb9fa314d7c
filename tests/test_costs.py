"""Running times of any methods, beside a count of all pairs one by one."""

import math

import pytest

from coartic import CoarticError
from coartic.analysis import runtimes
from tests.support.made_up import MadeUp, row, study_of_trials

ONE, TWO, LEARNER, PLAN = "ascending", "two-armed-1", "dual-process/EC4", "posture-qp/current-goal"
LIMITS = {ONE: (-319, -292), TWO: (-532, -465)}  # best hands alone, optimum
TRIALS = {
    (ONE, "own"): [[-330, -319, -310, -300], [-319, -319, -292, -310]],
    (TWO, "own"): [[-675, math.nan, -560, -600, -470]],
    (TWO, LEARNER): [[-675, -570], [-570, -700]],
}  # by task and method: the reward of every trial of each run
PLANNED = {ONE: -300, TWO: -500}


@pytest.fixture(scope="module")
def study():
    plans = [row(PLAN, reward, task=task, trials=0, forward_kinematics=7, warm=True)
             for task, reward in PLANNED.items()]  # fmt: skip
    return study_of_trials(TRIALS, plans, forward_kinematics=10, warm=True)


def share_by_hand(tasks, method, targets, trials):
    """Pairs of run and target reached within so many trials, each task counting the same."""
    shares = []
    for task in tasks:
        (initial, best), pairs = LIMITS[task], []
        runs = [[PLANNED[task]]] if method == PLAN else TRIALS[task, method]
        for rewards in runs:
            seen = rewards if method == PLAN else rewards[:trials]
            for target in targets:
                pairs.append(any(r >= initial + target * (best - initial) - 1e-9 for r in seen))
        shares.append(sum(pairs) / len(pairs))
    return sum(shares) / len(shares)


@pytest.mark.parametrize("targets", [(0.5,), (0.25, 0.5, 1.0), [n / 20 for n in range(1, 21)]])
@pytest.mark.parametrize("method", ["own", PLAN])
def test_shares_are_those_of_all_pairs(study, method, targets):
    curves = runtimes(study, targets=targets)
    assert {*curves.method} == {"own", PLAN}  # the learner ran on one of the two tasks
    steps = curves[(curves.spend == "trials") & (curves.method == method)]
    for trials in range(6):
        within = steps.share[steps.budget <= trials].max() if trials or method == PLAN else 0.0
        by_hand = share_by_hand([ONE, TWO], method, targets, trials)
        assert (0 if math.isnan(within) else within) == pytest.approx(by_hand)
    assert (steps.share.diff().dropna() > 0).all()
    if len(targets) == 20:
        assert runtimes(study).equals(curves)


def test_what_cannot_be_shown(study, tmp_path):
    for targets in ([], [0.0], [1.01], [math.nan], [[0.5]]):
        with pytest.raises(CoarticError, match="needed are numbers above 0 and up to 1"):
            runtimes(study, targets=targets)
    with pytest.raises(CoarticError, match="no task has a best known reward"):
        runtimes(MadeUp(study, optima={}))
    with pytest.raises(CoarticError, match="there is no folder"):
        runtimes(tmp_path / "nowhere")
