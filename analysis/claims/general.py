"""The paper's claims about all tasks, its processes, and informed search."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from analysis.claims.data import BEST, CELLS, LEARNER, SMOOTH, Data
from analysis.claims.reach import shortest_reach
from analysis.claims.register import Claim, Finding
from analysis.claims.resemblance import CRITERION, TEST, resembles
from analysis.published import TRIALS
from analysis.signatures.subtasks import postures_before
from analysis.statistics import bootstrap_test, mean
from analysis.study import SEED
from analysis.table import interval
from coartic.task import hands_of

CLOSE = 0.10
"""Of a way beyond the shortest: "close to the shortest distance"."""
_PLAN = "trajectory-optimisation/"


def _learning_improves(data: Data) -> Finding:
    tests, parts = [], []
    for task, condition in CELLS:
        initial = float(data.learned(task, condition).initial_reward.iloc[0])
        replays = data.replays(task, condition)
        tests.append(bootstrap_test(replays, initial, seed=SEED))
        parts.append(f"{task} {condition} {initial:.0f} to {interval(mean(replays, seed=SEED))}")
    return Finding(
        all(test.estimate > 0 for test in tests),
        "noiseless replay with the final tables: " + "; ".join(parts),
        tuple(tests),
    )


def _corrective_ensures(data: Data) -> Finding:
    trials = failed = sequences = missed = 0
    for task, condition in CELLS:
        runs = data.learned(task, condition)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    for task in dict.fromkeys(task for task, _ in CELLS):
        rewards = list(data.sequences(task).values())
        sequences += len(rewards)
        missed += sum(map(math.isnan, rewards))
    return Finding(
        not failed and not missed,
        f"{failed} of {trials} trials of the learner do not hit every goal; alone and without "
        f"any practice it completes its task with {sequences - missed} of {sequences} hand "
        "sequences",
    )


def _corrective_near_shortest(data: Data) -> Finding:
    parts, excess, worst = [], [], (0.0, "")
    for name in dict.fromkeys(task for task, _ in CELLS):
        task, initial = data.task(name), data.initial(name)
        taken = shortest = 0.0
        for k, (q, hand) in enumerate(
            zip(postures_before(initial, task), hands_of(initial.hands), strict=True)
        ):
            end = initial.configurations[k]
            way = float(np.linalg.norm(end - q))
            least = shortest_reach(task, q, hand, k + 1, end, SEED)
            taken, shortest = taken + way, shortest + least
            worst = max(worst, (way / least - 1, f"goal {k + 1} of {name}"))
        excess.append(taken / shortest - 1)
        parts.append(f"{name} {taken:.2f} against {shortest:.2f} ({excess[-1]:+.1%})")
    return Finding(
        max(excess) <= CLOSE,
        f"joint-space length of all subtasks: {'; '.join(parts)}; farthest from the shortest is "
        f"{worst[1]} ({worst[0]:+.1%})",
    )


def _less_experience(data: Data) -> Finding:
    parts, holds = [], True
    for task, condition in BEST:
        data.runs(task, LEARNER + condition)
        learner = data.study.methods[task, LEARNER + condition]
        better, best = [], False
        for cost in ("path-length", *SMOOTH):
            data.runs(task, _PLAN + cost)
            plan = data.study.methods[task, _PLAN + cost]
            holds &= plan["trials"] == 0 and len(plan["told"]) > len(learner["told"])
            if plan["reward"] >= learner["reward"]:
                better.append(f"{cost} ({plan['told']})")
                best = best or cost == "path-length"
        parts.append(
            f"{task}: learner {learner['reward']:.1f} after {learner['trials']:.0f} trials, told "
            f"{learner['told']}; as good or better without any: {', '.join(better) or 'none'}"
        )
        holds &= best
    return Finding(holds, "; ".join(parts))


def _low_computation(data: Data) -> Finding:
    parts, runs, trials = [], [], []
    for task, condition in BEST:
        shown = []
        for method in (LEARNER + condition, f"{_PLAN}path-length"):
            data.runs(task, method)
            row = data.study.methods[task, method]
            shown.append(row["forward_kinematics"] + row["jacobians"])
        learner, plan = shown
        runs.append(learner < plan)
        trials.append(learner / TRIALS < plan)
        parts.append(f"{task} {learner:.3g}, {learner / TRIALS:.0f} and {plan:.3g}")
    agree = all(runs + trials) or not any(runs + trials)
    return Finding(
        all(runs) if agree else None,
        f"evaluations in a run of {TRIALS} trials, in one trial, and in a plan: "
        + "; ".join(parts)
        + ("" if agree else ". The answer depends on whether a trial or a skill is counted"),
    )


def _beats_inaccurate(data: Data) -> Finding:
    tests, parts = [], []
    for task, condition in BEST:
        rewards = data.rewards(task, condition)
        shown = []
        for cost in SMOOTH:
            data.runs(task, _PLAN + cost)
            plan = float(data.study.methods[task, _PLAN + cost]["reward"])
            tests.append(bootstrap_test(rewards, plan, seed=SEED))
            shown.append(f"{cost} {plan:.0f}")
        parts.append(f"{task}: learner {interval(mean(rewards, seed=SEED))}, {', '.join(shown)}")
    holds = any(test.estimate > 0 for test in tests)
    # The claim is that there are such cases: the best of all tests, corrected for their number.
    best = min(tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(tests)))
    return Finding(holds, "; ".join(parts), (best,))


_DISCUSSION = "Introduction; Discussion, Integrating Informed and Uninformed Search"

GENERAL: tuple[Claim, ...] = (
    Claim(
        "learning-improves",
        "Learning improves on the initial solution, on every task and under every condition.",
        "General",
        "one-tailed bootstrap tests of noiseless replays against the initial reward, seven cells",
        _learning_improves,
        "Results, Exploration Conditions 1 to 4",
        "Figures 5 to 8",
    ),
    Claim(
        "corrective-ensures",
        "The corrective process ensures that the task is accomplished in every trial, and "
        "accomplishes any of the tasks without experience.",
        "General",
        "exact: failed trials of the learner, hand sequences without a reward",
        _corrective_ensures,
        "Methods, The Corrective Process; Discussion, Multiple Controller Schemes",
    ),
    Claim(
        "corrective-near-shortest",
        "The corrective process alone is close to the shortest way in joint space for each "
        "subtask in isolation.",
        "General",
        f"exact: initial solutions are at most {CLOSE:.0%} longer, over a task's subtasks, than "
        "the shortest ways from the same postures (found by search)",
        _corrective_near_shortest,
        "Methods, The Corrective Process",
    ),
    Claim(
        "resembles-squared-changes",
        f"Learned movements are similar to those planned for smoothness: "
        f"{SMOOTH['squared-changes']}. The paper says no more than similar; judged is that "
        f"{CRITERION}.",
        "General",
        TEST,
        resembles("squared-changes"),
        "Methods, The Learning Process",
    ),
    Claim(
        "less-experience",
        "Informed search needs less experience than learning by trial, and more information.",
        "General",
        "planners make no trial (by design), are told more kinds of information, and planning the "
        "shortest path is at least as good (letters of what is told: docs/methods.md)",
        _less_experience,
        _DISCUSSION,
    ),
    Claim(
        "low-computation",
        "Learning by trial needs less computation than informed search.",
        "General",
        "evaluations of forward kinematics and Jacobian beside those of planning the shortest "
        "path; judged where a run and a single trial give the same answer",
        _low_computation,
        _DISCUSSION,
    ),
    Claim(
        "beats-inaccurate",
        "Learning by trial can find better movements than informed search whose objective is not "
        "the reward.",
        "General",
        "one-tailed bootstrap tests against plans for smoothness (free times) on every task; at "
        "least one holds, the smallest p times their number (Bonferroni)",
        _beats_inaccurate,
        "Discussion, Implications of Using a Simple Learning Process",
    ),
)
