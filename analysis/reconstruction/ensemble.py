"""Members of an ensemble: admissible coordinates, spread over the region they lie in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coartic.analysis.reconstruction.constraints import Tried

Array = NDArray[np.float64]


def features(tried: Tried, hands: tuple[str, ...]) -> Array:
    """What members are told apart by, ``(N, F)``, each of unit variance.

    The reward of every hand sequence by the corrective process alone, and the postures in
    which some ``hands`` hit the goals; both groups weigh the same.
    """
    rewards = _standard(np.nan_to_num(tried.trials.rewards, nan=-2e3))
    chosen = [tried.sequences.index(name) for name in hands]
    postures = tried.trials.reached[:, chosen].reshape(len(rewards), -1)
    return np.hstack([_standard(values) for values in (rewards, postures)])


def _standard(values: Array) -> Array:
    spread = values.std(axis=0)
    varying = spread > 1e-9
    scaled = (values - values.mean(axis=0))[:, varying] / spread[varying]
    return np.asarray(scaled / np.sqrt(max(scaled.shape[1], 1)))


def spread_out(points: Array, count: int, first: int | None = None) -> NDArray[np.int64]:
    """Indices of ``count`` points, each as far as possible from those before it.

    They begin with ``first``, or with the one nearest to the mean; then greedily the farthest
    (Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5), so that the first k are spread for every k.
    """
    if first is None:
        first = int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))
    chosen, gap = [first], np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        gap = np.minimum(gap, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(gap)))
    return np.array(chosen, dtype=np.int64)
