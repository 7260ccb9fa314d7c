"""Tasks and families of tasks as environments of Gymnasium.

In each step of an environment (:class:`TaskEnv`) the robot reaches for one goal; the reward is
minus the number of control ticks that this takes. Importing this module registers the ids of
:data:`IDS`: one for each shipped task, such as ``coartic/Ascending-v2``, and ``coartic/Task-v2``
for any task or family.

- ``gymnasium.make`` makes an environment, and ``gymnasium.make_vec`` makes a vector environment.
- :func:`sb3` makes environments for Stable-Baselines3.
- :func:`score` compares policies with each other, with random actions and with the best known
  solutions.

The module needs the extra ``coartic[gym]``.
"""

from __future__ import annotations

from typing import Any

from coartic.errors import MissingExtraError
from coartic.tasks.catalogue import builtin_tasks

try:
    import gymnasium
except ImportError:
    raise MissingExtraError("coartic.gym needs Gymnasium: pip install 'coartic[gym]'") from None

from coartic.gym.environments import REACH, TaskEnv
from coartic.gym.scores import JUDGED, Policy, score
from coartic.gym.stable_baselines import SharesOfTicks, sb3

__all__ = ["IDS", "JUDGED", "REACH", "Policy", "SharesOfTicks", "TaskEnv", "sb3", "score"]

IDS: dict[str, dict[str, Any]] = {
    f"coartic/{name.title().replace('-', '')}-v2": {"task": name} for name in builtin_tasks()
} | {"coartic/Task-v2": {}}
"""Dict that maps ids, such as ``coartic/Ascending-v2``, to options of :class:`TaskEnv`."""

for _id, _options in IDS.items():
    if _id not in gymnasium.registry:
        gymnasium.register(_id, entry_point="coartic.gym:TaskEnv", kwargs=_options)
