"""Write the stored tables and figures of a study."""

from pathlib import Path
from unittest.mock import patch

from coartic.analysis.figures import picture, style


def stored_picture(draw, *arguments, **options):
    """Draw a figure in the font that comes with Matplotlib, and return it as SVG."""
    with patch.dict(style.RC, {"font.sans-serif": ["DejaVu Sans"]}):
        return picture(draw(*arguments, **options), ".svg")


def write_tables(folder, tables):
    """Write tables into a folder, each as a CSV file with its name."""
    for name, table in tables.items():
        path = Path(folder) / f"{name}.csv"
        table.to_csv(path, float_format="%.6g", lineterminator="\n")
