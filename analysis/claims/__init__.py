"""The claims register: what the paper says of its model, each statement with its verdict."""

from coartic.analysis.claims.catalogue import CLAIMS, judge, register_table
from coartic.analysis.claims.data import MissingError
from coartic.analysis.claims.register import Claim, Finding, Judged

__all__ = [
    "CLAIMS",
    "Claim",
    "Finding",
    "Judged",
    "MissingError",
    "judge",
    "register_table",
]
