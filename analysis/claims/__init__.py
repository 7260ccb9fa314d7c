"""The claims register: what the paper says of its model, each statement with its verdict."""

from analysis.claims.catalogue import CLAIMS, judge, register_table
from analysis.claims.data import CELLS, Data, MissingError
from analysis.claims.register import Claim, Finding, Judged, Verdict

__all__ = [
    "CELLS",
    "CLAIMS",
    "Claim",
    "Data",
    "Finding",
    "Judged",
    "MissingError",
    "Verdict",
    "judge",
    "register_table",
]
