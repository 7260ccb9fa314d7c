"""The table "to add" of CONTRIBUTING: what is added by its steps alone is in a report."""

import shutil

import pytest

from tests.support.forks import apart, forget
from tests.support.suites import ROOT

METHOD = (ROOT / "tests/example_plugin/coartic_example/__init__.py").read_text(encoding="utf-8")
LOOK = """
["nearest-hand"]
short = "nearest"
works = ["shah2013"]
"""
MEASURE = '''

def hits(cell: Trajectories, signature: Signature) -> Rows:
    """Goals that a run hits."""
    yield mean_at(signature, Place(), [float(len(run.hits)) for run in cell.runs])
'''
SIGNATURE = """
[[within]]
name = "goals hit"
measure = "coartic.analysis.signatures.within.hits"
unit = "goals"
range = "goals"
meaning = "how many goals a run hits"
heading = "hit"
table = "main-signatures"
"""
CLAIM = """
["One-armed tasks".all-goals-hit]
statement = "Every goal is hit."
rule = "counted"
test = "counted"
place = "Method"
"""
JUDGE = """

@decides("all-goals-hit")
def _all_hit(data: Data) -> Finding:
    runs = data.cell(ASCENDING, "nearest-hand").runs
    return Finding(all(len(run.hits) == 3 for run in runs), f"all goals hit in {len(runs)} run")
"""
FIGURE = '''"""Rewards as dots."""

import pandas as pd
from matplotlib.figure import Figure

from coartic.analysis.figures.plot import Plot


def dots(study, *, methods=None):
    """Reward of every run."""
    figure = Figure()
    figure.add_subplot().plot(study.runs.reward.to_numpy(float), "o")
    data = pd.DataFrame({"reward": study.runs.reward})
    return Plot("dots", "Rewards", "Rewards.", "Dots.", figure, data)
'''
TABLE = '''

def longest_table(study: Study) -> DataTable | None:
    """The run of most ticks, by task."""
    layout = LAYOUTS["longest"]
    least = {name: int(-study.runs.reward[study.runs.task == name].min()) for name in study.tasks}
    return layout.table(layout.row(name, task=name, ticks=least[name]) for name in least)
'''
SAID = """
[longest]
rests_on = ["runs"]
caption = "Longest runs."
[longest.columns]
task = {}
ticks = { kind = "number" }
"""

PROPERTY = """
    @property
    def spent(self) -> pd.DataFrame:
        \"""Ticks that each run made.\"""
        return self.runs[["task", "method", "run", "movement_ticks"]]

    @cached_property
    def claims("""
COLUMNS = """
[spent]
caption = "Ticks."
rests_on = ["runs"]
key = ["task", "method", "run"]
[spent.columns]
task = {}
method = {}
run = { kind = "number" }
movement_ticks = { kind = "number", unit = "ticks" }
"""


def look(house):
    """A report by the packages there, and what is in it of what was added.

    In a process of its own. If it is a fork it has imported these packages as they are here.
    """
    forget("coartic", "tests")
    import coartic

    coartic.__path__.insert(0, str(house))  # the other packages come from here
    from coartic import analysis, baselines, benchmarks
    from coartic.analysis.figures import register
    from coartic.analysis.report.analyses import analyse
    from coartic.analysis.report.build import build
    from coartic.analysis.report.trace import trace_in_file
    from coartic.benchmarks import Selection, run_suite
    from coartic.benchmarks.registry import CLASSES
    from tests.support.reports import undrawn
    from tests.support.suites import InProcess

    chosen = Selection(tasks=["ascending"], methods=["nearest-hand", "corrective-alone/given"])
    run_suite("comparison", house / "results", runs=1, select=chosen, executor=InProcess())
    study = analysis.load(house / "results")
    register.REGISTER = [row for row in register.REGISTER if row.name == "dots"]
    with undrawn():
        document = build(study).document
    tables = {table.id: table for table in document.tables()}
    for changed in (analysis, baselines, benchmarks):
        assert changed.__file__.startswith(str(house))
    assert "nearest-hand" in CLASSES
    assert "nearest-hand" in {row.key for row in tables["methods-ascending"].rows}
    signatures = tables["main-signatures-ascending"]
    assert "goals_hit" in {column.name for column in signatures.columns}
    claims = {row.key: row.values for row in tables["claims"].rows}
    assert "supported" in claims["all-goals-hit"]
    assert "dots" in {figure.id for figure in document.figures()}
    (longest,) = tables["longest"].rows
    assert longest.values == ("ascending", int(-study.runs.reward.min()))
    assert analyse(study)["spent.csv"].startswith(b"task,method,run,movement_ticks\n")
    row, cell = "ascending nearest-hand 0", ("ascending", "nearest-hand")
    assert trace_in_file(house / "results", "spent.csv", (row, "movement_ticks")).cells == (cell,)


LEFT_OUT = shutil.ignore_patterns("example")


@pytest.fixture
def house(tmp_path):
    """The packages to which anything is added, with the bytecode of what stays."""
    for package in ("baselines", "benchmarks", "analysis"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=LEFT_OUT, symlinks=True)
    return tmp_path


def test_what_is_added_by_its_steps_is_in_a_report(house):
    def change(path, old, new):
        text = (house / path).read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{path}: {old!r}"
        (house / path).write_text(text.replace(old, new), encoding="utf-8")

    def append(path, text):
        with (house / path).open("a", encoding="utf-8") as file:
            file.write(text)

    # A method: a file, a line of the list, a row.
    append("baselines/nearest_hand.py", METHOD + "\n\nMETHODS = (NearestHand,)\n")
    change(
        "benchmarks/registry.py",
        '    "coartic.baselines.optimum",\n',
        '    "coartic.baselines.nearest_hand",\n    "coartic.baselines.optimum",\n',
    )
    append("analysis/methods.toml", LOOK)
    # A signature: a function, a row.
    append("analysis/signatures/within.py", MEASURE)
    append("analysis/signatures/register.toml", SIGNATURE)
    # A claim: its words and its test, a judge.
    append("analysis/claims/claims.toml", CLAIM)
    append("analysis/claims/one_armed.py", JUDGE)
    # A figure: a file, an import and a row.
    append("analysis/figures/dots.py", FIGURE)
    change(
        "analysis/figures/register.py",
        "from coartic.analysis.figures.frontier import",
        "from coartic.analysis.figures.dots import dots\nfrom coartic.analysis.figures.frontier import",  # noqa: E501
    )
    change(
        "analysis/figures/register.py",
        "REGISTER = (\n",
        'REGISTER = (\n    FigureEntry("dots", dots, "learning"),\n',
    )
    # A table: what it says, a function, an import and its call.
    append("analysis/report/tables/tables.toml", SAID)
    append("analysis/report/tables/paper.py", TABLE)
    change(
        "analysis/report/build.py",
        "tables.paper import beside_paper",
        "tables.paper import beside_paper, longest_table",
    )
    change(
        "analysis/report/build.py",
        "[tasks_table(study)]",
        "[tasks_table(study), longest_table(study)]",
    )
    # A CSV file: a property, its columns, a row.
    change("analysis/study.py", "\n    @cached_property\n    def claims(", PROPERTY)
    append("analysis/report/tables/files.toml", COLUMNS)
    change(
        "analysis/report/tables/files.py",
        "ANALYSES = (\n",
        'ANALYSES = (\n    _file("spent", lambda study: study.spent),\n',
    )
    apart(look, house)
