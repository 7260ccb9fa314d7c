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
"""Robot with uneven arms. It has at most as many links as the paper's robot, for which kernels are
compiled."""


def configurations(robot, low=-4.0, high=4.0):
    return arrays(np.float64, robot.dof, elements=st.floats(low, high))


def posture(x=0.0, y=0.0, **joints):
    """Return a posture of the paper's robot with its base at (x, y) and arms straight along +x.

    The right hand is at (x + 4.5, y + 0.1). Keyword arguments such as ``right_2=0.3`` set joints.
    """
    q = np.array([x, y, *[0.0] * 8])
    for name, angle in joints.items():
        hand, number = name.split("_")
        q[(2 if hand == "left" else 6) + int(number) - 1] = angle
    return q


def tiny_task(**changes):
    """Return a task with two goals for the paper's robot. Its initial hands are right hands.

    Keyword arguments replace keys of the task.
    """
    content = {
        "name": "tiny",
        "goals": [[5.0, 1.0], [5.0, 2.0]],
        "start": {"left": [0.0] * 4, "right": [0.0] * 4},
    }
    content.update(changes)
    content.setdefault("initial_hands", "R" * len(content["goals"]))
    return parse_task({key: value for key, value in content.items() if value is not None}, "tiny")


STUCK = tiny_task(name="stuck", locked_base=["x", "y"], hands=["right"], goals=[[2.5, 0.1]])
"""Task on which the corrective process cannot leave the start."""


def failing_task(goals=((1.5, 0.1),), hands="R"):
    """Return a task on which the corrective process of the left hand cannot leave the start.

    The left hand starts on a stationary point.
    """
    start = {"left": [0.0] * 4, "right": [0.5, 0.5, 0.0, 0.0]}
    return tiny_task(goals=goals, initial_hands=hands, locked_base=["x", "y"], start=start)


def uneven_task(left=(1.0,), right=(0.5, -0.5, 0.2, 1.0), base=(0.0, 0.0), **changes):
    """Return a task as :func:`tiny_task`, but for an uneven robot.

    Its arms start with the joints ``left`` and ``right`` (in rad). By default it has three goals
    for both hands.
    """
    if "goals" not in changes:
        changes["goals"], changes["initial_hands"] = [[2.5, 1.0], [-0.5, 2.0], [2.0, -1.0]], "RLR"
    keys = ("left_links", "right_links", "left_shoulder")
    start = {"base": list(base), "left": list(left), "right": list(right)}
    return tiny_task(
        robot={key: list(getattr(UNEVEN, key)) for key in keys}, start=start, **changes
    )


def metres_task(radius=0.01, **changes):
    """Return a task as :func:`tiny_task`, but for a person's right arm (0.33 + 0.27 m).

    The trunk is fixed.
    """
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
"""Task with a tie. At the start, both hands are in goal 1, the right hand is in goal 2, and the
left hand is in goal 3. LRL and RRL need no movement; RRL has fewer changes of hand."""


def changed(like, **update):
    """Return a shipped task with some keys changed. Its goals can be out of reach."""
    content = {**load_task(like).model_dump(mode="json"), **update}
    return parse_task(content, "test", reach=False)


AS_RELEASED = changed("two-armed-2", goals=[[6.5, 0.5], [6.0, 1.5], [6.5, 2.5], [6.5, 3.5]])
"""The task with the goals of the first release, on which RLRR and RRRR tie."""


def sample(task, count, noise=0.3, seed=0):
    """Return random hand sequences, with noisy targets around their corrective postures."""
    rng = np.random.default_rng(seed)
    hands = [str(sequence) for sequence in rng.choice(hand_sequences(task), count)]
    targets = np.array([corrective_trial(task, sequence).configurations for sequence in hands])
    free = [axis not in task.locked_base for axis in "xy"] + [True] * (task.robot.dof - 2)
    return hands, targets + noise * np.array(free) * rng.standard_normal(targets.shape)


def random_solution(task, model, rng):
    """Return random movements of all kinds, up to three for a goal.

    Targets are near postures that hit the goal, or far from them. Some coordinates have the values
    that they have in the corrective process alone before the goal.
    """
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
    """Run a built-in method on a task, and return its result, the execution, and the session.

    The solution is executed without the motor noise of the model.
    """
    options = {"trial_budget": budget, "model": model, "trusted": True}
    session = Session(as_task(task), seed, method.information, **options)
    result = method(method.Parameters(**parameters)).solve(session)
    return result, execute(task, result.solution, model=model.without_noise()), session


def make_trials(task, hands, targets, model=PAPER):
    """Make trials in a new session."""
    return Session(task, 0, OPTIMISER_INFORMATION, model=model).trials(hands, targets)


def steps_from(q, configurations):
    """Return the changes of the joints from one posture to the next, beginning with ``q``."""
    return np.diff(np.vstack([q, *configurations]), axis=0)


def least_cost(task, hands, moving, starts, *, radius, square=False, base_weight=1.0):
    """Return the smallest length of steps in joint space with which hands hit all goals.

    With ``square``, it is the smallest sum of squares. The minimum is found by SLSQP from
    ``starts``, over the steps of the joints that are ``moving``, shape (G, dof). All other steps
    are 0. Steps of the base count ``base_weight`` times.
    """

    weights = np.where(np.arange(task.robot.dof) < 2, base_weight, 1.0)

    def steps(x):
        steps = np.zeros(moving.shape)
        steps[moving] = x
        return steps

    def cost(x):
        squares = ((steps(x) * weights) ** 2).sum(axis=1)
        return squares.sum() if square else np.sqrt(squares + 1e-14).sum()

    def room(x):
        postures = zip(task.q0 + np.cumsum(steps(x), axis=0), hands, strict=True)
        places = [task.robot.forward_kinematics(q, hand) for q, hand in postures]
        return radius - np.linalg.norm(places - task.goal_array, axis=1)

    options = {"constraints": {"type": "ineq", "fun": room}, "options": {"maxiter": 500}}
    minima = [minimize(cost, start, method="SLSQP", tol=1e-10, **options) for start in starts]
    return min(each.fun for each in minima if room(each.x).min() > -1e-6)


def shipped_optima():
    """Return the entries of the shipped optima, with None for a missing reward or bound."""
    return [SimpleNamespace(**({"reward": None, "bound": None} | entry)) for entry in entries()]
