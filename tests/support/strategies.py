"""Hypothesis strategies and small tasks shared by several test modules."""

from types import SimpleNamespace

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from coartic import (
    PAPER,
    Movement,
    Robot,
    corrective_trial,
    execute,
    hand_sequences,
    load_task,
    parse_task,
)
from coartic.method import Session
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.tasks.catalogue import as_task
from coartic.tasks.optima import entries
from coartic.tasks.task import hands_of

PAPER_CELLS = [
    ("ascending", "EC1"),
    ("descending", "EC1"),
    ("two-armed-1", "EC2"),
    ("two-armed-1", "EC3"),
    ("two-armed-1", "EC4"),
    ("two-armed-2", "EC3"),
    ("two-armed-2", "EC4"),
]

UNEVEN = Robot(left_links=(0.7,), right_links=(1.2, 0.4, 0.9, 0.6), left_shoulder=(-0.3, 0.2))
"""As many links as the paper's robot at most: its kernels are compiled for that number."""


def configurations(robot, low=-4.0, high=4.0):
    return arrays(np.float64, robot.dof, elements=st.floats(low, high))


def posture(x=0.0, y=0.0, **joints):
    """The paper's arms straight along +x, its base at (x, y): the right hand is at (x + 4.5, y +
    0.1); ``right_2=0.3`` and the like bend them."""
    q = np.array([x, y, *[0.0] * 8])
    for name, angle in joints.items():
        hand, number = name.split("_")
        q[(2 if hand == "left" else 6) + int(number) - 1] = angle
    return q


def tiny_task(**changes):
    """A two-goal task for the paper's robot, whose initial hands are right ones; keyword arguments
    replace its keys."""
    content = {
        "name": "tiny",
        "goals": [[5.0, 1.0], [5.0, 2.0]],
        "start": {"left": [0.0] * 4, "right": [0.0] * 4},
    }
    content.update(changes)
    content.setdefault("initial_hands", "R" * len(content["goals"]))
    return parse_task({key: value for key, value in content.items() if value is not None}, "tiny")


STUCK = tiny_task(name="stuck", locked_base=["x", "y"], hands=["right"], goals=[[2.5, 0.1]])
"""The corrective process cannot leave where it starts."""


def failing_task(goals=((1.5, 0.1),), hands="R"):
    """The left hand starts on a stationary point: its corrective process cannot leave."""
    start = {"left": [0.0] * 4, "right": [0.5, 0.5, 0.0, 0.0]}
    return tiny_task(goals=goals, initial_hands=hands, locked_base=["x", "y"], start=start)


def uneven_task(left=(1.0,), right=(0.5, -0.5, 0.2, 1.0), base=(0.0, 0.0), **changes):
    """As :func:`tiny_task`, for an uneven robot, whose arms start with these joints (rad); with
    three goals for both hands unless others are given."""
    if "goals" not in changes:
        changes["goals"], changes["initial_hands"] = [[2.5, 1.0], [-0.5, 2.0], [2.0, -1.0]], "RLR"
    keys = ("left_links", "right_links", "left_shoulder")
    start = {"base": list(base), "left": list(left), "right": list(right)}
    return tiny_task(
        robot={key: list(getattr(UNEVEN, key)) for key in keys}, start=start, **changes
    )


def metres_task(radius=0.01, **changes):
    """As :func:`tiny_task`, for a person's right arm in metres, 0.33 + 0.27, with a fixed trunk."""
    place = [0.0, 0.0]
    robot = {"left_links": [0.33], "right_links": [0.33, 0.27], "left_shoulder": place}
    return tiny_task(
        **{
            "robot": {**robot, "right_shoulder": place},
            "start": {"base": place, "left": [0.0], "right": [1.047, 1.047]},
            "hands": ["right"], "radius": radius, "locked_base": ["x", "y"],
            "goals": [[0.13, 0.42], [0.2, 0.35], [0.05, 0.45]],
            **changes,
        }
    )  # fmt: skip


TIED = tiny_task(
    goals=[[4.0, 0.1], [4.9, 0.1], [3.1, 0.1]], radius=0.6, initial_hands="best-of-all"
)
"""At the start both hands are in goal 1, the right one in goal 2 and the left one in goal 3: of LRL
and RRL, which need no movement, RRL has fewer changes of hand."""


def changed(like, **update):
    """A shipped task with some keys changed, reachable or not."""
    content = {**load_task(like).model_dump(mode="json"), **update}
    return parse_task(content, "test", reach=False)


AS_RELEASED = changed("two-armed-2", goals=[[6.5, 0.5], [6.0, 1.5], [6.5, 2.5], [6.5, 3.5]])
"""The task with its goals of the first release, in which RLRR and RRRR tie."""


def sample(task, count, noise=0.3, seed=0):
    """Hand sequences, and targets around what the corrective process does with them."""
    rng = np.random.default_rng(seed)
    hands = [str(sequence) for sequence in rng.choice(hand_sequences(task), count)]
    targets = np.array([corrective_trial(task, sequence).configurations for sequence in hands])
    free = [axis not in task.locked_base for axis in "xy"] + [True] * (task.robot.dof - 2)
    return hands, targets + noise * np.array(free) * rng.standard_normal(targets.shape)


def random_solution(task, model, rng):
    """Movements of all kinds, up to three for a goal, near what hits the goal and far from it; some
    coordinates stay where the corrective process alone would have them before."""
    hands = str(rng.choice(hand_sequences(task)))
    alone = [task.q0, *corrective_trial(task, hands, model=model).configurations]
    alone += [alone[-1]] * (len(task.goals) + 1 - len(alone))
    locked = ["xy".index(coordinate) for coordinate in task.locked_base]

    def configuration(goal):
        q = alone[goal + 1] + rng.choice([0.0, 0.02, 0.3]) * rng.standard_normal(len(task.q0))
        stays = rng.random(len(q)) < 0.2
        q[stays] = alone[goal][stays]
        q[locked] = task.q0[locked]
        return q

    def movement(goal, hand):
        kind = str(rng.choice(["learned", "planned", "corrective", "path"]))
        if kind == "path":
            way = [configuration(goal) for _ in range(rng.integers(1, 4))]
            return Movement(goal + 1, hand, kind, waypoints=np.array(way))
        acts = kind == "corrective" and rng.random() < 0.5
        return Movement(goal + 1, hand, kind, None if acts else configuration(goal))

    return [
        movement(goal, hand)
        for goal, hand in enumerate(hands_of(hands))
        for _ in range(rng.integers(1, 4))
    ]


def solve(method, task, seed=0, *, budget=None, model=PAPER, **parameters):
    """What a method of this project finds on a task or its name, the execution of it, and the
    session."""
    options = {"trial_budget": budget, "model": model, "trusted": True}
    session = Session(as_task(task), seed, method.information, **options)
    result = method(method.Parameters(**parameters)).solve(session)
    return result, execute(task, result.solution), session


def make_trials(task, hands, targets, model=PAPER):
    """Trials in a session of their own."""
    return Session(task, 0, OPTIMISER_INFORMATION, model=model).trials(hands, targets)


def steps_from(q, configurations):
    """Changes of the joints from one posture to the next, beginning with ``q``."""
    return np.diff(np.vstack([q, *configurations]), axis=0)


def least_cost(task, hands, moving, starts, *, radius, square=False):
    """The least length, or sum of squares, of steps in joint space by which hands hit all goals: by
    SLSQP, from steps of the joints that are ``moving``, shape (G, dof); all others are 0."""

    def steps(x):
        steps = np.zeros(moving.shape)
        steps[moving] = x
        return steps

    def cost(x):
        squares = (steps(x) ** 2).sum(axis=1)
        return squares.sum() if square else np.sqrt(squares + 1e-14).sum()

    def room(x):
        postures = zip(task.q0 + np.cumsum(steps(x), axis=0), hands, strict=True)
        places = [task.robot.forward_kinematics(q, hand) for q, hand in postures]
        return radius - np.linalg.norm(places - task.goal_array, axis=1)

    options = {"constraints": {"type": "ineq", "fun": room}, "options": {"maxiter": 500}}
    minima = [minimize(cost, start, method="SLSQP", tol=1e-10, **options) for start in starts]
    return min(each.fun for each in minima if room(each.x).min() > -1e-6)


def shipped_optima():
    """Entries of the shipped optima, with None for what they do not have."""
    return [SimpleNamespace(**({"reward": None, "bound": None} | entry)) for entry in entries()]
