"""Numbers of a page, from the example report: `python docs/paper_numbers.py` renews them.

A number is followed by a comment that says what it is, which no reader sees:

    −302.9<!--macro AscendingECOneReward-->          a macro of numbers.tex
    99 %<!--cell across-tasks|cma-es/bandit|score|%--> a value of a table, by row and column
    7<!--claims printed supported-->                 claims by what they rest on and verdict
    47<!--claims-all-->                              all claims of the paper
    1878<!--runs-->                                  runs of the folder that it was made of
"""

import csv
import re
from pathlib import Path

DOCS = Path(__file__).parent
EXAMPLE = DOCS.parent / "benchmarks" / "example"
NUMBER = re.compile(r"([−\d][\d.,]*(?: %)?)<!--(.+?)-->")


def _rows(table: str) -> list[dict[str, str]]:
    with (EXAMPLE / "tables" / f"{table}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def value(said: str) -> str:
    """What a comment names. Raises KeyError or ValueError where the example has no such number."""
    kind, _, rest = said.partition(" ")
    if kind == "runs":
        return _made()
    if kind == "claims-all":
        return str(sum(bool(row["place"]) for row in _rows("claims")))
    if kind == "macro":
        text = (EXAMPLE / "numbers.tex").read_text(encoding="utf-8")
        found = re.search(rf"\\newcommand{{\\coartic{rest}}}{{\\coarticnum{{(.+?)}}}}", text)
        if found is None:
            raise KeyError(said)
        return found[1].replace("-", "−")
    if kind == "cell":
        table, row, column, style = rest.split("|")
        (number,) = (float(r[column]) for r in _rows(table) if r["key"] == row)
        shown = f"{100 * number:.{style[1:] or 0}f} %" if style[0] == "%" else f"{number:{style}}"
        return shown.replace("-", "−")
    if kind == "claims":
        which, verdict = rest.split(" ", 1)
        paper = [row["verdict"] for row in _rows("claims") if row["place"]]
        fitted = {"printed": False, "reconstructed": True}[which]
        found = [v.removesuffix(" †") for v in paper if v.endswith("†") == fitted]
        return str(len(found) if verdict == "all" else found.count(verdict))
    raise ValueError(f"nothing is known of {said!r}")


def _made() -> str:
    """Runs of the folder that the example was made of."""
    text = (EXAMPLE / "numbers.tex").read_text(encoding="utf-8")
    return re.findall(r"^% (\d+) runs", text, re.MULTILINE)[0]


def filled(text: str) -> str:
    """A page with the numbers that the example has."""
    return NUMBER.sub(lambda found: f"{value(found[2])}<!--{found[2]}-->", text)


if __name__ == "__main__":
    page = DOCS / "paper.md"
    page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")
