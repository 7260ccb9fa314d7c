"""The claims register: what the paper says of its model, each statement with its verdict."""

from analysis.claims.catalogue import CLAIMS, judge, register_table
from analysis.claims.data import MissingError
from analysis.claims.register import Claim, Finding, Judged

__all__ = [
    "CLAIMS",
    "Claim",
    "Finding",
    "Judged",
    "MissingError",
    "judge",
    "register_table",
]
