"""Evidence on six models in the trials of a subject: residuals, hands, and their likelihood.

A hand has probability ε P(hand is explored) + (1 − ε) [hand has the highest value]. The residual
y − L(κ) of a recorded posture y from where the mean target lands (:mod:`models`) counts in the null
space of the hand, where noise of the target is scaled by the share s of the movement that was made,
and a correction adds none. With motor noise of SD τ in what is recorded, a residual has the noise
of the postures in it (the hit, the stored posture, the start, the next stored posture) with weights
B: residuals are N(0, σ² s² + τ² B Bᵀ).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from models import HANDS, landings, plan_for, starts, tables_before
from scipy import linalg, sparse

DRIFTS = (0.0, 0.03, 0.1, 0.3, 1.0)
"""Values of κ for drawn drift: each trial draws one."""
NODES = (*DRIFTS[:3], 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0)
"""Values of κ at which landings are simulated for a fit."""
SHORT = 0.1
"""Way, length unit and rad, below which a movement does not show what it aimed at."""
ELSEWHERE = 0.02
"""Probability of a hit that the landing of the mean target does not predict, as
noise can make a movement cross the goal at once or not; the residual then has an SD of 1."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence on a model in the trials of a subject: m postures and n choices of a hand."""

    kappas: tuple
    """K values of κ; between them residuals are interpolated."""
    nodes: np.ndarray
    """Residuals at each value of κ, shape ``(K, m, dof)``."""
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

    @lru_cache(maxsize=16)  # noqa: B019 - a search asks again and again at one value
    def at(self, kappa):
        """Return residuals ``(m, dof)`` and shares ``(m,)`` at a value of κ."""
        if len(self.nodes) == 1:
            return self.nodes[0], self.shares[0]
        k = int(np.clip(np.searchsorted(self.kappas, kappa), 1, len(self.kappas) - 1))
        w = (kappa - self.kappas[k - 1]) / (self.kappas[k] - self.kappas[k - 1])
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

    @lru_cache(maxsize=4)  # noqa: B019
    def shared(self, kappa):
        """Return B Bᵀ, the covariance of residuals in units of the motor noise, squared."""
        weights = self.weights(kappa)
        return (weights @ weights.T).toarray()

    def covariance(self, sigma, kappa, noise, residual):
        """Return the covariance of residuals, or its diagonal if they are independent, and where
        hits landed elsewhere."""
        variance = (sigma * self.at(kappa)[1]) ** 2
        shared = self.shared(kappa) if noise else None
        total = variance + (noise**2 * shared.diagonal() if noise else 0.0)
        square = (residual**2).sum(axis=1)
        here = np.log(1 - ELSEWHERE) - (self.sizes * np.log(total) + square / total) / 2
        elsewhere = here < np.log(ELSEWHERE) - square / 2
        variance = np.where(elsewhere, 1.0, variance)
        full = noise**2 * shared + np.diag(variance) if noise else variance
        return full, elsewhere

    def log_likelihood(self, sigma, kappa, noise):
        """Return the logarithm of the likelihood of the postures."""
        residual = self.at(kappa)[0]
        covariance, elsewhere = self.covariance(sigma, kappa, noise, residual)
        if noise:
            root = linalg.cholesky(covariance, lower=True)
            z, scale = linalg.solve_triangular(root, residual, lower=True), root.diagonal()
        else:
            scale = np.sqrt(covariance)
            z = residual / scale[:, None]
        logs = (z**2).sum() / 2 + self.sizes @ np.log(np.sqrt(2 * np.pi) * scale)
        return prior_of(elsewhere) - logs

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
        covariance, elsewhere = self.covariance(sigma, float(np.mean(DRIFTS)), noise, nearest)
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
        return (prior_of(elsewhere) + total.sum() + (mean * others).sum() / 2 - half
                - self.sizes.sum() * np.log(2 * np.pi) / 2)  # fmt: skip


def prior_of(elsewhere):
    """Return the logarithm of the probability that these hits landed elsewhere, the others not."""
    return np.log(np.where(elsewhere, ELSEWHERE, 1 - ELSEWHERE)).sum()


def evidence_in(task, condition, trials, model, simulated=None, kappas=None):
    """Return the evidence on a model in the trials of a subject, at drifts ``kappas``; the
    planner's plan replaces tables where it has the hand, ``simulated`` as of :func:`landings`."""
    rule = {"informed": "best", "drawn": "best", "planner": "memoryless"}.get(model, model)
    plan = plan_for(task) if model == "planner" else None
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
    kappas = kappas or (NODES if rule == "best" else NODES[:1])
    nodes, sizes, shares = landings(task, condition, trials, rows, kappas, plan, simulated)
    trial, goal, following = (rows[name].to_numpy() for name in ("trial", "goal", "following"))
    stored, count = rows.stored.to_numpy(), len(task.goals)
    if plan:
        stored = np.where(plan[0][goal] == rows.hand, -1, stored)
    posture = trial * count + goal
    records = [posture, np.where(stored >= 0, stored * count + goal, -1),
               np.where(goal > 0, posture - 1, -1),
               np.where(following >= 0, following * count + goal + 1, -1)]  # fmt: skip
    return Evidence(kappas, nodes, sizes, shares, np.array(records), trial, follows, explored)
