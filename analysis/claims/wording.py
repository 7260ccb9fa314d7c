"""Numbers in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping

from analysis.statistics import Inference


def interval(found: Inference, digits: int = 1) -> str:
    """Estimate and interval; a sample without spread is said to be one."""
    text = f"{found.estimate:.{digits}f}"
    if math.isnan(found.low):
        return text
    if found.low == found.high:
        return f"{text} (no spread in {' and '.join(map(str, found.n))} runs)"
    return f"{text} [{found.low:.{digits}f}, {found.high:.{digits}f}]"


def counts(found: Mapping[str, int]) -> str:
    """Hand sequences, the commonest first."""
    ordered = sorted(found.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{hands} {count}" for hands, count in ordered)
