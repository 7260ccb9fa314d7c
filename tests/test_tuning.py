"""The learner's parameters get the tuning that CMA-ES's got."""

from dataclasses import replace

import numpy as np

from coartic import CONDITIONS, learn_many, load_task
from coartic.analysis.calibration.tuning import (
    EPSILON,
    NOISE,
    TASKS,
    TUNED_BY,
    against_printed,
    tuned,
)

TRIALS = 40


def mean_reward(condition):
    return np.mean([
        run.reward
        for task in TASKS[condition.id]
        for run in learn_many(load_task(task), condition, seeds=TUNED_BY, trials=TRIALS)
    ])  # fmt: skip


def test_the_best_noise_is_chosen_and_then_the_best_epsilon():
    found = tuned("EC4", trials=TRIALS)
    printed = CONDITIONS["EC4"]
    by_noise = {sd: mean_reward(replace(printed, noise_sd=sd)) for sd in NOISE}
    assert by_noise[found.noise_sd] == max(by_noise.values()) > min(by_noise.values())
    kept = replace(printed, noise_sd=found.noise_sd)
    by_epsilon = {value: mean_reward(replace(kept, epsilon=value)) for value in EPSILON}
    assert by_epsilon[found.epsilon] == max(by_epsilon.values())
    assert replace(found, noise_sd=printed.noise_sd, epsilon=printed.epsilon) == printed


def test_without_hands_to_explore_there_is_no_epsilon():
    assert tuned("EC1", trials=5).epsilon == CONDITIONS["EC1"].epsilon


def test_what_is_printed_gains_nothing_on_itself():
    rows = list(against_printed([CONDITIONS["EC1"]], trials=10))
    assert [(row.task, row.gain.estimate) for row in rows] == [("ascending", 0), ("descending", 0)]
