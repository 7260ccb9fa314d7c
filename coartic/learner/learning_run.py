"""The results of one run of the learner."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.errors import CoarticError
from coartic.internal.text import pluralize
from coartic.internal.validation import equal_contents
from coartic.learner.conditions import ExplorationCondition
from coartic.method import Meter
from coartic.model import MotionModel
from coartic.motion.execution import Execution, execute
from coartic.motion.solution import Movement, hands_in
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task


@dataclass(frozen=True, eq=False)
class LearningRun:
    """A run of the learner: its trials, its solution, and what it learned (:func:`learn`)."""

    task: Task
    """The task."""
    condition: ExplorationCondition
    """The exploration condition."""
    model: MotionModel
    """The constants of movement and of the corrective process."""
    seed: int
    """Seed of the run's random numbers."""
    first_hands: str
    """Hands of trial 0, such as ``"RRRR"``."""
    rewards: np.ma.MaskedArray[Any, np.dtype[np.int64]]
    """Total reward of each trial, shape ``(trials,)``: minus its control ticks; masked where the
    trial failed."""
    best_trial: int | None
    """First of the completed trials with the highest total reward, from 0; None if no trial was
    completed."""
    initial: tuple[Movement, ...]
    """Movements of trial 0; empty if it failed."""
    solution: tuple[Movement, ...]
    """Movements of the best trial; empty if no trial was completed."""
    replay: tuple[Movement, ...]
    """Movements of the replay, a greedy trial without exploration that is made with the final
    tables after all other trials; empty if it failed. Motor noise acts in the replay as well."""
    replay_reward: int | None
    """Total reward of the replay; None if it failed."""
    values: Array
    """Value table Q, shape ``(goals, 3, 2)``. The axes are goal, previous hand (left, right, none)
    and hand. A state is a pair of a goal and a previous hand. Q is the highest total reward of the
    completed trials that chose this hand in this state; with ``credit="subtask"`` it is the highest
    return of the goal in these trials. Q is -inf where nothing was learned."""
    targets: Array
    """Stored targets q*, shape ``(goals, 3, 2, dof)``, in length units (base) and rad (joints); NaN
    where Q is -inf. The first three axes are those of ``values``."""
    corrections: NDArray[np.int64]
    """Number of corrective movements in trial 0 and in each tenth of the later trials, shape
    ``(11,)``."""
    counters: Meter
    """Counts of the trials, ticks and evaluations of the run, without the replay."""
    wall_s: float = field(compare=False)
    """Wall time of the run (in s): the time of the runs that were made together, divided by their
    number."""
    __eq__ = equal_contents

    @property
    def completed(self) -> NDArray[np.bool_]:
        """True for the trials that hit every goal, shape ``(trials,)``.

        All other trials failed, and changed neither ``values`` nor ``targets``.
        """
        return ~np.ma.getmaskarray(self.rewards)

    @property
    def learned(self) -> tuple[Movement, ...]:
        """Movements of the learned solution; empty if there is none.

        - Without motor noise, the learned solution is the best trial, or the replay if the
          condition has ``learned="replay"``. It is empty if this trial did not hit every goal.
        - With motor noise, the reward of the best trial is partly luck. So the learned solution is
          :attr:`next_action`, which was not executed. It is empty only if no trial was completed.
        """
        if self.model.motor_noise > 0.0:
            return self.next_action
        if self.condition.learned == "best":
            return self.solution
        return self.replay

    @property
    def next_action(self) -> tuple[Movement, ...]:
        """Movements that the learner would choose in a next trial without exploration.

        Corrective movements after a miss are not included.

        The state at a goal is the pair of this goal and the hand for the previous goal.

        - *Hand.* The hand for a goal is the one with the highest Q in the state; at a tie the left
          hand.
        - *Target.* The target is the stored target q* of this hand. If none is stored, the movement
          is corrective and has no target. If the condition does not move the idle arm, the entries
          of this arm in the target are NaN.
        - *Ticks.* The movements have no ticks, because they were not executed.

        The tuple is empty if no trial was completed.
        """
        if self.best_trial is None:
            return ()
        movements, robot, previous = list[Movement](), self.task.robot, len(HANDS)
        codes = sorted(map(HANDS.index, self.condition.hands))
        for goal, (values, targets) in enumerate(zip(self.values, self.targets, strict=True), 1):
            code = max(codes, key=values[previous].__getitem__)  # at a tie the left hand
            hand, target = HANDS[code], targets[previous, code].copy()
            if values[previous, code] == -math.inf:
                movements.append(Movement(goal, hand, "corrective"))
            else:
                if not self.condition.modify_other:
                    target[robot.joints(HANDS[1 - code])] = math.nan
                movements.append(Movement(goal, hand, "learned", target))
            previous = code
        return tuple(movements)

    @property
    def reason(self) -> str:
        """Sentence on why the run has no learned solution; empty if it has one."""
        if self.learned:
            return ""
        if self.best_trial is not None:
            return "the replay of what was learned did not hit every goal"
        return (
            f"the corrective process failed in all {pluralize(self.counters.trials, 'trial')}; "
            "no trial hit every goal"
        )

    @property
    def reward(self) -> int | None:
        """Total reward of the best trial or of the replay; None without such a trial.

        It is the reward of the replay if the condition has ``learned="replay"``, and otherwise the
        highest reward of all trials. With motor noise, the reward of this single trial is partly
        luck: to judge :attr:`learned`, execute it by :func:`coartic.execute_noisy`.
        """
        if self.condition.learned == "replay":
            return self.replay_reward
        return None if self.best_trial is None else int(self.rewards[self.best_trial])

    @property
    def hands(self) -> str | None:
        """Hand sequence of the learned solution, such as ``"LRLR"``; None if there is none."""
        return hands_in(self.learned) if self.learned else None

    @property
    def initial_reward(self) -> int | None:
        """Total reward of trial 0; None if it failed."""
        return int(self.rewards[0]) if self.completed[0] else None

    def execute(self) -> Execution:
        """Execute the learned solution again, without the learner and without motor noise.

        If the model has no motor noise, the execution has the reward :attr:`reward`. Raises
        CoarticError if there is no learned solution.
        """
        if not self.learned:
            raise CoarticError(f"the run has no learned solution to execute: {self.reason}")
        return execute(self.task, self.learned, model=self.model.without_noise())
