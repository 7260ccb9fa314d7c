"""Hill climbing that keeps the targets of its best trial, not the postures in which it hit.

This is a method file, which protocols.py uses. Everything else is as in ``hill-climbing``.
"""

import numpy as np

from coartic.baselines.hill_climbing import HillClimbing
from coartic.method import Result, Session


class HitsAtTargets:
    """A session that says of each trial that it hit the goals at its targets.

    At a goal without a target, where only the corrective process acts, the posture in which the
    trial hit stays.
    """

    def __init__(self, session: Session) -> None:
        self._session = session

    def __getattr__(self, name):
        return getattr(self._session, name)

    def trials(self, hands, targets, **options):
        """Make trials, and return them with their targets as postures at the goals."""
        made = self._session.trials(hands, targets, **options)
        asked = targets[: len(made.reached)]
        return made._replace(reached=np.where(np.isnan(asked), made.reached, asked))


class KeepsTargets(HillClimbing):
    """Hill climbing round the targets of the best trial so far."""

    name = "hill-climbing/targets"
    title = "hill climbing that keeps targets"

    def solve(self, session: Session) -> Result:
        """Climb as ``hill-climbing`` does, but move the centre to the best trial's targets."""
        return super().solve(HitsAtTargets(session))


METHODS = (KeepsTargets,)
