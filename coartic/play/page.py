"""The page of `coartic play`: one HTML file, which needs no other and no network."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent
MODEL = FOLDER / "model.js"
"""The model in JavaScript."""
