"""Numbers of a report, followed back to the records and computed again from those alone."""

import json
import random
import re
import shutil
import statistics as plain
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coartic import CoarticError, Movement, corrective_trial, execute, load_task
from coartic.analysis import markup, printed, published
from coartic.analysis.report.document import Document
from coartic.analysis.report.numbers import Number
from coartic.analysis.report.trace import trace, trace_text
from coartic.analysis.report.trace_file import FILE, trace_json
from coartic.analysis.results import optima as shipped
from coartic.analysis.results.folder import load_results
from coartic.analysis.statistics import estimates as statistics
from coartic.analysis.study import Study
from coartic.benchmarks.suites import Cell
from tests.support.made_up import MadeUp
from tests.support.packs import records_of
from tests.support.reports import (
    changed_columns,
    compiled,
    document_of,
    report_of,
    without_figures,
)
from tests.support.suites import KNOWN, run_and_write, with_environment


@pytest.fixture(scope="module")
def study(traced):
    return traced


@pytest.fixture(scope="module")
def results(traced):
    return traced.results


TASKS = {"Ascending": "ascending", "Descending": "descending", "TwoArmedOne": "two-armed-1"}
LABELS = {
    "ECFourNoiseSdZeroPointOne": "dual-process/EC4 noise_sd=0.1",
    "ECOne": "dual-process/EC1",
    "ECThree": "dual-process/EC3",
    "ECFour": "dual-process/EC4",
    "CorrectiveAloneGiven": "corrective-alone/given",
    "TrajectoryOptimisationPathLength": "trajectory-optimisation/path-length",
    "RandomSearchPure": "random-search/pure",
}


def shipped_optima(arm):
    """The shipped optima by task, read as plain JSON."""
    return {
        entry["task"]: entry
        for entry in json.loads(shipped.DATA.read_text(encoding="utf-8"))["optima"]
        if (entry["base"], entry["other_arm"]) == ("task", arm)
    }


OPTIMUM, OPTIMUM_STILL = (
    {
        task: entry["reward"]
        for task, entry in shipped_optima(arm).items()
        if task in TASKS.values()
    }
    for arm in ("free", "still")
)
# The paper.
PUBLISHED = {
    ("ascending", "EC1"): (-303.0, 2.9),
    ("descending", "EC1"): (-314.0, 1.88),
    ("two-armed-1", "EC3"): (-502.0, 3.4),
    ("two-armed-1", "EC4"): (-484.0, 2.0),
}
PUBLISHED_INITIAL = {"ascending": -319, "descending": -333, "two-armed-1": -675}
SIGNATURES = {
    "ContextDistance": "context distance",
    "ContextDependence": "context dependence",
    "NonMotorEquivalent": "non-motor-equivalent part",
    "MotorEquivalent": "motor-equivalent part",
}


@pytest.fixture(scope="module")
def home(study):
    with without_figures():
        return report_of(study, study.results.folder / "report")


LINE = 345.0
"""Width in pt, of class article."""


@pytest.fixture(scope="module")
def log(home, tmp_path_factory):
    """What LaTeX says of all macros and tables, and of the tables' own widths."""
    folder = shutil.copytree(home, tmp_path_factory.mktemp("latex") / "report")
    macros = macros_of(folder)
    assert len(macros) > 100
    return compiled(
        folder,
        rf"\hsize={LINE}pt\textwidth=\hsize\linewidth=\hsize\columnwidth=\hsize"
        r"\let\scaled\resizebox"
        r"\renewcommand{\resizebox}[3]{\sbox0{#3}\typeout{WIDTH \the\wd0}\scaled{#1}{#2}{#3}}"
        + "\n\n".join(f"\\{name}" for name in macros),
    )


def test_tables_are_legible(home, log):
    """None has to be scaled by more than 0.87 to fit on a line, nor is one wider than it."""
    widths = [float(width) for width in re.findall(r"WIDTH ([\d.]+)pt", log)]
    tables = [path.read_text(encoding="utf-8") for path in (home / "tables").glob("*.tex")]
    assert len(widths) == sum(r"\resizebox" in text for text in tables) > 10
    assert 0.87 * max(widths) <= LINE
    assert not re.search(r"Overfull .*in alignment", log)


class Records:
    """The records of a folder, read without the project's code."""

    def __init__(self, folder):
        self.by_cell = {}
        for record in records_of(folder).values():
            specification = record["specification"]
            label = specification["method"]
            if specification["parameters"].get("noise_sd", 0.05) != 0.05:
                label += f" noise_sd={specification['parameters']['noise_sd']}"
            key = specification["task"]["name"], label
            self.by_cell.setdefault(key, []).append(record)
        for records in self.by_cell.values():
            records.sort(key=lambda record: record["run"])

    def rewards(self, key):
        return [record["solution"]["reward"] for record in self.by_cell[key]]

    def spent(self, key, *names):
        return [sum(record["meter"][name] for name in names) for record in self.by_cell[key]]

    def seconds(self, key):
        records = [r for r in self.by_cell[key] if r["timing"]["warm"]] or self.by_cell[key]
        return [r["meter"]["solve_s"] or r["timing"]["wall_s"] for r in records]

    def first_subtask(self, key):
        """Ticks of the first goal beyond those of the task's initial solution."""
        task = load_task(key[0])
        first = corrective_trial(task, task.initial_hands).ticks_by_goal()[0]
        return [r["solution"]["ticks_by_goal"][0] - first for r in self.by_cell[key]]

    def posture(self, key):
        """Mean configuration in which the first goal is hit."""
        task, found = load_task(key[0]), []
        for record in self.by_cell[key]:
            movements = [
                Movement(row["goal"], row["hand"], row["kind"], np.array(row["target"]))
                for row in record["solution"]["movements"]
            ]
            found.append(execute(task, movements).configurations[0])
        return np.mean(found, axis=0)


@pytest.fixture(scope="module")
def records(results):
    return Records(results.folder)


def spread(values):
    return plain.stdev(values)


def recomputed(study, records, name):
    """What a macro stands for, and the cells that it comes from."""
    name = name.removeprefix("coartic")
    word = next(word for word in TASKS if name.startswith(word))
    task, rest = TASKS[word], name.removeprefix(word)
    known = {"Optimum": OPTIMUM, "OptimumStill": OPTIMUM_STILL,
             "PublishedInitialReward": PUBLISHED_INITIAL}  # fmt: skip
    if rest in known:
        return float(known[rest][task]), []
    first = next(word for word in LABELS if rest.startswith(word))
    key, rest = (task, LABELS[first]), rest.removeprefix(first)
    rewards = records.rewards(key)
    if rest.startswith("Minus"):
        second = next(word for word in LABELS if rest.removeprefix("Minus").startswith(word))
        rest = rest.removeprefix(f"Minus{second}")
        others = records.rewards((task, LABELS[second]))
        kind, companion = re.fullmatch("(Reward|Improvement)(Low|High|N|Full|)", rest).groups()
        if kind == "Reward":
            value = plain.mean(rewards) - plain.mean(others)
            found = statistics.difference_of_means(rewards, others, seed=0)
        else:
            value = plain.mean((a > b) + (a == b) / 2 for a in rewards for b in others)
            found = statistics.probability_of_improvement(rewards, others, seed=0)
        own = {"": value, "N": len(rewards) + len(others), "Low": found.low, "High": found.high}
        if companion == "Full":
            own["Full"] = (value, found.low, found.high, own["N"])
        return own[companion], [key, (task, LABELS[second])]
    if rest.startswith("Published"):
        mean, sd = PUBLISHED[task, key[1].rpartition("/")[2]]
        return {"PublishedReward": mean, "PublishedRewardSD": sd, "PublishedRewardN": 20}[rest], []
    if hands := re.fullmatch("Hands([LR]+)", rest):
        counts = [record["solution"]["hands"] for record in records.by_cell[key]]
        return counts.count(hands[1]), [key]
    kind, companion = re.fullmatch(r"(\w+?)(SD|Low|High|N|Full|)", rest).groups()
    if kind in ("Reward", "Gap", "GapPercent", "GapStill", "GapStillPercent"):
        found = statistics.mean(rewards, seed=0)
        own = {"": plain.mean(rewards), "Low": found.low, "High": found.high}
        if kind.startswith("Gap"):
            best = (OPTIMUM_STILL if "Still" in kind else OPTIMUM)[task]
            share = -100 / best if "Percent" in kind else 1
            own = {"": (best - own[""]) * share, "Low": (best - own["High"]) * share,
                   "High": (best - own["Low"]) * share}  # fmt: skip
            own["Full"] = (own[""], own["Low"], own["High"])
        else:
            own |= {"N": len(rewards), "SD": spread(rewards) if len(rewards) > 1 else None}
            own["Full"] = (own[""], own["Low"], own["High"], own["N"])
        return own[companion], [key]
    if kind in SIGNATURES:
        frame = study.signatures
        row = frame[(frame.task == task) & (frame.label == key[1])
                    & (frame.signature == SIGNATURES[kind])].iloc[0]  # fmt: skip
        both = [key, ("descending", key[1])]
        if kind == "ContextDistance" and not companion:
            apart = float(np.linalg.norm(records.posture(key) - records.posture(both[1])))
            assert apart == pytest.approx(row["value"])
        return row[{"": "value", "N": "n", "Low": "low", "High": "high"}[companion]], both
    if kind == "FirstSubtask":
        values = records.first_subtask(key)
        own = {"": plain.mean(values)}
        if companion:
            from scipy import stats

            half = stats.t.ppf(0.975, len(values) - 1) * spread(values) / len(values) ** 0.5
            own |= {"Low": own[""] - half, "High": own[""] + half}
            own["Full"] = (own[""], own["Low"], own["High"])
        return own[companion], [key]
    if rest == "InitialReward":
        return records.by_cell[key][0]["initial"]["reward"], []
    values = {
        "Trials": lambda: records.spent(key, "trials"),
        "Evaluations": lambda: records.spent(key, "forward_kinematics", "jacobians"),
        "SolveSeconds": lambda: records.seconds(key),
    }[rest.removesuffix("N")]()
    return len(values) if rest.endswith("N") else plain.median(values), [key]


def check_macro(home, study, records, name):
    found = trace(home, name)
    value, keys = recomputed(study, records, name)
    shown = [float(part) for part in re.findall(r"-?\d+\.?\d*", found.text)]
    values = value if isinstance(value, tuple) else (value,)
    if isinstance(value, tuple) and value[1] == value[2]:
        assert "no spread" in found.text
        values = (value[0], *value[3:])
    decimals = len(found.text.partition(" ")[0].partition(".")[2])
    assert len(shown) == len(values), (name, found.text, value)
    for got, wanted in zip(shown, values, strict=True):
        assert abs(got - wanted) <= 0.5 * 10.0**-decimals + 1e-9, (name, found.text, value)
    assert all(name in found.meaning for key in keys[:1] for name in key), found.meaning
    check_sources(found, records, keys)


def check_sources(found, records, keys):
    assert [(source.task, source.label) for source in found.sources] == keys, found.name
    for source in found.sources:
        expected = [record["run_id"] for record in records.by_cell[source.task, source.label]]
        assert list(source.run_ids) == expected, found.name


def check_cell(home, records, table, row, column):
    """A cell of a table that has something to do with rewards, spends or hands."""
    found = trace(home, table, (row, column))
    task = next((name for name in TASKS.values() if table.endswith(name)), row.split(" ")[0])
    pair = [(task, label) for label in row.split(" - ")]
    key = (task, row.removeprefix(f"{task} "))
    shown = found.text.replace("\N{MINUS SIGN}", "-").replace("\N{NARROW NO-BREAK SPACE}", "")
    first = shown.split(" ")[0]
    if table.startswith("compared"):
        a, b = map(records.rewards, pair)
        better = plain.mean((x > y) + (x == y) / 2 for x in a for y in b)
        value = {"difference": plain.mean(a) - plain.mean(b), "improvement": better,
                 "delta": 2 * better - 1}[column]  # fmt: skip
    elif table.startswith("costs"):
        names = {"trials": ["trials"], "movement_ticks": ["movement_ticks"],
                 "solve_s": None, "difference": ()}[column]  # fmt: skip
        if names is None:
            a, b = map(records.seconds, pair)
            value = plain.median(b) / plain.median(a)
        elif names:
            a, b = (plain.median(records.spent(cell, *names)) for cell in pair)
            value = b / a
        else:
            a, b = map(records.rewards, pair)
            value = plain.mean(a) - plain.mean(b)
    elif column in ("hands", "told"):
        own = records.by_cell[key]
        if column == "told":
            letters = {"goals": "G", "forward kinematics": "F", "Jacobian": "J",
                       "corrective process": "A", "reward by trial": "T", "kinematic model": "K",
                       "reward as a formula": "R", "secondary objectives": "S"}  # fmt: skip
            assert shown == "".join(letters[k] for k in letters if k in own[0]["told"])
        else:
            hands = [record["solution"]["hands"] for record in own]
            for name in set(hands):
                assert name in shown
                assert len(hands) == 1 or f"{name} {hands.count(name)}" in shown
        check_sources(found, records, [key])
        return
    else:
        pair = [key]
        rewards = records.rewards(key)
        value = {
            "reward": lambda: plain.mean(rewards),
            "ours": lambda: plain.mean(rewards),
            "runs": lambda: len(rewards),
            "solved": lambda: len(rewards),
            "initial": lambda: records.by_cell[key][0]["initial"]["reward"],
            "gap": lambda: OPTIMUM[task] - plain.mean(rewards),
            "gap_share": lambda: 100 * (OPTIMUM[task] - plain.mean(rewards)) / -OPTIMUM[task],
            "solve_s": lambda: plain.median(records.seconds(key)),
        }.get(column, lambda: plain.median(records.spent(key, column)))()
        if column in ("reward", "ours") and len(rewards) > 1:
            sd = spread(rewards)
            assert f"± {sd:.1f}" in shown, (found.name, shown, sd)
            interval = statistics.mean(rewards, seed=0)
            if sd:
                assert shown.endswith(f"[{interval.low:.1f}, {interval.high:.1f}]")
    if first == "–":
        assert value == 0, (found.name, value)
    else:
        digits = len(first.partition(".")[2])
        assert abs(float(first) - value) <= 0.5 * 10.0**-digits + 1e-9, (found.name, shown, value)
    # What is at the start depends on the task alone.
    check_sources(found, records, [] if column == "initial" else pair)


COLUMNS = {
    "methods": "reward solved runs gap gap_share hands told trials movement_ticks "
    "forward_kinematics jacobians solve_s",
    "compared": "difference improvement delta",
    "costs": "difference trials movement_ticks solve_s",
    "published-and-ours": "ours runs initial hands",
}


def macros_of(home):
    text = (home / "numbers.tex").read_text(encoding="utf-8")
    return re.findall(r"^\\newcommand\{\\(\w+)\}", text, re.M)


def table_cells(home):
    tables = json.loads((home / FILE).read_text(encoding="utf-8"))["tables"]
    return [
        (table["id"], row["key"], column)
        for table in tables
        for start, columns in COLUMNS.items()
        if table["id"].startswith(start)
        for row in table["rows"]
        for column in columns.split()
    ]


def test_ten_numbers_at_random(home, study, records):
    draw = random.Random(2013)
    for name in draw.sample(macros_of(home), 5):
        check_macro(home, study, records, name)
    for cell in draw.sample(table_cells(home), 5):
        check_cell(home, records, *cell)


def test_every_macro_is_what_the_records_say(home, study, records):
    names = macros_of(home)
    assert len(names) == len(set(names)) > 100
    assert all(name.isalpha() and name.isascii() for name in names)
    for name in names:
        check_macro(home, study, records, name)


def test_tables_are_what_the_records_say(home, records):
    cells = table_cells(home)
    assert {cell[0] for cell in cells} >= {"methods-ascending", "compared-two-armed-1"}
    for cell in cells:
        check_cell(home, records, *cell)


def test_the_tex_file_has_the_texts_that_are_traced(home):
    text = (home / "numbers.tex").read_text(encoding="utf-8")
    for name, shown in re.findall(r"^\\newcommand\{\\(\w+)\}\{(.*)\}", text, re.M):
        plain_text = re.sub(r"\\coarticnum\{([^}]*)\}", r"\1", shown).replace("$n$", "n")
        assert plain_text == trace(home, name).text


@pytest.mark.parametrize("what", ["text", "cells", "run", "table text", "table cells"])
def test_a_wrong_number_would_be_found(what, home, study, records, tmp_path):
    content = json.loads((home / FILE).read_text(encoding="utf-8"))
    name = "coarticTwoArmedOneECThreeReward"
    macros = {number["macro"]: number for number in content["numbers"]}
    macro, other = macros[name], macros["coarticTwoArmedOneECFourReward"]["cells"]
    (table,) = (t for t in content["tables"] if t["id"] == "methods-two-armed-1")
    (row,) = (r for r in table["rows"] if r["key"] == "dual-process/EC3")
    cell = ("methods-two-armed-1", "dual-process/EC3", "reward")
    (tmp_path / "report").mkdir()

    def check():
        (tmp_path / "report" / FILE).write_text(json.dumps(content), encoding="utf-8")
        check_macro(tmp_path / "report", study, records, name)
        check_cell(tmp_path / "report", records, *cell)

    check()
    if what == "text":
        macro["value"] += 0.2
    elif what == "cells":
        macro["cells"] = other
    elif what == "run":
        (source,) = (s for s in content["sources"] if [s["task"], s["label"]] == macro["cells"][0])
        other_runs = records.by_cell["two-armed-1", "dual-process/EC4"]
        source["run_ids"][0] = other_runs[0]["run_id"]
    elif what == "table text":
        row["values"][1]["sd"] += 10
    else:
        row["cells"] = other
    with pytest.raises(AssertionError):
        check()


def test_latex_takes_every_macro_and_table(log):
    for fault in ("Overfull", "Undefined", "Missing character", "multiply defined"):
        assert fault not in log, re.findall(f".*{fault}.*", log)


def test_variants_have_their_reward_only(home):
    variant = [name for name in macros_of(home) if "NoiseSdZeroPointOne" in name]
    assert sorted(variant) == [
        f"coarticTwoArmedOneECFourNoiseSdZeroPointOneReward{rest}"
        for rest in ("", "Full", "High", "Low", "N", "SD")
    ]


def test_a_report_does_not_know_where_it_lies(searched, searched_home, tmp_path):
    again = Study(load_results(searched.folder))
    with without_figures(but=FIGURES):
        report_of(again, tmp_path / "elsewhere")
    first, second = (
        {p.relative_to(folder).as_posix(): p.read_bytes()
         for p in sorted(folder.rglob("*")) if p.is_file()}
        for folder in (searched_home, tmp_path / "elsewhere")
    )  # fmt: skip
    assert list(first) == list(second)
    assert [name for name in first if first[name] != second[name]] == []
    secrets = [str(searched.folder), str(tmp_path), "/home/somebody", str(Path.cwd())]
    for name, content in first.items():
        assert not [s for s in secrets if s.encode() in content], name
    # In the results folder it is found; elsewhere only its plan is known.
    assert trace(searched_home, "coarticAscendingOptimum").folder == searched.folder
    assert trace(tmp_path / "elsewhere", "coarticAscendingOptimum").folder is None


def test_what_a_report_does_not_have(home, tmp_path):
    for arguments, words in (
        (("coarticAscendingECOneRewrd",), "did you mean 'coarticAscendingECOneReward"),
        (("methods-ascendin",), "did you mean 'methods-ascending"),
        (("methods-ascending", ("dual-proces/EC1", "reward")), "did you mean 'dual-process/EC1'?"),
        (("methods-ascending", ("dual-process/EC1", "rewrd")), "did you mean 'reward"),
        (("methods-ascending",), "name a row and a column"),
        (("coarticAscendingECOneReward", ("a", "b")), "is a macro"),
    ):
        with pytest.raises(CoarticError, match=re.escape(words)):
            trace(home, *arguments)
    whole = json.loads((home / FILE).read_text(encoding="utf-8"))
    whole["tables"][0]["rows"][0]["cells"] = [["nowhere", "dual-process/EC1"]]
    for text in (
        "", "[]", "{}", '{"format":3}', '{"format":5,"numbers":{"a":1},"tables":[]}', "\ud800",
        json.dumps(whole),
    ):  # fmt: skip
        (tmp_path / FILE).write_bytes(text.encode(errors="surrogatepass"))
        with pytest.raises(CoarticError, match=re.escape(FILE)):
            trace(tmp_path, "a")


def shipped_runs(task, arm):
    """Ids in the shipped optima."""
    return shipped_optima(arm)[task]["run_ids"]


def test_shipped_optima_name_their_runs(home):
    """This folder has no search of its own for the optimum."""
    for name, arm in (("Optimum", "free"), ("OptimumStill", "still")):
        found = trace(home, f"coarticTwoArmedOne{name}")
        assert found.sources == ()
        known = ", ".join(shipped_runs("two-armed-1", arm))
        assert (
            found.how == f"not proven; shipped data (analysis/results/optima.json), runs {known}"
        )
        assert trace_text(found).splitlines()[-1].startswith("runs: none; this value is the opt")
    best, best_still = OPTIMUM["two-armed-1"], OPTIMUM_STILL["two-armed-1"]
    for name, reward, arm in (("Gap", best, "free"), ("GapPercentLow", best, "free"),
                              ("GapStill", best_still, "still")):  # fmt: skip
        method = "ECThree" if arm == "still" else "ECFour"
        how = trace(home, f"coarticTwoArmedOne{method}{name}").how
        assert how.startswith("mean, BCa bootstrap")
        assert f"from the optimum {reward}: not proven; shipped data" in how
        assert ", ".join(shipped_runs("two-armed-1", arm)) in how
    cell = trace(home, "tasks-in-short", ("two-armed-1", "optimum"))
    assert cell.sources == ()
    assert ", ".join(shipped_runs("two-armed-1", "free")) in cell.how
    still = trace(home, "methods-two-armed-1", ("dual-process/EC3", "gap_still")).how
    assert f"other arm still, {best_still}: not proven; shipped data" in still
    assert ", ".join(shipped_runs("two-armed-1", "still")) in still


def test_what_no_runs_are_behind(home):
    paper = "printed in the paper (Shah, Barto & Fagg, 2013)"
    derived = "derived from what the paper prints (Shah, Barto & Fagg, 2013)"
    ours = "ours, chosen or assumed, not the paper's (Shah, Barto & Fagg, 2013)"
    alone = "computed from the corrective process alone"
    place = "Results, Exploration Condition"
    ascending = "published-and-ours", "ascending dual-process/EC1"
    fourth = "two-armed-1 dual-process/EC4"
    for (name, *where), origin in (
        (("coarticTwoArmedOnePublishedInitialReward",), f"{paper}; {place} 2"),
        (("coarticAscendingPublishedInitialReward",), f"{derived}; {place} 1"),
        (("coarticTwoArmedOneECFourPublishedReward",), f"{paper}; {place} 4"),
        (("coarticAscendingECOneInitialReward",), alone),
        (("exhaustive", "two-armed-1", "published"), paper),
        (("exhaustive", "two-armed-1", "sequences"), alone),
        ((*ascending, "published"), paper),
        ((*ascending, "published_initial"), derived),
        ((*ascending, "initial"), alone),
        ((*ascending, "margin"), ours),
        (("published-and-ours", fourth, "published_runs"), ours),
        (("by-hand-sequence", f"{fourth} LRLR", "published_runs"), ours),
    ):
        found = trace(home, name, where)
        assert found.sources == ()
        assert trace_text(found).splitlines()[-1] == f"runs: none; this value is {origin}"


def test_every_column_says_what_it_rests_on(study):
    """With another optimum those change that say that they rest on it."""
    document = document_of(study)
    columns = {(t.id, column.name): column for t in document.tables() for column in t.columns}
    assert [key for key, c in columns.items() if c.kind != "text" and not c.rests_on] == []
    better = {"free": 9, "still": 6}
    others = {
        (task, arm): replace(best, reward=best.reward + better[arm], bound=None)
        for (task, arm), best in study.optima.items()
    }
    other = document_of(MadeUp(study.results, optima=others))
    changed = changed_columns(document.tables(), other.tables())
    saying = {key for key, column in columns.items() if "optimum" in column.rests_on}
    assert changed - saying == set()
    kinds = [{re.sub(r"\d+", "", name) for _, name in keys} for keys in (saying, changed)]
    assert kinds[0] == kinds[1]  # within_1 of all, where one or another changes
    assert len(changed) > 40


def test_what_rests_on_the_paper_says_so(study, monkeypatch):
    """With other printed rewards those values change that say that they rest on them."""
    before = list(document_of(study).tables())
    other = {
        key: entry.model_copy(update={"value": entry.value - 7})
        if isinstance(entry, printed.Reward) else entry
        for key, entry in printed.ENTRIES.items()
    }  # fmt: skip
    for module in (printed, published):
        monkeypatch.setattr(module, "ENTRIES", other)
    after = list(document_of(Study(study.results)).tables())
    columns = {(table.id, column.name): column for table in before for column in table.columns}
    saying = {
        (table.id, column.name)
        for table in before
        for column in table.columns
        for row in table.rows
        if {"paper", "derived"} & {*row.rests_on.get(column.name, column.rests_on)}
    }
    changed = {key for key in changed_columns(before, after) if columns[key].kind != "text"}
    assert changed - saying == set()
    assert len(changed) > 5


def test_a_cell_of_a_table_says_how(home):
    found = trace(home, "methods-ascending", ("dual-process/EC1", "reward"))
    assert found.how.startswith("reward (ticks), SD, 95 % interval. Reward: of the runs that")
    assert "Told: G goals" in found.how
    assert "Reward: of the runs that have a solution" in found.how
    assert "Optimum of" not in found.how
    assert "how: reward (ticks)" in trace_text(found)
    share = trace(home, "methods-ascending", ("dual-process/EC1", "gap_share")).how
    assert share.startswith("gap (%). ")
    assert "Optimum of ascending, other arm free, -292: proven; shipped data" in share
    content = json.loads((home / FILE).read_text(encoding="utf-8"))
    for table in content["tables"]:
        row, column = table["rows"][0]["key"], table["columns"][-1]
        how = trace(home, table["id"], (row, column["name"])).how
        assert all(markup.words(note) in how for note in table.get("notes", ()))
        assert how.startswith(column["header"])


def test_what_depends_on_other_rows_names_them(study, home):
    """Fronts, adjusted p and areas: all methods of the task, whatever is shown of them."""
    document = {table.id: table for table in document_of(study).tables()}
    for name, column in (
        ("pareto-two-armed-1", "trials_front"),
        ("compared-two-armed-1", "p_holm"),
        ("areas-two-armed-1", "trials"),
    ):
        *_, last = document[name].rows
        rows = [row for row in document[name].rows if row.family == last.family]
        found = trace(home, name, (last.key, column))
        assert "It depends on all of its family: all " in found.how
        every = {cell for row in rows for cell in row.cells} | {*document[name].unshown}
        assert set(found.cells) == every > set(last.cells), name
    pair = document["compared-two-armed-1"].rows[0].key
    raw = trace(home, "compared-two-armed-1", (pair, "p"))
    assert "family" not in raw.how
    assert len(raw.cells) == 2
    fronts = document["pareto-two-armed-1"]
    compared = {(task, name) for task, name in study.pareto[["task", "method"]].to_numpy()
                if task == "two-armed-1"}  # fmt: skip
    found = trace(home, fronts.id, (fronts.rows[0].key, "trials_told"))
    assert set(found.cells) == compared


def test_signatures_and_evidence_say_how(home):
    for table in json.loads((home / FILE).read_text(encoding="utf-8"))["tables"]:
        if not table.get("notes") and table["id"].startswith(("main-sig", "further", "evidence")):
            for column in table["columns"]:
                assert column.get("how") or column["name"] in ("method", "runs"), column


def test_what_the_command_makes(home, records):
    """EC4 has a variant in the same suite: naming the method makes both."""
    text = trace_text(trace(home, "coarticTwoArmedOneECFourReward"))
    both = [key for key in records.by_cell if key[1].startswith("dual-process/EC4")]
    runs = sum(len(records.by_cell[key]) for key in both)
    assert len(both) == 2
    assert f"  makes {runs} runs, of which these 4\n" in text
    assert "makes" not in trace_text(trace(home, "coarticTwoArmedOneECThreeReward"))


@pytest.mark.parametrize(
    ("command", "shown", "anew"),
    [
        (("__main__.py", "run", "paper"), ["python", "-m", "coartic", "run", "paper"], True),
        (("coartic", "run", "paper"), ["coartic", "run", "paper"], True),
        (("coartic", "run", "/home/a/own.toml"), ["coartic", "run", "own.toml"], False),
        (("own.py",), ["own.py"], False),
    ],
)
def test_runs_are_made_anew_without_files_of_the_users_own(study, tmp_path, command, shown, anew):
    """However coartic was started."""
    manifest = study.results.manifest
    environment = manifest.environment.model_copy(update={"command": command})
    manifest = manifest.model_copy(update={"environment": environment})
    started = Study(replace(study.results, manifest=manifest))
    cells = {key: tuple(cell.runs.run_id) for key, cell in started.cells.items()}
    number = Number("coarticX", "x", 1.0, 1, "ticks", cells=(next(iter(cells)),))
    text = trace_json(started, Document("t", (), runs=cells), [number])
    (tmp_path / FILE).write_text(text, encoding="utf-8")
    found = trace(tmp_path, "coarticX")
    assert list(found.file.environment.command) == shown
    assert bool(found.sources[0].command) == anew
    assert ("\nanew: coartic run" in trace_text(found)) == anew


SEARCH, BOUND = "optimum/dynamic-programming", "optimum/branch-and-bound"
SMALL = {"nodes": 10, "graphs": 1, "chains": 1}
FIGURES = ("configurations-one-armed", "learning-curves")
"""One whose caption names a run, one of the trials: others name no more."""


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    """One task with searches of its own, free, with the other arm still, and a locked base."""
    folder = tmp_path_factory.mktemp("searched") / "results"
    task = load_task("ascending")
    cells = [
        Cell(task, KNOWN["dual-process/EC1"]),
        *(
            Cell(task, KNOWN[SEARCH], tuple({**SMALL, **more}.items()))
            for more in ({}, {"other_arm": "still"}, {"base": "y"})
        ),
        Cell(task, KNOWN[BOUND], tuple(SMALL.items())),
    ]
    run_and_write(folder, cells, runs=3, trials=100)
    return with_environment(folder)


@pytest.fixture(scope="module")
def searched_home(searched):
    with without_figures(but=FIGURES):
        return report_of(Study(searched), searched.folder / "report")


def test_searches_in_the_folder_are_the_optimums_runs(searched, searched_home):
    home = searched_home
    searches = [label for _, label in searched.cells if label.startswith("optimum/")]
    own = {
        "free": [label for label in searches if "other_arm" not in label and "base" not in label],
        "still": [label for label in searches if "other_arm=still" in label],
    }
    assert [label.partition(" ")[0] for label in own["free"]] == [SEARCH, BOUND]
    assert len(own["still"]) == 1

    def labels(name, *where):
        return [source.label for source in trace(home, name, *where).sources]

    assert labels("coarticAscendingOptimum") == own["free"]
    assert trace(home, "coarticAscendingOptimum").how == "proven; searches of this folder"
    # No search of the folder's bounds it with the other arm still.
    still = trace(home, "coarticAscendingOptimumStill")
    assert [source.label for source in still.sources] == own["still"]
    stored = ", ".join(shipped_runs("ascending", "still"))
    assert still.how == (
        "proven; reward: searches of this folder; bound: shipped data "
        f"(analysis/results/optima.json), runs {stored}"
    )
    for name in ("coarticAscendingECOneGap", "coarticAscendingECOneGapPercent"):
        assert labels(name) == ["dual-process/EC1", *own["free"]]
        assert "from the optimum -292: proven; searches of this folder" in trace(home, name).how
    assert labels("coarticAscendingECOneReward") == ["dual-process/EC1"]
    row = ("methods-ascending", ("dual-process/EC1", "gap"))
    assert labels(*row) == ["dual-process/EC1", *own["free"]]
    assert labels("tasks-in-short", ("ascending", "optimum")) == own["free"]
    assert labels("tasks-in-short", ("ascending", "learned")) == ["dual-process/EC1"]


def test_a_search_that_falls_short_is_not_the_optimums(searched):
    runs = searched.runs.copy()
    runs.loc[runs.method.str.startswith("optimum/"), "reward"] = -300
    runs["proven_bound"] = None
    found = Study(replace(searched, runs=runs)).optima
    assert found["ascending", "free"].reward == -292
    assert found["ascending", "free"].cells == ()
    assert "searches of this folder" not in found["ascending", "free"].how
