"""Signs of coarticulation: the signatures that give one number for each run.

Claims compare them, and families of random tasks count them.
"""

from __future__ import annotations

from collections.abc import Mapping

from coartic.analysis.signatures.register import REGISTER, Signature

_BY_SIGN = {each.sign: each for each in REGISTER.values() if each.sign}
SIGNS: Mapping[str, Signature] = {
    name: _BY_SIGN[name] for name in ("hand", "arm", "other arm", "first", "whole")
}
"""Every sign by its name in claims, in the order of the tables."""
