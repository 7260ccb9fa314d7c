"""Tasks and families as environments of Gymnasium: a step reaches for a goal, its reward is minus
the ticks.

Importing this module registers the ids :data:`IDS`, such as ``coartic/Ascending-v2``, and
``coartic/Task-v2`` for any other task or a family. The module needs the extra ``coartic[gym]``.
"""

import gymnasium

from coartic.gym.environment import ADDED, IDS, TaskEnv, sb3
from coartic.gym.scoring import column, compare, score
from coartic.gym.vector import REACH, TaskVectorEnv

__all__ = ["ADDED", "IDS", "REACH", "TaskEnv", "TaskVectorEnv", "column", "compare", "sb3", "score"]

for _name, _given in IDS.items():
    if _name not in gymnasium.registry:
        gymnasium.register(
            _name,
            entry_point="coartic.gym:TaskEnv",
            vector_entry_point="coartic.gym:TaskVectorEnv",
            kwargs=_given,
        )
