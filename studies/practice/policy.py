"""A policy that has practised on random tasks, each met once.

An agent sees the next goal and ``ahead`` goals beyond it. The corrective process **A** finds in its
head a posture that hits the goal; the policy, a small network, changes it; **A** finishes the
change, and the arm moves there. An agent that has not practised is the corrective process. As the
robot is the same wherever it stands and in a mirror, the policy sees all from the arm.

It practises on tasks of the family beside this file that no instance names, one trial each, with
noise on its changes, and uses the ticks of each subtask. After each batch it becomes likelier to
make the changes that were better than expected (proximal policy optimisation: Schulman et al. 2017;
advantages: Schulman et al. 2016). What expects sees no more, but for the number of the goal. The
policy is then applied to a task that it has not met, without noise, once.

Practice takes half a minute and is kept in the user's cache; of several processes that need it one
practises. It is the same bit for bit for any number of threads, but not on every processor.

Settings were found on tasks drawn for development: 40 runs of 100,000 or 200,000 trials with none
to two goals ahead, nine of 600,000 with none to four. SD of the noise at first 0.1 to 0.8, at last
0.05 or 0.1; λ 0 to 0.9; γ 0.9 or 1; batches of 256 to 2048 trials, parts of 512 to 4096 subtasks;
step sizes 0.001 to 0.004; 2 to 8 epochs; clips 0.2 or 0.4; 32, 64 or 128 units; changes that grow
with the distance to go, its root, or not. A baseline that knows the number of the goal, the mirror
and changes that grow gained most; the last settings differed by half a per cent, and the second
half of 600,000 trials gained one. Deterministic policy gradients diverged. The family was chosen
with them: in a wider region, where most of a trial is driving, the first ones gained 3 %.
"""

import hashlib
import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from coartic import MethodError, Robot, movements_of
from coartic.method import Information, Method, Parameters, Result
from coartic.motion.trial import Reached, reach_goals
from coartic.tasks.families import read_family

FAMILY = Path(__file__).with_name("eight.v1.toml")
COURSE = 327_680
"""Trials over which noise and step size fall."""
KEPT_AFTER = (20_480, 81_920, COURSE)
"""Numbers of trials after which a policy is kept in passing."""
BATCH, PART, EPOCHS, UNITS = 512, 1024, 4, 64
NOISE, STEP, STEP_OF_CRITIC, LAST_STEP = (0.6, 0.1), 2e-3, 3e-3, 0.05
DISCOUNT, TRACE, CLIP = 0.9, 0.5, 0.2
IMAGINED = 400
"""Iterations of **A** at most in the head: else the change is dropped."""
BLOCK = 32
"""Rows of a product at most, so few that BLAS takes one thread: more would round otherwise."""
CODE = hashlib.sha256(Path(__file__).read_bytes() + FAMILY.read_bytes()).hexdigest()[:16]
"""Version of both files, by which policies are kept."""

KEPT = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "coartic-practice"

RIGHT, BASE = 1, 2
"""Index of the right hand, and number of the base's coordinates, before the joints."""
ROBOT = Robot()
ARM = ROBOT.joints("right")
BENDS = slice(ARM.start + 1, ARM.stop)


class PracticeParameters(Parameters):
    """Parameters of an agent: how many goals it sees, how much it has practised, and its number."""

    ahead: Annotated[int, Field(ge=0, le=7)] = 1
    """Goals in view beyond the one to be hit."""
    practice: Annotated[int, Field(ge=0, le=COURSE)] = COURSE
    """Trials of practice, each on another task."""
    agent: Annotated[int, Field(ge=0)] = 0
    """Seed of its practice."""


class Practised(Method):
    """Make one trial by a policy that has practised on other tasks."""

    name = "practice/policy"
    title = "Policy practised on other tasks"
    citation = (
        "J. Schulman, F. Wolski, P. Dhariwal, A. Radford, O. Klimov (2017). Proximal policy "
        "optimization algorithms. arXiv:1707.06347; J. Schulman, P. Moritz, S. Levine, M. I. "
        "Jordan, P. Abbeel (2016). High-dimensional continuous control using generalized advantage "
        "estimation. ICLR."
    )
    information = frozenset(
        map(Information, ("goals", "corrective process", "reward by trial", "reward by subtask"))
    )
    stochastic = False
    Parameters = PracticeParameters
    files = (FAMILY.name,)
    quick = {"practice": BATCH}  # noqa: RUF012

    def why_not(self, task):
        """The reason why the policy knows no such robot, if it does not."""
        if task.hands == ("right",) and task.dof == ROBOT.dof:
            return None
        return f"task {task.name!r} is not for the right hand alone on an arm of four links"

    def solve(self, session):
        """Practise, or recall what was practised; then make the trial."""
        given = self.parameters
        if session.locked_base:
            raise MethodError("infeasible", "it has practised with its base free")
        with session.building():
            policy = recall(given.ahead, given.agent, given.practice, session.model)
        start, goals = session.q0[None], session.goals[None]
        with session.solving():
            subtasks = list(trial(policy, start, goals, given.ahead, session.radius, session.model))
            targets, hands = (
                np.array([subtask.target[0] for subtask in subtasks]),
                "R" * len(subtasks),
            )
            session.trials(hands, targets[None])
        in_head = [reached for subtask in subtasks for reached in subtask.reached[:2]]
        session.spend(
            jacobians=sum(int(reached.iterations[0]) for reached in in_head),
            forward_kinematics=sum(int(reached.evaluations[0]) for reached in in_head),
        )
        practised = given.practice // BATCH * BATCH
        details = {"practice_trials": practised, "practice_family": read_family(FAMILY).name}
        return Result(movements_of(hands, targets), details)


class Subtask(NamedTuple):
    """Observations and actions of N arms at a goal."""

    seen: np.ndarray
    """Observations, shape ``(N, O)``."""
    mean: np.ndarray
    """Mean action of the policy, shape ``(N, 6)``; with noise added it is ``action``."""
    action: np.ndarray
    target: np.ndarray
    """Configurations to which the arms moved, shape ``(N, dof)``."""
    reached: tuple[Reached, ...]
    """Outcomes of both imagined postures, and of the movement."""


def trial(policy, q, goals, ahead, radius, model, noise=None):
    """Yield the subtasks of N trials from ``q``, shape ``(N, dof)``, through goals ``(N, G, 2)``.

    ``noise``: its SD and a generator.
    """
    in_head = model._replace(max_iterations=IMAGINED)
    for number in range(goals.shape[1]):
        goal = goals[:, number]
        found = reach(q, goal, radius, in_head)
        posture = np.where(found.corrections[:, None] > 0, found.corrected, q)
        seen = observe(q, posture, goals[:, number : number + ahead + 1], ahead)
        mean = action = policy(seen)
        if noise is not None:
            action = mean + np.float32(noise[0]) * noise[1].standard_normal(mean.shape, np.float32)
        changed = change(posture, action * np.sqrt(np.linalg.norm(q - posture, axis=1))[:, None])
        ended = reach(changed, goal, radius, in_head)
        target = np.where(ended.corrections[:, None] > 0, ended.corrected, found.corrected)
        reached = reach(q, goal, radius, model, target)
        yield Subtask(seen, mean, action, target, (found, ended, reached))
        q = reached.q


def reach(q, goal, radius, model, target=None):
    """Let N arms reach for a goal each; without targets, what **A** finds in the head.

    Robots are moved so that they have one goal, for which the kernel is fast.
    """
    shift = np.pad(goal, ((0, 0), (0, q.shape[1] - BASE)))
    hands, there, checks = np.full(len(q), RIGHT), np.zeros((len(q), 2)), target is not None
    targets = None if target is None else target - shift
    reached = reach_goals(
        ROBOT, q - shift, hands, there, radius, targets, checks=checks, model=model
    )
    return reached._replace(q=reached.q + shift, corrected=reached.corrected + shift)


def directions(angles):
    """Unit vectors at angles (rad), shape ``(..., 2)``."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def from_arm(q):
    """Unit vectors along the upper arm and to the side to which it bends, shape ``(N, 2, 2)``, and
    1 where that is the left, else -1, ``(N, 1)``."""
    side = np.where(q[:, BENDS].sum(axis=1) < 0, -1.0, 1.0)[:, None]
    along = directions(q[:, ARM.start])
    return np.stack([along, side * along[:, ::-1] * [-1, 1]], axis=1), side


def seen_from(axes, vectors):
    """Vectors, shape ``(N, 2)``, along the axes of :func:`from_arm`."""
    return (axes * vectors[:, None]).sum(axis=2)


def observe(q, posture, goals, ahead):
    """Return the observations of agents at ``q``, shape ``(N, 22 + 3 * ahead)``, the same wherever
    they stand and in a mirror image.

    The shape of the ``posture`` that hits the next goal, the displacement to it, and the goals
    ahead as seen from the posture's upper arm, each with 1, or zeros where no goal is left.
    ``goals``, shape ``(N, W, 2)``, are the next one and those in view beyond it, as many as there
    are.
    """
    (axes, side), next_goal, displacement = from_arm(posture), goals[:, 0], q - posture
    bends = directions(side * posture[:, BENDS]).reshape(len(q), -1)
    shoulder = posture[:, :BASE] + ROBOT.right_shoulder - next_goal
    along = np.hstack([seen_from(axes, displacement[:, :BASE]), side * displacement[:, ARM]])
    length = np.linalg.norm(displacement, axis=1)[:, None]
    parts = [bends, seen_from(axes, shoulder) / 2, along, length]
    parts += [np.log(length + 0.05), along / (length + 0.05)]
    for n in range(1, ahead + 1):
        there = np.zeros((len(q), 3))
        if n < goals.shape[1]:
            there = np.hstack([seen_from(axes, goals[:, n] - next_goal) / 2, np.ones_like(length)])
        parts.append(there)
    return np.hstack(parts).astype(np.float32)


def change(posture, changes):
    """Postures changed in base and joints, shape ``(N, 6)``, as seen from the arm."""
    (axes, side), changed = from_arm(posture), posture.copy()
    changed[:, :BASE] += (axes * changes[:, :BASE, None]).sum(axis=1)
    changed[:, ARM] += side * changes[:, BASE:]
    return changed


def draw_tasks(rng, count):
    """Tasks of the family from a generator: starts ``(count, dof)`` and goals ``(count, G, 2)``.

    They have the instances' distribution, but that none is left out because the corrective process
    would fail: with a free base it does not.
    """
    family = read_family(FAMILY)
    (low, high), number = np.array([family.region.x, family.region.y]).T, family.goals[0]
    start, rows = family.start[0].right, count + count // 2
    sides = (high - low) * rng.integers(*family.region.scale, (rows, 1), endpoint=True) // 1000
    corner = rng.integers(low, high - sides, endpoint=True)[:, None]
    goals = rng.integers(corner, corner + sides[:, None], (rows, number, 2), endpoint=True) / 1000
    q = np.zeros((rows, ROBOT.dof))
    q[:, ARM.start] = rng.integers(*start.first, rows, endpoint=True) / 1000
    q[:, BENDS] = rng.integers(*start.others, (rows, 3), endpoint=True) / 1000
    between = np.linalg.norm(goals[:, :, None] - goals[:, None], axis=-1) + 1000 * np.eye(number)
    away = np.linalg.norm(ROBOT.forward_kinematics(q, "right")[:, None] - goals, axis=-1)
    good = between.min(axis=(1, 2)) >= family.apart / 1000 - 1e-9
    good &= away.min(axis=1) > (family.radius + family.clear) / 1000
    good &= np.abs(q[:, BENDS]).max(axis=1) >= family.bent / 1000
    if good.sum() >= count:
        return q[good][:count], goals[good][:count]
    others = draw_tasks(rng, count - int(good.sum()))
    return np.vstack([q[good], others[0]]), np.vstack([goals[good], others[1]])


class Network:
    """Two layers of tanh and a linear one, and Adam (Kingma & Ba 2015)."""

    def __init__(self, weights):
        self.weights = weights
        self._moments = [(np.zeros_like(w), np.zeros_like(w)) for w in weights]
        self._steps = 0

    @classmethod
    def draw(cls, rng, inputs, outputs, last):
        """A network with random weights, those of the last layer smaller by a factor."""
        weights = []
        shapes = (inputs, UNITS), (UNITS, UNITS), (UNITS, outputs)
        for shape, scale in zip(shapes, (1, 1, last), strict=True):
            drawn = rng.standard_normal(shape) * scale / np.sqrt(shape[0])
            weights += [drawn.astype(np.float32), np.zeros(shape[1], dtype=np.float32)]
        return cls(weights)

    def __call__(self, inputs):
        """The outputs, shape ``(N, outputs)``, for inputs ``(N, inputs)``."""
        return self.layers(inputs)[-1]

    def layers(self, inputs):
        """The inputs and what each layer makes of them."""
        layers = [inputs]
        for matrix, bias in zip(self.weights[::2], self.weights[1::2], strict=True):
            sums = np.matmul(blocks(layers[-1]), matrix).reshape(len(inputs), -1) + bias
            layers.append(sums if matrix is self.weights[-2] else np.tanh(sums))
        return layers

    def descend(self, layers, slope, step):
        """A step against the gradient, given that of the outputs, shape ``(N, outputs)``."""
        slopes = []
        for k in (2, 1, 0):
            slope = slope * (1 - layers[k + 1] ** 2) if k < 2 else slope
            of_matrix = np.matmul(blocks(layers[k]).transpose(0, 2, 1), blocks(slope)).sum(axis=0)
            slopes[:0] = [of_matrix, slope.sum(axis=0)]
            slope = np.matmul(blocks(slope), self.weights[2 * k].T).reshape(len(slope), -1)
        self._steps += 1
        first, second = 1 - 0.9**self._steps, 1 - 0.999**self._steps
        for weight, (mean, square), given in zip(self.weights, self._moments, slopes, strict=True):
            mean += np.float32(0.1) * (given - mean)
            square += np.float32(0.001) * (given**2 - square)
            scaled = (mean / first) / (np.sqrt(square / second) + 1e-8)
            weight -= (step * scaled).astype(np.float32)


def blocks(rows):
    """Rows in blocks of :data:`BLOCK`, if they fill them."""
    return rows.reshape(-1, BLOCK if len(rows) % BLOCK == 0 else len(rows), rows.shape[1])


def practise(ahead, agent, trials, model):
    """Yield the policy of an agent, which goes on learning, after each of :data:`KEPT_AFTER` trials
    and after all, in whole batches."""
    rng, family = np.random.default_rng([agent, ahead]), read_family(FAMILY)
    goals, inputs = family.goals[0], 22 + 3 * ahead
    policy = Network.draw(rng, inputs, BASE + len(ROBOT.right_links), 0.01)
    critic = Network.draw(rng, inputs + goals, 1, 0.1)
    numbers = np.repeat(np.eye(goals, dtype=np.float32), BATCH, axis=0)
    for made in range(0, trials - BATCH + 1, BATCH):
        if made in KEPT_AFTER:
            yield made, policy
        sd = NOISE[0] * (NOISE[1] / NOISE[0]) ** (made / COURSE)
        slower = 1 - (1 - LAST_STEP) * made / COURSE
        tasks = draw_tasks(rng, BATCH)
        subtasks = list(trial(policy, *tasks, ahead, family.radius / 1000, model, (sd, rng)))
        seen, means, actions = (
            np.concatenate([subtask[field] for subtask in subtasks]) for field in range(3)
        )
        known = np.hstack([seen, numbers])
        expected = critic(known).reshape(goals, BATCH).astype(np.float64)
        advantages, following, after = np.zeros((goals, BATCH)), np.zeros(BATCH), np.zeros(BATCH)
        for g in reversed(range(goals)):
            surprise = DISCOUNT * following - expected[g] - subtasks[g].reached[-1].ticks / 100
            after = advantages[g] = surprise + DISCOUNT * TRACE * after
            following = expected[g]
        wanted = (advantages + expected).reshape(-1, 1).astype(np.float32)
        advantages -= advantages.mean(axis=1, keepdims=True)
        gains = (advantages / advantages.std()).ravel().astype(np.float32)
        for order in (rng.permutation(len(seen)) for _ in range(EPOCHS)):
            for rows in np.split(order, len(order) // PART):
                layers = policy.layers(seen[rows])
                slope = slope_of(layers[-1], means[rows], actions[rows], gains[rows], sd)
                policy.descend(layers, slope, STEP * slower)
                layers = critic.layers(known[rows])
                slope = (layers[-1] - wanted[rows]) / np.float32(PART)
                critic.descend(layers, slope, STEP_OF_CRITIC * slower)
    yield trials, policy


def slope_of(mean, before, action, gain, sd):
    """Gradient of minus the clipped objective by the policy's means, shape ``(N, 6)``."""
    square = np.float32(sd * sd)
    nearer = ((action - before) ** 2).sum(axis=1) - ((action - mean) ** 2).sum(axis=1)
    excess = np.expm1(np.clip(nearer / (2 * square), -20, 20))  # of the ratio of likelihoods over 1
    counts = np.where(gain > 0, excess <= CLIP, excess >= -CLIP)
    slope = -(gain * (1 + excess) * counts)[:, None] * (action - mean) / square
    return slope / np.float32(len(gain))


@cache
def recall(ahead, agent, practice, model):
    """The policy of an agent after its practice; it practises now unless it is stored."""

    def path(trials):
        what = f"{CODE} {np.__version__} {ahead} {agent} {trials} {tuple(model)}"
        return KEPT / f"{hashlib.sha256(what.encode()).hexdigest()[:24]}.npz"

    KEPT.mkdir(parents=True, exist_ok=True)
    with path(0).with_suffix(".lock").open("w") as lock:
        with suppress(ImportError):  # one process at a time, where there are locks
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX)
        if not path(practice).exists():
            for trials, policy in practise(ahead, agent, practice, model):
                beside = path(trials).with_suffix(f".{os.getpid()}.npz")
                np.savez(beside, *policy.weights)
                beside.replace(path(trials))
    with np.load(path(practice)) as kept:
        return Network([kept[name] for name in kept.files])
