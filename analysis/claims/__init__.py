"""The claims register: what the paper says of its model, each statement with its verdict."""

from analysis.claims.catalogue import CLAIMS, judge
from analysis.claims.data import CELLS, Data, MissingError
from analysis.claims.page import claims_frame, claims_page
from analysis.claims.register import Claim, Finding, Judged, Verdict

__all__ = [
    "CELLS", "CLAIMS", "Claim", "Data", "Finding", "Judged", "MissingError", "Verdict",
    "claims_frame", "claims_page", "judge",
]  # fmt: skip
