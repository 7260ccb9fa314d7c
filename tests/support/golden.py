"""The golden page: whole sentences of reports on planted studies, by their names.

A sentence that is worded anew is changed there, and nowhere else in the tests.
"""

import re
from functools import cache
from pathlib import Path

PAGE = Path(__file__).parents[1] / "golden.md"


@cache
def sentences():
    parts = re.split(r"^## (.*)\n", PAGE.read_text("utf-8"), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], (text.strip("\n") for text in parts[1::2]), strict=True))


def golden(name):
    return sentences()[name]
