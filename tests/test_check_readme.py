"""The table of README beside a folder: what differs is named."""

import check_readme
import pandas as pd
import pytest

TEXT = """
| method | information | gap | noise | share |
| --- | --- | ---: | ---: | ---: |
| CMA-ES: an optimiser | each trial | 1.0 % [0.8, 1.4] | 15.7 % [13.8, 18.1] | 94 % [92, 96] |
| **learner** of the paper | each trial's total | **7.9 %** [7.7, 8.1] | 9.7 % | 49 % [47, 50] |
| corrective process | none | 21.9 % | 22.8 % | −44.1 % |
"""
NAN = float("nan")
RANKING = pd.DataFrame(
    [
        [0.0100, 0.0076, 0.0138, 0.1574, 0.1377, 0.1808, 0.9447, 0.9249, 0.9576],
        [0.0787, 0.0766, 0.0807, 0.0965, NAN, NAN, 0.4853, 0.4727, 0.4974],
        [0.2186, NAN, NAN, 0.2277, NAN, NAN, -0.4414, NAN, NAN],
    ],
    ["CMA-ES", "learner (EC1, EC4)", "corrective process"],
    [f"{name}{end}" for name in check_readme.COLUMNS for end in ("", "_low", "_high")],
)


def test_equal_numbers_are_equal():
    assert check_readme.differences(TEXT, RANKING) == (3, [])
    assert len(check_readme.rows_of(check_readme.README.read_text("utf-8"))) == 13


@pytest.mark.parametrize(
    ("row", "column", "value"),
    [
        ("CMA-ES", "gap_high", 0.0146),
        ("learner (EC1, EC4)", "gap_low", NAN),
        ("CMA-ES", "gap_in_noise_high", NAN),
        ("corrective process", "share", 0.4414),
    ],
)
def test_each_number_counts(row, column, value):
    changed = RANKING.copy()
    changed.loc[row, column] = value
    count, (line,) = check_readme.differences(TEXT, changed)
    assert count == 3
    assert line.startswith(f"{row.partition(' (')[0]}: gap ")


def test_rows_with_a_setting_have_their_own_rows():
    """The row of the method without a setting comes first, wherever it stands in the ranking."""
    other = RANKING.loc[["CMA-ES"]].set_axis(["CMA-ES (hands given)"]) / 2.0
    assert check_readme.differences(TEXT, pd.concat([other, RANKING])) == (3, [])
    cells = "each trial | 0.5 % [0.4, 0.7] | 7.9 % [6.9, 9.0] | 47 % [46, 48]"
    row = f"| CMA-ES (hands given) | {cells} |"
    assert check_readme.differences(TEXT + row, pd.concat([other, RANKING])) == (4, [])


def test_a_row_that_the_folder_lacks_is_named():
    assert check_readme.differences(TEXT, RANKING[1:])[1] == ["CMA-ES: not in this folder"]
