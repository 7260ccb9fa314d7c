"""Move a goal, and find the number of trials after which a posture has shifted by half."""

import numpy as np

from coartic import CoarticError, MethodError, objective, parse_task

DISTANCES = [0.25, 0.5, 1.0]
"""Distances by which a goal moves, in length units. A link of the arm has length 1."""
HALF = 0.5


def moves(task, seed):
    """Yield tasks in which one goal has moved.

    For each goal but the last and each distance, the function yields the number of the goal (from
    0), the distance, and a task in which the next goal has moved by this distance. The direction is
    random, and the same for all distances. The moved goal stays at least four radii away from its
    neighbours. A goal for which no direction is found is left out.
    """
    rng, goals = np.random.default_rng([68, seed]), task.goal_array
    content = task.model_dump() | {"name": "changed"}
    for g in range(len(goals) - 1):
        neighbours = np.delete(goals, g + 1, axis=0)[max(g - 1, 0) : g + 2]
        for _ in range(100):
            angle = rng.uniform(0, 2 * np.pi)
            places = goals[g + 1] + np.outer(DISTANCES, [np.cos(angle), np.sin(angle)])
            if np.linalg.norm(places[:, None] - neighbours, axis=2).min() < 4 * task.radius:
                continue
            try:
                tasks = [parse_task(content | {"goals": [*goals[: g + 1], place, *goals[g + 2 :]]},
                                    "a changed task") for place in places]  # fmt: skip
                for other in tasks:
                    objective(other)  # raises MethodError if no hands hit all goals
            except (CoarticError, MethodError):
                continue
            yield from zip([g] * len(tasks), DISTANCES, tasks, strict=True)
            break


def with_shares(shifts, after):
    """Add the shares of the final shift after some numbers of trials to a frame of shifts.

    ``share_N`` is the share after N trials, ``dot_N`` divided by ``square``. ``log_half`` is the
    logarithm (base 10) of the number of trials until the share is a half. ``after`` has the numbers
    of trials.
    """
    shares = {f"share_{n}": shifts[f"dot_{n}"] / shifts.square for n in after}
    half = [trials_to_half(curve, after) for curve in np.array([*shares.values()]).T]
    return shifts.assign(**shares, log_half=half)


def trials_to_half(shares, after):
    """Return the logarithm (base 10) of the number of trials until a share is a half.

    The number is interpolated between those in ``after``. It is NaN if the last share is below a
    half.
    """
    if not shares[-1] >= HALF:
        return np.nan
    k = int((shares >= HALF).argmax())
    part = slice(k - 1, k + 1)
    return np.interp(HALF, shares[part], np.log10(after[part])) if k else 0.0
