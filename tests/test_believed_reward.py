"""The planner that believes in part of a penalty, and the learner that starts from its plan."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from coartic import CONDITIONS, Movement, execute, learn_many, load_task
from coartic.baselines.believed_reward import METHODS, BelievedReward, cheapest, with_belief
from coartic.baselines.cma_es import CMAES
from coartic.baselines.posture_graph import PostureGraph
from coartic.errors import SolutionError
from coartic.method import Information, Session
from coartic.motion.penalty import penalties
from coartic.robot import Robot
from tests.support import reference
from tests.support.strategies import solve, tiny_task
from tests.test_learner import assert_equals_reference
from tests.test_penalty import TERMS, with_penalty

SMALL = tiny_task(
    robot={"left_links": [1.0, 0.6], "right_links": [1.2, 0.8]},
    start={"base": [0.0, 0.0], "left": [1.5, 0.4], "right": [0.4, 0.3]},
    goals=[[2.6, 1.0], [1.0, 1.9]],
    initial_hands="RL",
)
LEARNERS = {method.name: method for method in METHODS[1:]}
QUICK = {"nodes": 40, "graphs": 1, "starts": 4}


@cache
def plan_of(terms, belief=1.0):
    """What the planner hands over on the small task with a penalty, executed."""
    task = with_penalty(SMALL, **TERMS[terms]) if terms else SMALL
    method = BelievedReward(BelievedReward.Parameters(belief=belief, nodes=60, starts=4))
    session = Session(task, 0, method.told, trusted=True)
    return execute(task, method.solve(session).solution)


@pytest.mark.parametrize("terms", TERMS)
def test_who_is_told_the_truth_plans_best(terms):
    rewards = [plan_of(terms, belief).reward for belief in (0.0, 0.3, 1.0)]
    assert rewards[0] < rewards[2]
    assert rewards[1] <= rewards[2] + 2  # ticks of rounding
    task = with_penalty(SMALL, **TERMS[terms])
    for seed in range(2):  # long trial and error finds nothing that is much better
        searched = CMAES(CMAES.Parameters(trials=2000)).solve(Session(task, seed, CMAES.told))
        assert execute(task, searched.solution).reward <= rewards[2] + 3


def test_a_belief_is_a_share_of_each_term():
    task = with_penalty(SMALL, **TERMS["all"])
    half = {"joints": 15.0, "region": 20.0, "distinct": 25.0}
    believed = with_belief(task, 0.5)
    assert believed.penalty == task.penalty.model_copy(update=half)
    assert with_belief(task, 0.0) == SMALL
    result, execution, _ = solve(BelievedReward, task, belief=0.5, **QUICK)
    assert result.details["believed_reward"] == execute(believed, result.solution).reward
    assert result.details["believed_reward"] > execution.reward


def test_who_is_told_that_ticks_count_plans_as_without_a_penalty():
    for terms in TERMS:
        believer = plan_of(terms, 0.0)
        np.testing.assert_array_equal(believer.configurations, plan_of("", 1.0).configurations)
        assert believer.ticks == plan_of("").ticks <= plan_of(terms).ticks + 2


@pytest.mark.parametrize("terms", TERMS)
def test_programmes_and_graphs_count_the_penalty_as_the_score_does(terms):
    task = with_penalty(SMALL, **TERMS[terms])
    search = BelievedReward.Parameters(**QUICK)
    plans = cheapest(Session(task, 0, BelievedReward.told, trusted=True), task, search, [])
    seen = [(plan.cost, i.hands, plan.configurations) for i, plan in plans.ranked]
    seen = [(task, *each) for each in seen]
    for of_graph in (task, with_penalty("two-armed-2", **TERMS[terms])):
        penalty, rng = of_graph.penalty, np.random.default_rng(0)
        graph = PostureGraph.sample(of_graph, 30, rng, penalty=penalty)
        for each in graph.sequences(None, None):
            seen.append((of_graph, each.cost.min(), *graph.chain_of(each)))
    assert len(seen) > 20
    for task, cost, hands, configurations in seen:
        steps = np.diff(np.vstack([task.q0, configurations]), axis=0)
        length = np.sqrt((steps**2).sum(axis=1)).sum()
        lost = penalties(task, [hands], configurations[None]).sum()
        assert reference.penalty(task, list(configurations), list(hands)) == (
            penalties(task, [hands], configurations[None])[0].tolist()
        )
        assert abs(100 * (cost - length) - lost) <= 0.5 * len(hands) + 0.01  # its whole ticks


def test_the_learner_begins_with_the_plan():
    task = with_penalty("two-armed-1", **TERMS["distinct"])
    method = LEARNERS["believed-reward/EC4"]
    sessions = [Session(task, seed, method.told, trusted=True) for seed in range(2)]
    results = method(method.Parameters(trials=300, **QUICK)).solve_together(sessions)
    told = {"belief": 0.0, **QUICK}
    plan = Session(task, 0, BelievedReward.told, trusted=True)
    believer = BelievedReward(BelievedReward.Parameters(**told)).solve(plan)
    first = execute(task, believer.solution).reward
    for session, result in zip(sessions, results, strict=True):
        assert execute(task, result.initial).reward == first == session.rewards[0]
        assert execute(task, result.solution).reward == max(session.rewards) >= first
        assert session.meter.solver_iterations == plan.meter.solver_iterations > 0
    assert Information.REWARD_BY_TRIAL in method.told


@pytest.mark.parametrize("away", [0.0, 0.5])
def test_the_learner_from_a_plan_equals_the_slow_one(away):
    """With a plan that hits its goals, and with one that misses them and is corrected."""
    task, condition = with_penalty("two-armed-2", **TERMS["all"]), CONDITIONS["EC4"]
    hits = execute(task, learn_many(task, "EC4", seeds=[1], trials=50)[0].solution)
    start = [
        Movement(goal, hand, "planned", q + away)
        for goal, (hand, q) in enumerate(
            zip(["right", "left", "right", "right"], hits.configurations, strict=True), 1
        )
    ]
    assert_equals_reference(task, condition, trials=5, seed=3, start=start)
    assert learn_many(task, condition, seeds=[3], trials=1, start=start)[0].first_hands == "RLRR"


def test_a_plan_that_breaks_the_rules_is_refused():
    task = load_task("ascending")
    start = [Movement(1, "right", "planned", np.zeros(Robot().dof))]
    with pytest.raises(SolutionError, match="movements for goals"):
        learn_many(task, "EC1", seeds=[0], trials=5, start=start)
    whole = [replace(start[0], goal=goal, hand="left") for goal in (1, 2, 3)]
    with pytest.raises(SolutionError, match="no left hand"):
        learn_many(task, "EC1", seeds=[0], trials=5, start=whole)
