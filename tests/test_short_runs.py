"""One short run of each stochastic method, with the numbers that it has.

They were computed once, by version 3.0.0; the rows of random search and of the informed learner,
which changed after it, by version 4.0.0. A change of a method's code that changes no test of its
own changes them.
"""

import pytest

from coartic import execute, load_task
from coartic.method import run_method
from tests.support.suites import KNOWN

TASK = load_task("two-armed-2")
RUNS = {
    "dual-process/EC1": (-355, "RRRR", 2_000, 760_768),
    "dual-process/EC2": (-357, "RRRR", 2_000, 771_197),
    "dual-process/EC3": (-347, "RLRR", 2_000, 800_259),
    "dual-process/EC4": (-357, "RRRR", 2_000, 821_009),
    "dual-process/EC1-uncorrected": (-357, "RRRR", 2_000, 384_054),
    "dual-process/EC1-subtask": (-365, "RRRR", 2_000, 775_757),
    "dual-process/EC4-uncorrected": (-357, "RRRR", 2_000, 406_895),
    "dual-process/EC4-subtask": (-358, "RRRR", 2_000, 826_555),
    "dual-process/EC1-informed": (-350, "RRRR", 2_000, 749_342),
    "dual-process/EC4-informed": (-337, "RLLR", 2_000, 771_899),
    "dual-process/custom": (-357, "RRRR", 2_000, 821_009),
    "random-search": (-357, "RRRR", 2_000, 772_395),
    "random-search/hands": (-354, "RLRR", 2_000, 947_662),
    "hill-climbing": (-354, "RRRR", 2_000, 818_525),
    "cma-es/bandit": (-315, "RLRR", 2_000, 774_098),
    "cma-es/goal-by-goal": (-349, "RRRR", 2_000, 764_277),
    "posture-based/one-goal": (-350, "RRRR", 0, 0),
    "posture-based/two-goals": (-346, "RRRR", 0, 0),
}
"""Reward, hands, trials and control ticks of all trials, by method, with seed 1."""


def test_each_stochastic_method_has_a_run():
    assert {*RUNS} == {name for name, info in KNOWN.items() if info.stochastic}


@pytest.mark.parametrize("name", RUNS)
def test_a_short_run_is_what_it_was(name):
    options = {"trials": 2000} if "trials" in KNOWN[name].defaults else {}
    result, session = run_method(KNOWN[name].configure(options), TASK, seed=1)
    due, meter = execute(TASK, result.solution), session.meter
    assert (due.reward, due.hands, meter.trials, meter.movement_ticks) == RUNS[name]
