"""Coarticulation of a robot with two arms: a benchmark for OptunaHub."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution

import coartic
import optunahub

JOINTS = "base_x", "base_y", *(f"{arm}_{n}" for arm in ("left", "right") for n in (1, 2, 3, 4))


class Problem(optunahub.benchmarks.BaseProblem):
    """Ticks that the robot takes to hit the goals of a task in their order.

    Each goal has a category, the hand that hits it, and a float for each joint: by how much the
    posture to move to differs from the one in which the corrective process hits the goal with
    these hands.
    """

    def __init__(self, task: str = "two-armed-2", half_width: float = 1.0) -> None:
        self.task = coartic.load_task(task)
        self._cost = cache(lambda hands: coartic.objective(self.task, hands))
        self._goals = range(1, len(self.task.goals) + 1)
        hands = [hand[0].upper() for hand in sorted(self.task.hands)]
        self._space: dict[str, BaseDistribution] = {}
        for goal in self._goals:
            self._space[f"hand_{goal}"] = CategoricalDistribution(hands)
            for joint in JOINTS:
                self._space[f"{joint}_{goal}"] = FloatDistribution(-half_width, half_width)

    @property
    def best_known(self) -> int | None:
        """Fewest ticks known of the task; None where none are."""
        return coartic.objective(self.task).best_known

    @property
    def search_space(self) -> dict[str, BaseDistribution]:
        """For each goal a category and ten floats."""
        return dict(self._space)

    @property
    def directions(self) -> list[optuna.study.StudyDirection]:
        """Ticks are to be few."""
        return [optuna.study.StudyDirection.MINIMIZE]

    def evaluate(self, params: dict[str, Any]) -> float:
        """Ticks with these hands and postures."""
        cost = self._cost("".join(params[f"hand_{goal}"] for goal in self._goals))
        shift = np.array([[params[f"{joint}_{goal}"] for joint in JOINTS] for goal in self._goals])
        return float(cost(cost.x0 + shift[cost.joints]))
