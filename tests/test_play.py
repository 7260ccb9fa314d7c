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
from coartic.motion.solution import hand_sequences, initial_hands
from coartic.play.page import FOLDER
from coartic.robot import HANDS
from coartic.tasks.task import hands_of
from tests.support.strategies import (
    PAPER_CELLS,
    make_trials,
    metres_task,
    sample,
    shipped_optima,
    uneven_task,
)

MODEL = FOLDER / "model.js"
NODE = shutil.which("node")
pytestmark = [pytest.mark.process, pytest.mark.skipif(NODE is None, reason="Node is not installed")]

TASKS = [
    *("ascending", "two-armed-1", "two-armed-2"),
    *("one-armed/v1/i000", "long/v1/i000", "aligned/v1/i002", "redundancy/v1/i007"),
]


OWN = {
    "uneven": uneven_task(locked_base=["x"]),
    "metres": metres_task(),
    "millimetre": metres_task(radius=1e-3),
    # The base is locked, and the left arm has one joint: its hand has no null space.
    "stiff": uneven_task(
        locked_base=["x", "y"], goals=[[2.5, 1.0], [-0.59, 0.835], [2.0, -1.0]], initial_hands="RLR"
    ),
}


def node(script, *given):
    """What a function of ``coartic``, the model, and of JSON values returns."""
    program = f"""
      const coartic = require({json.dumps(str(MODEL))});
      const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
      Promise.resolve(({script})(...given))
        .then((answer) => process.stdout.write(JSON.stringify(answer)));
    """
    text = json.dumps(given)  # NaN has no place in it: None
    done = subprocess.run(
        [NODE, "-e", program], input=text, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def content(task):
    return task.model_dump(mode="json")


def listed(array):
    """An array with None for NaN."""
    return np.where(np.isnan(array), None, np.asarray(array, dtype=object)).tolist()


TRIALS = """(task, cases) => {
  const problem = coartic.problem_of(task);
  return cases.map(([hands, targets]) => {
    const rows = targets.map((row) => row.some((value) => value !== null)
      ? row.map((value) => value === null ? NaN : value) : null);
    const codes = [...hands].map((letter) => "LR".indexOf(letter));
    const trial = coartic.make_trial(problem, codes, rows);
    const { going, ticks, reached, movements } = trial;
    const corrections = movements.filter((m) => m.kind === "corrective" && m.ticks).length;
    return { going, ticks, reached, corrections };
  });
}"""


@pytest.mark.parametrize("name", [*TASKS, "uneven", "metres", "millimetre"])
def test_random_trials_are_those_of_the_package(name):
    task = uneven_task() if name == "uneven" else OWN.get(name) or load_task(name)
    rng = np.random.default_rng(5)
    halves = [sample(task, 50, noise, seed=7) for noise in (0.05, 0.5)]
    hands, targets = halves[0][0] + halves[1][0], np.concatenate([half[1] for half in halves])
    targets[rng.random(targets.shape) < 0.1] = np.nan  # joints that keep their value
    targets[rng.random(targets.shape[:2]) < 0.2] = np.nan  # goals that are left to A
    ours = make_trials(task, hands, targets)
    cases = list(zip(hands, listed(targets), strict=True))
    theirs = node(TRIALS, content(task), cases)
    assert [trial["going"] for trial in theirs] == ours.completed.tolist()
    assert sum(ours.completed) > 80
    assert [trial["ticks"] for trial in theirs] == ours.ticks.tolist()
    assert [trial["corrections"] for trial in theirs] == ours.corrections.tolist()
    for trial, reached in zip(theirs, ours.reached, strict=True):
        hit = reached[~np.isnan(reached[:, 0])]
        np.testing.assert_allclose(np.reshape(trial["reached"], hit.shape), hit, rtol=0, atol=1e-9)


EXECUTE = """(task, solutions) => {
  const problem = coartic.problem_of(task);
  return solutions.map((movements) => {
    const trial = coartic.execute(problem, movements);
    const { rows, hits } = coartic.trajectory(problem, trial);
    const made = trial.movements.map((m) => [m.goal + 1, m.hand, m.kind, m.ticks]);
    return { reward: trial.reward, made, rows, hits };
  });
}"""


def test_straight_solutions_are_executed_tick_by_tick():
    task = load_task("two-armed-1")
    rng = np.random.default_rng(3)
    hands, targets = sample(task, 60, noise=0.2, seed=11)
    solutions = []
    for letters, rows in zip(hands, targets, strict=True):
        movements = []
        for number, (hand, target) in enumerate(zip(hands_of(letters), rows, strict=True), 1):
            kind = str(rng.choice(["learned", "planned", "corrective"]))
            gone = None if kind == "corrective" and rng.random() < 0.5 else target
            movements.append(Movement(number, hand, kind, gone))
        solutions.append(movements)
    plain = [
        [{"goal": m.goal - 1, "hand": HANDS.index(m.hand), "kind": m.kind,
          "target": None if m.target is None else m.target.tolist()} for m in movements]
        for movements in solutions
    ]  # fmt: skip
    theirs, completed = node(EXECUTE, content(task), plain), 0
    for movements, film in zip(solutions, theirs, strict=True):
        outcome = execute(task, movements)
        made = [[m.goal, HANDS.index(m.hand), m.kind, m.ticks] for m in outcome.movements]
        assert film["made"][: len(made)] == made
        assert film["reward"] == outcome.reward
        if not outcome.completed:
            continue
        ours = trajectory(task, movements)
        completed += 1
        assert film["hits"] == ours.hits.tolist()
        np.testing.assert_allclose(film["rows"], ours.configurations, rtol=0, atol=1e-9)
    assert completed > 10


LEARN = """(cases) => cases.map(([task, id, drift, seed, trials]) => {
  const problem = coartic.problem_of(task);
  const [condition, credit] = id.split("-");
  const rules = { ...coartic.CONDITIONS[condition], drift, ...(credit && { credit }) };
  const learner = new coartic.Learner(problem, rules, BigInt(seed));
  const rewards = Array.from({ length: trials }, () => learner.step().reward);
  const { hands, reached } = learner.learned();
  return { rewards, replay: learner.replay().reward, learned: coartic.letters_of(hands), reached };
})"""
RUNS = [
    *((task, condition, 0, 7) for task, condition in PAPER_CELLS),
    ("descending", "EC1-subtask", 0, 2**100 + 3),
    ("two-armed-1", "EC4-subtask", 0, 0),
    ("two-armed/v1/i003", "EC4", 0, 2**63 - 1),
    ("ascending", "EC1", 0.03, 1),
    ("descending", "EC1", 1, 2),
    ("descending", "EC1-subtask", 0.3, 3),
    ("two-armed-1", "EC2", 0.1, 4),  # the base is on a rail
    ("two-armed-1", "EC3", 1, 5),
    ("two-armed-1", "EC4", 0.3, 6),
    ("two-armed-2", "EC3", 0.3, 7),
    ("two-armed-2", "EC4", 1, 8),
    ("long/v1/i000", "EC4", 0.3, 9),
    ("redundancy/v1/i007", "EC1", 0.3, 10),
    ("uneven", "EC4", 0.3, 11),
    ("stiff", "EC4", 0.3, 12),
    ("metres", "EC1", 0, 13),
    ("millimetre", "EC1", 0, 14),
]


def test_the_same_seed_learns_the_same_trial_by_trial():
    trials = 500
    tasks = [OWN.get(name) or load_task(name) for name, *_ in RUNS]
    cases = [
        (content(task), of, drift, str(seed), trials)
        for task, (_, of, drift, seed) in zip(tasks, RUNS, strict=True)
    ]
    for task, (_, of, drift, seed), run in zip(tasks, RUNS, node(LEARN, cases), strict=True):
        condition = replace(load_condition(of), drift=drift)
        ours = learn(task, condition, seed=seed, trials=trials)
        rewards = [None if reward is np.ma.masked else int(reward) for reward in ours.rewards]
        assert run["rewards"] == rewards
        assert run["replay"] == ours.replay_reward
        assert run["learned"] == ours.hands
        reached = ours.execute().configurations
        np.testing.assert_allclose(run["reached"], reached, rtol=0, atol=1e-9)
        assert len(set(rewards)) > 10


def test_random_numbers_are_numpys():
    script = """(seeds, count) => seeds.map((seed) => {
      const rng = new coartic.Generator(BigInt(seed));
      return Array.from({ length: count }, (_, k) => k % 3 ? rng.standard_normal() : rng.random());
    })"""
    seeds, count = [0, 1, 2**32, 2**63 - 25, 2**128 - 1], 15_000  # the tail is 1 in 4000
    for seed, draws in zip(seeds, node(script, list(map(str, seeds)), count), strict=True):
        rng = np.random.default_rng(seed)
        ours = [rng.standard_normal() if k % 3 else rng.random() for k in range(count)]
        np.testing.assert_allclose(draws, ours, rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", ["two-armed-2", "two-armed/v1/i000"])
def test_initial_hands_follow_the_policy(name):
    for policy in ("best-of-all", "best-single-hand"):
        task = load_task(name).model_copy(update={"initial_hands": policy})
        script = "(task) => coartic.letters_of(coartic.initial_hands(coartic.problem_of(task)))"
        assert node(script, content(task)) == initial_hands(task)
    assert len(hand_sequences(task)) > 2


PLAN = """(task, horizons) => {
  const problem = coartic.problem_of(task);
  return horizons.map((horizon) => {
    const { reward, movements } = coartic.receding_horizon(problem, horizon);
    return { reward, movements };
  });
}"""


@pytest.mark.parametrize("name", ["ascending", "two-armed-2", "metres", "millimetre"])
def test_plans_end_where_the_packages_do_and_say_their_true_reward(name):
    task = OWN.get(name) or load_task(name)
    plans = node(PLAN, content(task), list(range(len(task.goals))))
    for plan in plans:
        movements = [
            Movement(m["goal"] + 1, HANDS[m["hand"]], m["kind"], np.array(m["target"]))
            for m in plan["movements"]
        ]
        assert execute(task, movements).reward == plan["reward"]
    if name in OWN:
        assert plans[-1]["reward"] >= corrective_trial(task, task.initial_hands).reward
        return
    # A plan of all goals is nearly the best known; with no goal ahead it is not.
    rewards_by_task = {
        (entry.task, entry.base, entry.other_arm): entry.reward for entry in shipped_optima()
    }
    optimum = rewards_by_task[name, "task", "free"]
    assert optimum * 1.03 <= plans[-1]["reward"] <= optimum
    assert plans[0]["reward"] < optimum * 1.04
