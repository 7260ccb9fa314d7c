"""Figures: what they show is what the runs say; files are the same every time."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from coartic import CoarticError, corrective_trial, execute, load_task
from coartic.analysis import load
from coartic.analysis.figures import REGISTER, Figures, register
from coartic.analysis.figures.bars import bars, stars
from coartic.analysis.figures.configurations import (
    PAPER,
    common_sequences,
    configurations,
    typical_run,
)
from coartic.analysis.figures.context import context
from coartic.analysis.figures.frontier import frontier
from coartic.analysis.figures.learning_curves import learning_curves
from coartic.analysis.figures.plot import FORMATS, Plot, _settle, save, svg_text
from coartic.analysis.figures.profiles import profiles
from coartic.analysis.figures.published import published
from coartic.analysis.figures.recruitment import recruitment
from coartic.analysis.figures.register import SECTIONS
from coartic.analysis.figures.style import ONE, RC, TWO, amount, looks, number, on, widest
from coartic.analysis.figures.svg import compact, relative
from coartic.analysis.figures.tasks import tasks_plot
from coartic.analysis.methods import KNOWN_METHODS, short_name
from coartic.analysis.published import TRIALS
from coartic.analysis.study import Study
from coartic.benchmarks.suites import load_suite, select_cells
from coartic.rows import movements_from
from tests.support.made_up import MadeUp
from tests.support.suites import KNOWN, run_and_write


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return Study(run_and_write(tmp_path_factory.mktemp("figures"), runs=4, trials=120))


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A folder without the learner, one task."""
    cells = select_cells(
        load_suite("comparison"), KNOWN, tasks=["descending"], methods=["corrective-alone/given"]
    )
    return Study(run_and_write(tmp_path_factory.mktemp("alone"), cells=cells, runs=1))


@pytest.fixture(scope="module")
def figures(study):
    return study.figures


@pytest.fixture(scope="module")
def kinds(figures):
    """Of figures that are drawn alike the one with the longest title."""
    by_kind = {row.name.partition("-")[0]: [] for row in REGISTER if row.name != "published"}
    for plot in figures.plots:
        by_kind[plot.id.partition("-")[0]].append(plot)
    return [max(plots, key=lambda plot: len(plot.title)) for plots in by_kind.values() if plots]


def test_every_figure_of_the_papers_cells(figures):
    ids = [plot.id for plot in figures.plots]
    assert ids[:5] == [
        "tasks",
        "configurations-one-armed",
        "configurations-two-armed-1",
        "configurations-two-armed-2",
        "learned-reward",
    ]
    assert len(set(ids)) == len(ids)
    # Published means are of 10 000 trials, these runs of 120.
    assert set(figures.skipped) == {"published"}
    assert "10000 trials" in figures.skipped["published"]
    for plot in figures.plots:
        assert re.fullmatch(r"[a-z0-9-]+", plot.id)
        assert len(plot.alt) > 30
        assert len(plot.caption) > 60
        assert len(plot.data)
        assert round(plot.figure.get_size_inches()[0] * 25.4, 6) in (85, 178)
        assert plot.figure.get_size_inches()[1] * 25.4 <= 240


def test_each_is_drawn_when_it_is_asked_for(study, monkeypatch):
    drawn = []

    def noted(row):
        def draw(*of, **by):
            drawn.append(row.name)
            if row.name == "published":
                return row.draw(*of, **by)
            return Plot(row.name, "", "", "", Figure(), pd.DataFrame())

        return row._replace(draw=draw)

    monkeypatch.setattr(register, "REGISTER", tuple(map(noted, REGISTER)))
    figures = Figures(study)
    first = figures["learned-reward"]
    assert figures["learned-reward"] is first
    assert drawn == ["learned-reward"]
    with pytest.raises(KeyError, match=f"no figure 'published': .*{TRIALS} trials"):
        figures["published"]
    assert "nothing" not in figures
    assert drawn[:2] == ["learned-reward", "published"]
    assert sorted(drawn) == sorted(row.name for row in REGISTER if row.section != "families")
    assert list(figures) == [plot.id for plot in figures.plots]


def test_a_study_is_itself_alone(study):
    assert study == study
    assert study != Study(study.results)
    assert len({study, study}) == 1
    for name, words in ((" ", "empty"), (3, "folder is 3; it must be a path")):
        with pytest.raises(CoarticError, match=words):
            load(name)


def test_wide_figures_are_drawn_one_column_wide_as_well(figures):
    """What is wider than a column, with the same data and its panels below each other."""
    drawn = figures
    before = [plot.figure.get_figwidth() for plot in drawn.plots]
    wide = {plot.id: plot for plot in drawn.plots}
    found = {}
    for section in SECTIONS:
        found |= drawn.for_a_phone(section)
    assert {"tasks", "learned-reward", "learning-curves"} <= found.keys()
    for name, narrow in found.items():
        assert narrow.id == f"{name}-narrow"
        assert narrow.figure.get_figwidth() == ONE < wide[name].figure.get_figwidth()
        pd.testing.assert_frame_equal(narrow.data, wide[name].data)
        places = [axes.get_subplotspec() for axes in narrow.figure.axes]
        assert all(place is None or place.colspan.start == 0 for place in places)
    assert [plot.figure.get_figwidth() for plot in drawn.plots] == before
    assert widest() == TWO


def test_an_unknown_name_gets_an_answer(study):
    with pytest.raises(KeyError, match="no figure 'learned'; did you mean 'learned-reward'"):
        study.figures["learned"]
    with pytest.raises(KeyError, match="no figure 0; there are"):
        study.figures[0]
    assert 0 not in study.figures
    assert repr(study.figures).startswith("Figures by id, of Study of ")


def test_every_figure_has_its_row_and_its_section(figures):
    rows = {plot.id: [row for row in REGISTER if plot.id.startswith(row.name)]
            for plot in figures.plots}  # fmt: skip
    for name, own in rows.items():
        assert len(own) == 1, name
        assert name in [plot.id for plot in figures.of_section(own[0].section)]


def test_there_may_be_too_many_tasks(study):
    with pytest.raises(KeyError, match="there would be one for each of 4 tasks"):
        Figures(study, most_tasks=3)["signatures-ascending"]


def test_a_folder_without_the_learner(alone):
    figures = Figures(alone)
    assert {"learned-reward", "published", "recruitment", "context"} <= set(figures.skipped)
    assert any(name.startswith("configurations") for name in figures.skipped)
    assert all(figures.skipped.values())
    assert figures.plots[0].id == "tasks"
    with pytest.raises(CoarticError, match=r"no solved run of dual-process/EC1 on descending"):
        configurations(alone, [("descending", ["dual-process/EC1"])])
    with pytest.raises(CoarticError, match=r"no task ascending"):
        configurations(alone, [("ascending", [])])
    with pytest.raises(CoarticError, match=r"no method 'cma-es/bandit'; it has corrective"):
        frontier(alone, methods=["cma-es/bandit"])
    with pytest.raises(CoarticError, match="no task with two hands"):
        recruitment(alone)
    with pytest.raises(CoarticError, match="no method has solved runs on two tasks"):
        context(alone)


def test_bars_are_means_of_the_runs(study, figures):
    runs, plot = study.results.runs, figures.plot("learned-reward")
    data = plot.data
    assert len(data) == 7  # three conditions and two, each task with its initial solution
    for row in data[data.method != "initial"].itertuples():
        own = runs[(runs.task == row.task) & (runs.method == row.method)].reward
        assert row.reward == pytest.approx(own.astype(float).mean())
        assert row.low <= row.reward <= row.high
        # Runs that end all in one reward may have no spread to test, nor what they are tested on.
        assert own.max() == own.min() or not np.isnan(row.p)
    assert data[data.method == "initial"].p.isna().all()
    assert data.p.notna().any()
    first = data[data.method == "initial"].set_index("task")
    for name in ("two-armed-1", "two-armed-2"):
        assert first.reward[name] == corrective_trial(load_task(name), "RRRR").reward
    assert first.published.to_dict() == {"two-armed-1": -675, "two-armed-2": -357}
    # The bars themselves: from the initial solution to the mean.
    panel = plot.figure.axes[0]
    shown = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in panel.patches]
    expected = data[(data.task == "two-armed-1") & (data.method != "initial")].reward
    assert [bottom for bottom, _ in shown] == [first.reward["two-armed-1"]] * 3
    assert [top for _, top in shown] == pytest.approx(expected.tolist())


def test_stars():
    assert [stars(p) for p in (0.0009, 0.001, 0.04, 0.05, float("nan"))] == [
        "***", "**", "*", "n.s.", "–",
    ]  # fmt: skip


def test_configurations_are_those_of_the_stored_run(study, figures):
    plots = [figures.plot(name) for name in PAPER]
    solutions, paths = study.results.solutions(), study.results.paths()
    for plot in plots:
        for (name, run_id), rows in plot.data.groupby(["task", "run_id"]):
            task = load_task(name)
            if run_id:
                own = solutions[solutions.run_id == run_id]
                execution = execute(task, movements_from(task, own, paths))
                assert run_id not in plot.caption  # which is for reading; the data name it
            else:
                execution = corrective_trial(task, "R" * len(task.goals))
            q = rows[list(task.robot.joint_names)].to_numpy()
            np.testing.assert_array_equal(q, [task.q0, *execution.configurations])
            assert rows.reward.sum() == execution.reward == rows.total.iloc[0]
            assert rows.goal.tolist() == list(range(len(task.goals) + 1))
    # The chosen hand touches the goal's disc in what is drawn.
    axes = plots[0].figure.axes[0]
    marked = [line for line in axes.lines if line.get_marker() == "o"]
    tip = np.array(marked[-1].get_xydata()[-1])
    assert np.linalg.norm(tip - load_task("ascending").goals[0]) <= 0.1


def test_the_typical_run(study):
    cell = study.cells["two-armed-1", "dual-process/EC3"].good
    run_id = typical_run(study, "two-armed-1", "dual-process/EC3")
    row = cell[cell.run_id == run_id].iloc[0]
    counts = cell.hands.value_counts()
    assert counts[row.hands] == counts.max()
    same = cell[cell.hands == row.hands].reward.astype(float)
    median = cell.reward.astype(float).median()
    assert abs(row.reward - median) == (same - median).abs().min()
    other = next(name for name in cell.run_id if name != run_id)
    plot = configurations(
        study,
        [("two-armed-1", ["dual-process/EC3"])],
        runs={("two-armed-1", "dual-process/EC3"): other},
    )
    assert set(plot.data.run_id) == {"", other}
    with pytest.raises(CoarticError, match="0000 is no solved run of dual-process/EC3"):
        configurations(
            study,
            [("two-armed-1", ["dual-process/EC3"])],
            runs={("two-armed-1", "dual-process/EC3"): "0000"},
        )


def test_a_row_for_each_common_hand_sequence(study, figures):
    runs, several = study.results.runs, 0
    for plot in [figures.plot(name) for name in PAPER]:
        titles = [text.get_text() for text in plot.figure.texts]
        learned = plot.data[plot.data.run_id != ""].drop_duplicates("run_id")
        for (task, label), rows in learned.groupby(["task", "method"], sort=False):
            cell = runs[(runs.task == task) & (runs.method == label)]
            counts = cell.hands.value_counts()  # of four runs: each is a quarter or more
            expected = sorted(counts.index, key=lambda hands: (-counts[hands], hands))[:2]
            assert rows.hands.tolist() == expected
            several += len(expected) > 1
            for row in rows.itertuples():
                own = cell[cell.hands == row.hands].reward.astype(float)
                assert abs(row.total - own.median()) == (own - own.median()).abs().min()
                name = f"{short_name(label)}, {row.hands} ({counts[row.hands]} of 4)"
                assert [title for title in titles if title.endswith(name)]
    assert several


def test_common_hand_sequences_are_a_fifth_of_the_runs(tmp_path):
    cells = select_cells(
        load_suite("paper"), KNOWN, tasks=["two-armed-2"], methods=["dual-process/EC3"]
    )
    planted = Study(run_and_write(tmp_path, cells=cells, runs=12, trials=20))
    for hands, expected in (
        (["LL"] * 5 + ["RR"] * 4 + ["RL"] * 3, ["LL", "RR"]),
        (["RL"] * 2 + ["LL"] * 10, ["LL"]),
        (["RL"] * 6 + ["LL"] * 6, ["LL", "RL"]),
        ([f"{k}" for k in range(12)], ["0"]),
    ):
        own = Study(replace(planted.results, runs=planted.results.runs.assign(hands=hands)))
        assert common_sequences(own, "two-armed-2", "dual-process/EC3", 2) == expected


def test_any_methods_side_by_side(study):
    asked = ["dual-process/EC4", "dual-process/EC1"]
    found = Figures(study, methods=asked)
    assert {"recruitment", "learning-curves", "frontier-trials", "signatures-two-armed-1"} <= {
        plot.id for plot in found.plots
    }
    for plot in found.plots:
        if "method" in plot.data:
            assert set(plot.data.method) <= {*asked, "initial"}, plot.id
    shown = {plot.id: plot.data for plot in found.plots}
    assert set(shown["configurations-two-armed-1"].method) == {"initial", asked[0]}
    assert set(shown["configurations-one-armed"].method) == {"initial", asked[1]}
    assert set(shown["frontier-trials"].method) == set(asked)
    assert "no runs on every one" in found.skipped["profiles"]
    with pytest.raises(CoarticError, match="no method 'dual-proces/EC4'; did you mean 'dual-pr"):
        Figures(study, methods=["dual-proces/EC4"])


def test_learning_curves_against_a_loop(study, monkeypatch):
    window = 7
    monkeypatch.setattr("coartic.analysis.figures.learning_curves.WINDOW", window)
    data = learning_curves(study).data
    learning = study.results.learning()
    spread = 0
    for key, rows in data.groupby(["task", "method"]):
        ids = study.cells[key].good.run_id
        runs = [
            learning[learning.run_id == run].reward.to_numpy(dtype=float, na_value=np.nan)
            for run in ids
        ]
        assert rows.trial.iloc[[0, -1]].tolist() == [1, 120]
        for row in rows.itertuples():
            best = sorted(np.nanmax(run[: row.trial]) for run in runs)
            assert row.best == pytest.approx(np.mean(best))
            # Quartiles of four runs lie a quarter of the way from the inner to the outer ones.
            assert row.best_low == pytest.approx(best[0] + 0.75 * (best[1] - best[0]))
            assert row.best_high == pytest.approx(best[3] - 0.75 * (best[3] - best[2]))
            spread += row.best_low < row.best_high
            last = np.concatenate([run[max(row.trial - window, 0) : row.trial] for run in runs])
            assert row.trials == pytest.approx(np.nanmean(last))
    assert spread > 100


def test_shares_of_hand_sequences(study):
    data = recruitment(study).data
    ours = data[data.source == "ours"]
    for (task, label), rows in ours.groupby(["task", "method"]):
        counts = study.cells[task, label].good.hands.value_counts()
        assert dict(zip(rows.hands, rows.runs, strict=True)) == counts.to_dict()
    assert data.groupby(["task", "method", "source"]).share.sum().to_numpy() == pytest.approx(1)
    paper = data[(data.source == "published") & (data.method == "dual-process/EC2")]
    assert dict(zip(paper.hands, paper.runs, strict=True)) == {"RRLR": 11, "RRRR": 9}


def test_context_parts_are_the_signatures(study):
    (row,) = context(study).data.itertuples()
    frame = study.signatures.dropna(subset="value").set_index("signature").value
    assert (row.task, row.method, row.runs) == ("ascending", "dual-process/EC1", 8)
    assert row.equivalent == frame["motor-equivalent part"]
    assert row.other == frame["non-motor-equivalent part"]


def test_stars_of_contexts_are_adjusted_over_the_figure(study):
    """Signatures planted for several methods, with p that Holm's correction moves."""
    frame, labels = study.signatures, [f"dual-process/EC1-{k}" for k in range(3)]
    parts = frame[frame.signature.isin(["motor-equivalent part", "non-motor-equivalent part"])]
    parts = parts[parts.value.notna()]
    raw = {"motor-equivalent part": [0.0005, 0.02, 0.008],
           "non-motor-equivalent part": [0.03, 0.6, 0.001]}  # fmt: skip
    planted = pd.concat(
        [
            parts.assign(label=label, p=[raw[name][k] for name in parts.signature])
            for k, label in enumerate(labels)
        ],
        ignore_index=True,
    )
    own = study.cells["ascending", "dual-process/EC1"]
    cells = study.cells | {("ascending", label): own for label in labels}
    results = replace(study.results)
    results.__dict__["cells"] = cells
    of = MadeUp(results, signatures=planted)
    plot = context(of, methods=labels)
    data = plot.data.set_index("method").loc[labels]
    # Smallest of six times six, the next times five, and so on, never falling.
    together = [p for pair in zip(*raw.values(), strict=True) for p in pair]
    adjusted, floor = {}, 0.0
    for place, at in enumerate(np.argsort(together)):
        floor = max(floor, min(1.0, (6 - place) * together[at]))
        adjusted[int(at)] = floor
    assert data.holm_equivalent.tolist() == pytest.approx([adjusted[0], adjusted[2], adjusted[4]])
    assert data.holm_other.tolist() == pytest.approx([adjusted[1], adjusted[3], adjusted[5]])
    shown = [text.get_text() for text in plot.figure.axes[0].texts if text.get_text()]
    assert shown == [stars(adjusted[at]) for at in (0, 2, 4)]
    assert shown != [stars(p) for p in raw["motor-equivalent part"]]


def test_signature_matrices(study, figures):
    plots = {plot.id: plot.data for plot in figures.of_section("coarticulation")}
    data = plots["signatures-two-armed-1"]
    own = data[data.signature == "hand entropy"]
    frame = study.signatures
    for row in own.itertuples():
        found = frame[
            (frame.task == "two-armed-1")
            & (frame.label == row.method)
            & (frame.signature == "hand entropy")
        ]
        assert row.value == found.value.iloc[0]
    known = data[data.groupby("signature").value.transform("std") > 0]
    scores = known.groupby("signature").standardised
    assert scores.mean().to_numpy() == pytest.approx(0, abs=1e-9)
    assert scores.std().to_numpy() == pytest.approx(1)
    one = plots["signatures-ascending"]  # one method: nothing to standardise by
    assert set(one.standardised.dropna()) == {0.0}


def test_frontier_and_profiles(study, figures):
    last = figures.plot("frontier-trials").data.groupby(["task", "method"]).last()
    runs = study.results.runs
    for (task, method), row in last.iterrows():
        own = runs[(runs.task == task) & (runs.method == method)].reward
        assert row["mean"] == pytest.approx(own.astype(float).mean())
        assert row.budget == 120
    data = figures.plot("profiles").data
    assert set(data.method) == {"learner"}
    learner = {
        "ascending": "EC1", "descending": "EC1", "two-armed-1": "EC4", "two-armed-2": "EC4",
    }  # fmt: skip
    shares = []
    for task, condition in learner.items():
        own = runs[(runs.task == task) & (runs.method == f"dual-process/{condition}")]
        top = study.optima[task, "free"].reward
        shares.append(((top - own.reward.astype(float)) / -top <= 0.1).mean())
    at = data[(data.kind == "gap") & np.isclose(data.threshold, 0.1)]
    assert at.share.iloc[0] == pytest.approx(np.mean(shares))
    with pytest.raises(CoarticError, match="no runs on every one of"):
        profiles(study, methods=["dual-process/EC2"])


def test_published_differences(tmp_path):
    cells = select_cells(
        load_suite("paper"), KNOWN, tasks=["two-armed-1"], methods=["dual-process/EC2"]
    )
    results = run_and_write(tmp_path, cells=cells, runs=3, trials=60)
    results.runs["trials"] = 10_000  # planted: the table asks for the paper's length
    results.runs["hands"] = ["RRRR", "RRRR", "LRLR"]
    results.runs["reward"] = [-610, -606, -500]
    data = published(Study(results)).data.set_index("hands")
    assert data.difference[""] == pytest.approx(-572 - (11 * -520 + 9 * -609) / 20)
    assert data.verdict[""] == "undecided"  # also of a mean over sequences
    assert data.difference["RRRR"] == pytest.approx(1.0)
    assert np.isnan(data.difference["RRLR"])
    assert data.runs.to_dict() == {"": 3, "RRLR": 0, "RRRR": 2}


def test_files_are_the_same_every_time(study, tmp_path):
    pd.testing.assert_frame_equal(bars(study).data, study.figures.plot("learned-reward").data)
    plot, again = (tasks_plot([load_task("ascending")]) for _ in range(2))
    first, second = save(plot, tmp_path / "a"), save(again, tmp_path / "b" / "deep")
    assert {path.suffix for path in first} == {*FORMATS, ".csv"}
    for one, two in zip(first, second, strict=True):
        assert one.read_bytes() == two.read_bytes(), one.name
        if one.suffix in (".pdf", ".svg"):
            assert not re.search(rb"CreationDate|dc:date", one.read_bytes())
    assert b"/FontFile2" in first[2].read_bytes()  # TrueType, embedded
    table = pd.read_csv(first[3])
    np.testing.assert_allclose(table.x, plot.data.x)


def test_files_that_cannot_be_written(study, tmp_path):
    plot = tasks_plot([load_task("ascending")])
    (tmp_path / "file").write_text("")
    with pytest.raises(CoarticError, match="cannot write to"):
        save(plot, tmp_path / "file")


def test_svg_for_a_page(kinds):
    """Figures together: every id once, every reference has its id, ink is the page's."""
    ids, references = [], []
    texts = [svg_text(plot) for plot in kinds]
    for plot, text in zip(kinds, texts, strict=True):
        root = ElementTree.fromstring(text)
        assert root.tag.endswith("svg")
        assert root.get("viewBox")
        assert root.get("width") is None
        assert root.get("height") is None
        assert root.get("aria-label") == plot.alt
        assert root.get("fill") == "currentColor"
        assert not re.search(r"<\?xml|<!DOCTYPE|<metadata|#000000|#ffffff|#fff\b|http://(?!www.w3)",
                             text)  # fmt: skip
        own = [element.get("id") for element in root.iter() if element.get("id")]
        assert all(name.startswith(f"{plot.id}-") for name in own)
        ids += own
        references += re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', text)
        assert len(text) < 400_000
    assert svg_text(kinds[0]) == texts[0]
    assert len(ids) == len(set(ids))
    assert {a or b for a, b in references} == set(ids)


def test_short_names_and_looks_tell_methods_apart():
    labels = list(KNOWN)
    assert len({short_name(label) for label in labels}) == len(labels)
    drawn = [name for name, row in KNOWN_METHODS.items() if row.look]
    assert len(set(looks(drawn).values())) == len(drawn)
    own = looks(f"own-{k}" for k in range(20))
    assert len(set(own.values())) == 20
    learner = "dual-process/EC4"
    assert looks(["mine", learner])[learner] == looks([learner])[learner]
    assert short_name("dual-process/EC4 noise_sd=0.02") == "EC4 (σ 0.02)"
    assert short_name("cma-es/every other_arm=still") == "CMA-ES (every, other arm still)"
    assert short_name("cma-es/bold epsilon=0.1") == "cma-es/bold (ε 0.1)"  # nobody of ours


def test_numbers():
    assert [amount(v) for v in (1e-4, 0.1, 1, 1000, 2.5e6, 0)] == [
        "100µ", "100m", "1", "1k", "2.5M", "0",
    ]  # fmt: skip
    assert number(-3.25, 1) == "−3.2"
    assert (on("#0072b2"), on("#e69f00")) == ("#fdfdfd", "#111111")


def test_variants_of_a_task_are_told_apart():
    task = load_task("ascending")
    moved = task.model_copy(update={"name": "ascending.goal2_0_1"})
    titles = [axes.get_title(loc="left").strip() for axes in tasks_plot([task, moved]).figure.axes]
    assert titles == ["ascending", "ascending.goal2_0_1"]
    assert tasks_plot([task]).figure.axes[0].get_title(loc="left").strip() == "Ascending"


def drawn(path):
    """Points of a path in absolute coordinates, with the commands that end there."""
    tokens = re.findall(r"[A-Za-z]|-?(?:\d+\.?\d*|\.\d+)", path)
    points, at, start, command, k = [], np.zeros(2), np.zeros(2), "", 0
    while k < len(tokens):
        if tokens[k].isalpha():
            command, k = tokens[k], k + 1
            if command in "zZ":
                at = start
                continue
        if command in "hv":
            at = at + np.array(
                [float(tokens[k]), 0.0] if command == "h" else [0.0, float(tokens[k])]
            )
            k += 1
        else:
            count = {"m": 1, "l": 1, "q": 2, "c": 3}[command.lower()]
            numbers = np.array(tokens[k : k + 2 * count], dtype=float).reshape(-1, 2)
            numbers = numbers + (at if command.islower() else 0)
            points += [tuple(p) for p in numbers[:-1]]
            at, k = numbers[-1], k + 2 * count
        if command in "mM":
            start = at
        points.append(tuple(at))
    return np.array(points)


@pytest.mark.parametrize("closed", ["", " z M -3.5 0.001 L 0 0.25"])
def test_relative_paths_draw_the_same(closed):
    rng = np.random.default_rng(3)
    places = rng.uniform(-400, 400, (90, 2))
    curve = " ".join(f"{x:.6f} {y:.6f}" for x, y in places[:18])
    for steps, some in ((100, places[:20]), (10, places)):
        path = "M " + " L ".join(f"{x:.6f} {y:.6f}" for x, y in some)
        path += (
            "".join(f" C {' '.join(curve.split()[6 * k : 6 * k + 6])}" for k in range(3)) + closed
        )
        ours = drawn(relative(path))
        assert np.abs(ours - drawn(path)).max() <= 0.5 / steps + 1e-9
        assert len(relative(path)) < 0.7 * len(path)


def test_points_on_a_straight_stretch_are_left_out():
    assert relative("M 0 0 L 1 0 L 2.5 0 L 2.5 3 L 2.5 3 L 0 3 z") == "M0 0h2.5v3h-2.5z"
    assert relative("M 0 0 L 2 0 L 1 0") == "M0 0h2-1"  # and back again


def test_compact_leaves_out_what_has_no_effect():
    text = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
        '<!-- words --><g id="figure_1"><g>\n<path id="mark" d="M 0 0 L 5.000001 0" '
        'style="stroke: #112233; stroke-width: 0.8"/></g>'
        '<use xlink:href="#mark" x="1.234567" y="2" '
        'style="fill: #445566; stroke: #112233"/></g></svg>'
    )
    found = compact(text)
    assert found == (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'
        '<path id="i1" d="M0 0h5" style="stroke:#112233;stroke-width:0.8"/>'
        '<use xlink:href="#i1" x="1.23" y="2" style="fill:#445566"/></svg>'
    )


def test_titles_and_labels_are_within_the_picture(kinds):
    for plot in kinds:
        with rc_context(RC):
            _settle(plot.figure)
            renderer = FigureCanvasAgg(plot.figure).get_renderer()
            frame = plot.figure.bbox
            for axes in plot.figure.axes:
                for text in (axes._left_title, axes.xaxis.label, axes.yaxis.label):
                    if text.get_text():
                        box = text.get_window_extent(renderer)
                        assert box.x0 >= frame.x0 - 1, (plot.id, text)
                        assert box.x1 <= frame.x1 + 1, (plot.id, text)
                        assert box.y0 >= frame.y0 - 1, (plot.id, text)
                        assert box.y1 <= frame.y1 + 1, (plot.id, text)
