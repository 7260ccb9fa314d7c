"""Evidence on six models in the trials of a subject: residuals, hands, and their likelihood.

Rewards and postures determine the learner's tables Q and q*, hence the hand of highest value: a
hand has probability ε P(hand is explored) + (1 − ε) [hand has the highest value]. The mean target
t + κ N(t) (p − t) lands in a posture L(κ), which the package's kernel finds: a movement ends early,
where the goal is hit. The residual y − L(κ) of a recorded posture y counts in the null space of the
hand, where noise of the target is scaled by the share s of the movement that was made, and a
correction adds none. With motor noise of SD τ in what is recorded, a residual has the noise of the
postures in it (the hit, the stored posture, the start, the next stored posture) with weights B:
residuals are N(0, σ² s² + τ² B Bᵀ).
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import linalg, sparse

from coartic import CONDITIONS, execute
from coartic.baselines.posture_based import TwoGoals
from coartic.method import run_method
from coartic.motion.trial import reach_goals
from coartic.robot import HANDS

DRIFTS = (0.0, 0.03, 0.1, 0.3, 1.0)
"""Values of κ for drawn drift: each trial draws one."""
NODES = (*DRIFTS[:3], 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0)
"""Values of κ at which landings are simulated; between them residuals are interpolated."""
SHORT = 0.1
"""Way, length unit and rad, below which a movement does not show what it aimed at."""
ELSEWHERE = 0.02
"""Probability of a hit that the landing of the mean target does not predict, as
noise can make a movement cross the goal at once or not; the residual then has an SD of 1."""


def condition_for(task):
    """Return the paper's condition that explores most: EC1 with one hand, EC4 with two."""
    return CONDITIONS["EC1" if len(task.hands) == 1 else "EC4"]


def explored_by(task, condition):
    """Return the joints that the condition explores, bool, shape ``(2, dof)``, by chosen hand."""
    masks = np.zeros((2, task.robot.dof), bool)
    masks[:, :2] = condition.modify_chosen & np.array([k not in task.locked_base for k in "xy"])
    for chosen, hand in enumerate(HANDS):
        masks[chosen, task.robot.joints(hand)] = condition.modify_chosen
        masks[chosen, task.robot.joints(HANDS[1 - chosen])] = condition.modify_other
    return masks


def plan_for(task):
    """Return hands and postures at the goals of a planner, which sees the current goal and the
    next."""
    done = execute(task, run_method(TwoGoals(), task)[0].solution)
    return np.array(["LR".index(letter) for letter in done.hands]), done.configurations


def projection(jacobian, explored):
    """Return the projection N = I − J⁺J over the explored joints, shape ``(..., dof, dof)``."""
    among = np.where(explored[..., None, :], jacobian, 0.0)
    gram = np.linalg.pinv(among @ among.mT, rcond=1e-12, hermitian=True)
    return np.eye(explored.shape[-1]) * explored[..., None, :] - among.mT @ gram @ among


# ---- What the tables say before each hit ----


class Trials(NamedTuple):
    """Trials of a subject, from the first to the last number; G goals."""

    hands: np.ndarray
    """Hands as places in HANDS, shape ``(T, G)``; -1 for a hit that is missing."""
    postures: np.ndarray
    """Shape ``(T, G, dof)``; NaN for a hit that is missing."""
    rewards: np.ndarray
    """Minus the ticks, shape ``(T,)``; NaN where a hit of the trial is missing."""


def trials_of(frame, task):
    """Return the trials of one subject from rows of :func:`hits.read_hits`."""
    shape = int(frame.trial.max()), len(task.goals)
    hands, ticks = np.full(shape, -1), np.full(shape, np.nan)
    postures = np.full((*shape, task.robot.dof), np.nan)
    at = frame.trial.to_numpy(int) - 1, frame.goal.to_numpy(int) - 1
    hands[at], ticks[at] = frame.hand.map(HANDS.index), frame.ticks
    postures[at] = frame[[*task.robot.joint_names]]
    return Trials(hands, postures, -ticks.sum(axis=1))


def tables_before(task, condition, trials, rule):
    """Return what the tables hold before each hit after the first complete trial, a frame.

    ``hand`` was used and ``greedy`` has the highest value; ``stored`` is the trial of the stored
    posture, -1 for none, and ``following`` of the stored posture of the next goal, for the
    ``follower``, the hand that is best there. A complete trial replaces an entry if it is better
    (``rule`` "best"), always ("walk"), or if the entry is empty ("memoryless").
    """
    goals = len(task.goals)
    allowed = [HANDS.index(hand) for hand in HANDS if hand in condition.hands]
    value, source, rows = np.full((goals, 3, 2), -np.inf), np.full((goals, 3, 2), -1), []
    for trial, hands in enumerate(trials.hands.tolist()):
        states = [*zip(range(goals), [2, *hands], hands, strict=False)]
        for goal, before, hand in states if source.max() >= 0 else []:
            if min(before, hand) >= 0:
                greedy = max(allowed, key=lambda each, at=(goal, before): value[at][each])
                after = (min(goal + 1, goals - 1), hand)
                follower = max(allowed, key=lambda each, at=after: value[at][each])
                following = source[after][follower] if goal + 1 < goals else -1
                stored = source[goal, before, hand]
                rows.append((trial, goal, hand, greedy, stored, follower, following))
        for entry in states if np.isfinite(trials.rewards[trial]) else []:
            is_empty, is_better = source[entry] < 0, trials.rewards[trial] > value[entry]
            if is_empty or (rule == "best" and is_better) or rule == "walk":
                value[entry], source[entry] = trials.rewards[trial], trial
    columns = ["trial", "goal", "hand", "greedy", "stored", "follower", "following"]
    return pd.DataFrame(rows, columns=columns)


def landings(task, condition, trials, rows, kappas, plan, simulated):
    """Return residuals at drifts ``(K, m, dof)``, their dimensions ``(m,)`` and the shares of the
    movements that were made ``(K, m)``, for hits whose tables are in ``rows``.

    ``simulated``: noise, drift and a number N, to simulate these hits N times in place of the
    recorded ones, for residuals of shape ``(N, K, m, dof)``; None for the recorded ones.
    """
    robot, explored = task.robot, explored_by(task, condition)
    trial, goal, hand = (rows[name].to_numpy() for name in ("trial", "goal", "hand"))
    y, q = trials.postures[trial, goal], starts(task, trials, rows)
    t = trials.postures[rows.stored, goal]
    if plan:
        t = np.where((plan[0][goal] == hand)[:, None], plan[1][goal], t)

    def null_space(at):
        """Return projections onto the null space of the hand, over the explored joints."""
        each = np.stack([robot.jacobian(at, name) for name in HANDS], axis=1)
        return projection(each[np.arange(len(at)), hand], explored[hand])

    d = np.zeros_like(t)
    if len(kappas) > 1:
        following = rows.following.to_numpy()
        towards = (q + trials.postures[following, np.minimum(goal + 1, len(task.goals) - 1)]) / 2
        moves = explored[rows.follower] & (following >= 0)[:, None]
        d = (null_space(t) @ (np.where(moves, towards, q) - t)[..., None])[..., 0]

    def land(target):
        return reach_goals(robot, q, hand, task.goal_array[goal], task.radius, target,
                           locked_base=task.locked_base)  # fmt: skip

    nearest = t if condition.modify_other else np.where(explored[hand], t, q)
    if simulated:
        sigma, kappa, count = simulated
        noise = np.random.default_rng(0).standard_normal((count, *t.shape))
        y = np.array(
            [land(nearest + kappa * d + sigma * explored[hand] * each).q for each in noise]
        )
    each = []
    for kappa in kappas:
        mean = nearest + kappa * d
        landed, way = land(mean), mean - q
        share = ((landed.q - q) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
        share = np.where(landed.corrections > 0, 1.0, np.clip(share, 0.05, 1.0))
        free = null_space(landed.q)
        each.append(((free @ (y - landed.q)[..., None])[..., 0], share))
    residuals, shares = map(np.array, zip(*each, strict=True))
    if simulated:
        residuals = np.moveaxis(residuals, 1, 0)
    return residuals, np.trace(free, axis1=1, axis2=2).round(), shares


def starts(task, trials, rows):
    """Return the postures in which the movements of ``rows`` began, shape ``(m, dof)``."""
    before = trials.postures[rows.trial, np.maximum(rows.goal - 1, 0)]
    return np.where(rows.goal.to_numpy()[:, None] > 0, before, task.q0)


# ---- Likelihood ----


class Evidence(NamedTuple):
    """Evidence on a model in the trials of a subject: m postures and n choices of a hand."""

    nodes: np.ndarray
    """Residuals at each of :data:`NODES`, or for κ = 0 alone, shape ``(K, m, dof)``."""
    sizes: np.ndarray
    """Dimensions of a residual, shape ``(m,)``."""
    shares: np.ndarray
    """Shares of the movements that were made, shape ``(K, m)``."""
    records: np.ndarray
    """Places in the data of hit, stored posture, start and next stored posture, ``(4, m)``; -1 for
    a posture without noise."""
    trial: np.ndarray
    """Numbers of the trials, shape ``(m,)``."""
    follows: np.ndarray
    """True where a choice is of the hand of highest value, shape ``(n,)``."""
    explored: np.ndarray
    """Probability of the chosen hand in exploration, shape ``(n,)``."""

    def at(self, kappa):
        """Return residuals and shares at a drift."""
        if len(self.nodes) == 1:
            return self.nodes[0], self.shares[0]
        k = int(np.clip(np.searchsorted(NODES, kappa), 1, len(NODES) - 1))
        w = (kappa - NODES[k - 1]) / (NODES[k] - NODES[k - 1])
        share = self.shares[k - 1] + np.clip(w, 0, 1) * (self.shares[k] - self.shares[k - 1])
        return (1 - w) * self.nodes[k - 1] + w * self.nodes[k], share

    def rough_sigma(self, kappa):
        """Return an SD of exploration from the median of the residuals, without motor noise."""
        residual, share = self.at(kappa)
        return np.sqrt(np.median((residual**2).sum(axis=1) / share**2 / self.sizes)) + 1e-6

    def weights(self, kappa):
        """Return the weights B of postures in residuals, sparse, shape ``(m, postures)``."""
        share, there = self.at(kappa)[1], self.records >= 0
        start = np.where(there[3], kappa / 2, kappa)  # without a next posture, p is the start
        each = np.stack([np.ones_like(share), share * (kappa - 1), share * (1 - start) - 1,
                         -share * kappa / 2])  # fmt: skip
        row = np.broadcast_to(np.arange(len(share)), there.shape)
        shape = len(share), int(self.records.max()) + 1
        return sparse.csr_array((each[there], (row[there], self.records[there])), shape)

    def covariance(self, sigma, kappa, noise, residual):
        """Return the covariance of residuals, or its diagonal if they are independent, and the
        logarithm of the probability that some hits landed elsewhere and the others did not."""
        variance = (sigma * self.at(kappa)[1]) ** 2
        b = self.weights(kappa) if noise else None
        total = variance + (noise**2 * b.power(2).sum(axis=1) if noise else 0.0)
        square = (residual**2).sum(axis=1)
        here = np.log(1 - ELSEWHERE) - (self.sizes * np.log(total) + square / total) / 2
        elsewhere = here < np.log(ELSEWHERE) - square / 2
        variance = np.where(elsewhere, 1.0, variance)
        prior = np.log(np.where(elsewhere, ELSEWHERE, 1 - ELSEWHERE)).sum()
        return (noise**2 * (b @ b.T).toarray() + np.diag(variance) if noise else variance), prior

    def log_likelihood(self, sigma, kappa, noise):
        """Return the logarithm of the likelihood of the postures."""
        residual, _ = self.at(kappa)
        covariance, prior = self.covariance(sigma, kappa, noise, residual)
        if noise:
            root = linalg.cholesky(covariance, lower=True)
            z, scale = linalg.solve_triangular(root, residual, lower=True), root.diagonal()
        else:
            scale = np.sqrt(covariance)
            z = residual / scale[:, None]
        return prior - (z**2).sum() / 2 - self.sizes @ np.log(np.sqrt(2 * np.pi) * scale)

    def hands(self, epsilon):
        """Return the logarithm of the likelihood of the choices of hands."""
        chance = epsilon * self.explored + (1 - epsilon) * self.follows
        return np.log(np.maximum(chance, 1e-9)).sum()

    def drawn(self, sigma, noise):
        """Return the logarithm of the likelihood if each trial draws its drift; with motor noise a
        lower bound of it (mean field: trials are independent given the data)."""
        values = np.array([self.at(kappa)[0] for kappa in DRIFTS])
        number = np.unique(self.trial, return_inverse=True)[1]
        weight = np.full((len(DRIFTS), number.max() + 1), 1 / len(DRIFTS))
        least = (values**2).sum(axis=2).argmin(axis=0)
        nearest = values[least, np.arange(len(least))]
        covariance, prior = self.covariance(sigma, float(np.mean(DRIFTS)), noise, nearest)
        precision = linalg.inv(covariance) if noise else 1 / covariance
        diagonal = precision.diagonal() if noise else precision
        log_root = np.linalg.slogdet(covariance)[1] / 2 if noise else 0.0
        for _ in range(20 if noise else 1):
            mean = np.einsum("km,kmj->mj", weight[:, number], values)
            others = precision @ mean - diagonal[:, None] * mean if noise else 0 * mean
            cost = diagonal * (values**2).sum(axis=2) / 2 + (values * others).sum(axis=2)
            logs = [-np.bincount(number, each) - np.log(len(DRIFTS)) for each in cost]
            total = np.logaddexp.reduce(logs)
            weight = np.exp(logs - total)
        half = self.sizes.mean() * log_root if noise else self.sizes @ np.log(covariance) / 2
        return (prior + total.sum() + (mean * others).sum() / 2 - half
                - self.sizes.sum() * np.log(2 * np.pi) / 2)  # fmt: skip


def evidence_in(task, condition, trials, rule, plan=None, simulated=None):
    """Return the evidence on models with a rule of :func:`tables_before` in the trials of a
    subject; ``plan`` replaces tables where it has the hand."""
    rows = tables_before(task, condition, trials, rule)
    q = starts(task, trials, rows)
    follows = (rows.hand == (plan[0][rows.goal] if plan else rows.greedy)).to_numpy()
    explored = np.full(len(rows), 1 / len(condition.hands))
    if condition.hand_exploration == "closest":
        places = np.stack([task.robot.forward_kinematics(q, hand) for hand in HANDS])
        far = np.linalg.norm(places - task.goal_array[rows.goal], axis=2)
        explored = (far.argmin(axis=0) == rows.hand).to_numpy(float)
    way = np.linalg.norm(trials.postures[rows.trial, rows.goal] - q, axis=1)
    rows = rows[(rows.stored >= 0) & (way > SHORT)]
    kappas = NODES if rule == "best" else NODES[:1]
    nodes, sizes, shares = landings(task, condition, trials, rows, kappas, plan, simulated)
    trial, goal, following = (rows[name].to_numpy() for name in ("trial", "goal", "following"))
    stored, count = rows.stored.to_numpy(), len(task.goals)
    if plan:
        stored = np.where(plan[0][goal] == rows.hand, -1, stored)
    posture = trial * count + goal
    records = [posture, np.where(stored >= 0, stored * count + goal, -1),
               np.where(goal > 0, posture - 1, -1),
               np.where(following >= 0, following * count + goal + 1, -1)]  # fmt: skip
    return Evidence(nodes, sizes, shares, np.array(records), trial, follows, explored)
