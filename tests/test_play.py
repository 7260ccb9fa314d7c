"""The model in JavaScript: the package's own numbers, in Node."""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from coartic import (
    Movement,
    corrective_trial,
    execute,
    learn,
    load_task,
    trajectory,
)
from coartic.learner.conditions import load_condition
from coartic.play.page import FOLDER
from coartic.robot import HANDS
from coartic.tasks.optima import best_shipped
from tests.support.strategies import (
    PAPER_CELLS,
    make_trials,
    metres_task,
    sample,
    uneven_task,
)

MODEL = FOLDER / "model.js"
NODE = shutil.which("node")
pytestmark = [pytest.mark.process, pytest.mark.skipif(NODE is None, reason="Node is not installed")]

OWN = {
    **{
        policy: load_task("two-armed/v1/i000").model_copy(update={"initial_hands": policy})
        for policy in ("best-of-all", "best-single-hand")
    },
    "uneven": uneven_task(locked_base=["x"]),
    "metres": metres_task(),
    "millimetre": metres_task(radius=1e-3),
    # The base is locked, and the left arm has one joint: its hand has no null space.
    "stiff": uneven_task(
        locked_base=["x", "y"], goals=[[2.5, 1.0], [-0.59, 0.835], [2.0, -1.0]], initial_hands="RLR"
    ),
}


def as_json(task):
    """A task as JSON values."""
    return task.model_dump(mode="json")


def node(script, *given):
    """What a function of ``coartic``, the model, and of JSON values returns."""
    program = f"""
      const coartic = require({json.dumps(str(MODEL))});
      const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
      process.stdout.write(JSON.stringify(({script})(...given)));
    """
    done = subprocess.run(
        [NODE, "-e", program], input=json.dumps(given), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


LEARN = """(cases) => cases.map(([task, id, drift, seed, trials]) => {
  const problem = coartic.problem_of(task);
  const [condition, credit] = id.split("-");
  const rules = { ...coartic.CONDITIONS[condition], drift, ...(credit && { credit }) };
  const learner = new coartic.Learner(problem, rules, BigInt(seed));
  const rewards = Array.from({ length: trials }, () => learner.step().reward);
  const { hands, reached, movements } = learner.learned();
  const made = coartic.execute(problem, movements);
  const { rows, hits } = coartic.trajectory(problem, made);
  const learned = [coartic.letters_of(hands), learner.replay().reward, made.reward];
  return { rewards, learned, reached, rows, hits };
})"""
RUNS = [
    *((task, condition, 0, 7) for task, condition in PAPER_CELLS),
    ("descending", "EC1-subtask", 0, 2**100 + 3),
    ("best-of-all", "EC4", 0, 0),
    ("best-single-hand", "EC4", 0, 2**63 - 1),
    ("ascending", "EC1", 0.03, 1),
    ("descending", "EC1-subtask", 0.3, 3),
    ("two-armed-1", "EC2", 0.1, 4),  # the base is on a rail
    ("two-armed-1", "EC3", 1, 5),
    ("long/v1/i000", "EC4", 0.3, 9),
    ("redundancy/v1/i007", "EC1", 0.3, 10),
    ("uneven", "EC4", 0.3, 11),
    ("stiff", "EC4", 0.3, 12),
    ("metres", "EC1", 0, 13),
    ("millimetre", "EC1", 0, 14),
]


def test_the_same_seed_learns_the_same_trial_by_trial():
    trials = 60
    tasks = [OWN.get(name) or load_task(name) for name, *_ in RUNS]
    cases = [
        (as_json(task), of, drift, str(seed), trials)
        for task, (_, of, drift, seed) in zip(tasks, RUNS, strict=True)
    ]
    for task, (_, of, drift, seed), run in zip(tasks, RUNS, node(LEARN, cases), strict=True):
        condition = replace(load_condition(of), drift=drift)
        ours = learn(task, condition, seed=seed, trials=trials)
        rewards = [None if reward is np.ma.masked else int(reward) for reward in ours.rewards]
        assert run["rewards"] == rewards
        made, film = ours.execute(), trajectory(task, ours.learned)
        assert run["learned"] == [ours.hands, ours.replay_reward, made.reward]
        assert run["hits"] == film.hits.tolist()
        np.testing.assert_allclose(run["rows"], film.configurations, rtol=0, atol=1e-9)
        np.testing.assert_allclose(run["reached"], made.configurations, rtol=0, atol=1e-9)
        assert len(set(rewards)) > 10


TRIALS = """(task, cases) => {
  const problem = coartic.problem_of(task);
  return cases.map(([hands, targets]) => {
    const rows = targets.map((row) => row.map((value) => value === null ? NaN : value));
    const { going, ticks } = coartic.make_trial(problem, hands, rows);
    return [going, ticks];
  });
}"""


def test_joints_without_a_target_keep_their_value():
    task = load_task("two-armed-1")
    hands, targets = sample(task, 60, noise=0.3)
    targets[np.random.default_rng(5).random(targets.shape) < 0.1] = np.nan
    given = np.where(np.isnan(targets), None, targets.astype(object)).tolist()
    codes = [["LR".index(hand) for hand in letters] for letters in hands]
    cases = [*zip(codes, given, strict=True)]
    ours = make_trials(task, hands, targets)
    due = np.transpose([ours.completed, ours.ticks]).tolist()
    assert node(TRIALS, as_json(task), cases) == due
    assert sum(ours.completed) > 40


PLAN = """(tasks) => tasks.map((task) => {
  const problem = coartic.problem_of(task);
  return [0, 1, task.goals.length - 1].map((ahead) => {
    const { reward, movements } = coartic.receding_horizon(problem, ahead);
    return { reward, movements };
  });
})"""


def test_plans_end_where_the_packages_do_and_say_their_true_reward():
    tasks = [load_task("ascending"), *(OWN[name] for name in ("uneven", "metres", "millimetre"))]
    for task, plans in zip(tasks, node(PLAN, [*map(as_json, tasks)]), strict=True):
        for plan in plans:
            movements = [
                Movement(m["goal"] + 1, HANDS[m["hand"]], m["kind"], np.array(m["target"]))
                for m in plan["movements"]
            ]
            assert execute(task, movements).reward == plan["reward"]
        assert plans[-1]["reward"] >= corrective_trial(task, task.initial_hands).reward
        if task.name == "ascending":
            # A plan of all goals is nearly the best known; with no goal ahead it is not.
            optimum = best_shipped(task).reward
            assert optimum * 1.03 <= plans[-1]["reward"] <= optimum
            assert plans[0]["reward"] < optimum * 1.04
