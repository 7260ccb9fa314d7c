"""Move a goal, and find after how many trials half of the shift of a posture is there."""

import numpy as np

from coartic import CoarticError, MethodError, objective, parse_task

DISTANCES = [0.25, 0.5, 1.0]
"""By which a goal moves, length units; a link of the arm is 1."""
HALF = 0.5


def moves(task, seed):
    """Yield, for each goal but the last and each distance, the goal (from 0), the distance, and the
    task with the goal after it moved by this distance. The direction is random, the same for all
    distances; the moved goal stays apart from its neighbours. A goal for which no direction is
    found is left out."""
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
                    objective(other)  # or it says that no hands hit them all
            except (CoarticError, MethodError):
                continue
            yield from zip([g] * len(tasks), DISTANCES, tasks, strict=True)
            break


def with_shares(shifts, after):
    """Add ``share_N`` of the final shift that is there after N trials, and ``log_half``, the
    logarithm (base 10) of the trials until the share is a half, to columns ``dot_N`` and
    ``square``. ``after`` has the numbers of trials."""
    shares = {f"share_{n}": shifts[f"dot_{n}"] / shifts.square for n in after}
    half = [trials_to_half(curve, after) for curve in np.array([*shares.values()]).T]
    return shifts.assign(**shares, log_half=half)


def trials_to_half(shares, after):
    """Return the logarithm, base 10, of the trials until a share is a half, interpolated; NaN if
    the last share is below a half."""
    if not shares[-1] >= HALF:
        return np.nan
    k = int((shares >= HALF).argmax())
    part = slice(k - 1, k + 1)
    return np.interp(HALF, shares[part], np.log10(after[part])) if k else 0.0
