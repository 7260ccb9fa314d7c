"""Figures: what they show is what the runs say."""

import os
from dataclasses import replace
from threading import Thread

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from coartic import CoarticError, load_task
from coartic.analysis import FIGURES
from coartic.analysis.figures.drawings import picture_of_tasks
from coartic.analysis.figures.plot import FORMATS, Plot, for_page, picture
from coartic.analysis.methods import COLORS, KNOWN_METHODS, LOOKS_OF, MARKS, title_of
from coartic.analysis.optima import BestKnown
from coartic.internal.threads import environment
from coartic.pictures import drawing
from tests.support.figures import misplaced, texts_of
from tests.support.made_up import row, study_of
from tests.support.suites import KNOWN


@pytest.fixture(scope="module")
def few(shipped):
    """The shipped results with two runs of each method on each task, on which figures name the
    same methods as on all runs."""
    return replace(shipped, stored=shipped.stored[shipped.stored.run < 2])


def test_robots_and_goals_are_drawn_where_they_are():
    task, axes = load_task("two-armed-1"), Figure().add_subplot()
    circles = drawing.circle_goals(axes, task)
    drawing.fill_goals(circles, [True, False, False, False])
    assert [circle.get_fill() for circle in circles] == [True, False, False, False]
    assert [circle.center for circle in circles] == [*map(tuple, task.goals)]
    drawing.number_goals(axes, task)
    due = {str(k): (x, y + task.radius) for k, (x, y) in enumerate(task.goals, 1)}
    due["3"] = task.goals[2][0], task.goals[2][1] - task.radius  # goal 4 is close above
    assert {text.get_text(): text.xy for text in axes.texts} == due
    move = drawing.draw_robot(axes, task, task.q0)
    move(task.q0 + 1.0)
    for line, hand in zip(axes.lines, ("left", "right"), strict=True):
        due = task.robot.joint_positions(task.q0 + 1.0, hand)
        np.testing.assert_array_equal(line.get_xydata(), due)


def test_goals_of_a_picture_of_tasks_are_numbered_discs_that_do_not_overlap():
    """A disc is moved only if another one is close to it: goals 1 and 3 of two-armed task 1."""
    tasks = [load_task("descending"), load_task("two-armed-1")]
    panels = picture_of_tasks(tasks).axes
    for task, axes in zip(tasks, panels, strict=True):
        places = {
            int(text.get_text()): text.get_position() for text in axes.texts if text.get_text()
        }
        assert [*places] == [*range(1, 1 + len(task.goals))]
        discs = np.array([*places.values()])
        moved = {k for k, goal in enumerate(task.goals, 1) if not np.allclose(places[k], goal)}
        assert moved == (set() if task.name == "descending" else {1, 3})
        (line,) = (
            line for line in axes.lines if line.get_marker() == "o" and line.get_zorder() == 4
        )
        np.testing.assert_array_equal(line.get_xydata(), discs)
        to_points = 72 / axes.figure.dpi
        pixels = axes.transData.transform(discs)
        gaps = np.linalg.norm(pixels[:, None] - pixels, axis=2)[np.triu_indices(len(discs), 1)]
        assert to_points * gaps.min() > line.get_markersize()


def contrast(color):
    """With white, as WCAG 2 defines it."""
    parts = np.array(to_rgb(color))
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05)


@pytest.mark.parametrize(
    "name", [name for name in FIGURES if name not in ("contrasts", "gaps-by-family")]
)
def test_no_text_leaves_a_narrow_figure_or_lies_on_another(name, few):
    """Names beside rows, names at the ends of lines, a legend below panels, numbers in pictures."""
    plot = FIGURES[name](few, width=3.4)
    assert plot, (
        f"{name} draws nothing of suite comparison: leave it out here, and test it elsewhere"
    )
    texts = texts_of(plot.figure)
    assert misplaced(plot.figure) == ([], [])
    assert min(contrast(text.get_color()) for text in texts) > 4.5
    assert ("†" in plot.caption) == any("†" in text.get_text() for text in texts)
    assert plot.figure.get_figwidth() == 3.4
    assert plot.figure.get_figheight() < 4.01
    assert plot.id == name
    assert all(map(len, (plot.alt, plot.caption, plot.data)))


@pytest.mark.parametrize("name", ["ranking", "shared-goal", "runtimes", "learning-curves"])
def test_colour_and_marker_say_which_information_a_method_uses(name, few):
    """In each figure by the same code; no two groups share a colour or a marker."""
    colors = {COLORS[color]: group for group, (of, _) in LOOKS_OF.items() for color in of}
    marks = {MARKS[mark][0]: group for group, (_, of) in LOOKS_OF.items() for mark in of}
    assert len(colors) == sum(len(of) for of, _ in LOOKS_OF.values())
    assert len(marks) == sum(len(of) for _, of in LOOKS_OF.values())
    plot = FIGURES[name](few)
    drawn = {
        (colors[line.get_color()], marks[line.get_marker()])
        for axes in plot.figure.axes for line in axes.lines if line.get_marker() in marks
    }  # fmt: skip
    assert drawn == {(group, group) for group in few.methods.information[plot.data.method]}
    assert name != "learning-curves" or "policy-gradient" in {*plot.data.method}


def ends_drawn(figure):
    """The coordinates of all lines, bands and marks of a figure."""
    parts = [line.get_xydata() for axes in figure.axes for line in axes.lines]
    for axes in figure.axes:
        parts += [path.vertices for each in axes.collections for path in each.get_paths()]
    return np.concatenate([np.ravel(np.asarray(part, float)) for part in parts])


INTERVALS = {
    "ranking": (["gap"], 100.0),
    "shared-goal": (["distance", "lean", "lean_base", "lean_joints"], 1.0),
    "runtimes": (["share"], 100.0),
    "learning-curves": (["best"], 1.0),
    "gaps-by-family": (["mean"], 1.0),
}
"""Columns with intervals, by figure, and the factor by which they are drawn."""


@pytest.mark.parametrize("name", INTERVALS)
def test_intervals_are_drawn(name, shipped):
    study = shipped
    if name == "gaps-by-family":
        rewards = np.random.default_rng(0).integers(-450, -310, 20).tolist()
        tasks = [f"two-armed/v1/i{number:03}" for number in range(20)]
        runs = [row("mine", of, task=task) for task, of in zip(tasks, rewards, strict=True)]
        study = study_of(runs, optima=dict.fromkeys(tasks, BestKnown(-300, -300)))
    plot, (columns, factor) = FIGURES[name](study), INTERVALS[name]
    ends = plot.data[[f"{column}{end}" for column in columns for end in ("_low", "_high")]]
    due = factor * ends.dropna().to_numpy(float).ravel()
    assert len(due) > 0
    drawn = np.sort(ends_drawn(plot.figure))
    nearest = drawn[np.searchsorted(drawn, due - 1e-9).clip(max=len(drawn) - 1)]
    np.testing.assert_allclose(nearest, due, rtol=0, atol=1e-8)


def test_intervals_of_ticks_saved_are_drawn_to_scale(shipped):
    plot = FIGURES["saved"](shipped)
    for axes, (_, part) in zip(
        plot.figure.axes, plot.data.groupby("task", sort=False), strict=True
    ):
        names = [name for name in part if name.endswith("_low")]
        low, high = (
            part[[n[:-4] + end for n in names]].to_numpy(float) for end in ("_low", "_high")
        )
        paths = [path.vertices for each in axes.collections for path in each.get_paths()]
        segments = [y for x, y in (path.T for path in paths) if np.ptp(x) == 0]  # not a row's line
        lengths, due = (
            np.sort(ends[~np.isnan(ends)]) for ends in (np.ptp(segments, 1), high - low)
        )
        assert lengths[-1] > 0.0
        np.testing.assert_allclose(lengths / lengths[-1], due / due[-1], atol=1e-9)


def test_a_figure_has_chosen_style(tmp_path):
    study = study_of([row("mine", -300, task="ascending")])
    plot = FIGURES["ranking"](study, style={"axes.labelsize": 20.0})
    assert plot.figure.axes[0].xaxis.label.get_fontsize() == 20.0
    plot.save(tmp_path / "mine.svg")
    assert "<svg" in (tmp_path / "mine.svg").read_text("utf-8")
    with pytest.raises(CoarticError, match=r"'\.doc'; it must be one of \.svg, \.pdf, \.png"):
        plot.save(tmp_path / "mine.doc")


def test_names_and_looks_tell_methods_apart():
    """The same looks whatever methods from files are there, whose colour no other method has."""
    assert len({title_of(method) for method in KNOWN}) == len(KNOWN)
    alone, both = (
        study_of([row(method, -300, task="ascending") for method in methods]).methods["style"]
        for methods in ([*KNOWN_METHODS], ["mine", *KNOWN_METHODS, "theirs"])
    )
    single = [label for label in both.index if not label.startswith("dual-process (")]
    assert len({*both[single]}) == len(single)
    assert both[[*alone.index]].equals(alone)
    own = {color for color, _ in both[["mine", "theirs"]]}
    assert len(own) == 1
    assert not own & {color for color, _ in alone}


def test_figures_are_written_one_after_the_other():
    """Also in threads: they change the environment of the process."""
    seen = []

    def write():
        with environment({"COARTIC_TEST": "2"}):
            seen.append(os.environ["COARTIC_TEST"])

    other = Thread(target=write)
    with environment({"COARTIC_TEST": "1"}):
        other.start()
        other.join(0.2)
        assert (seen, os.environ["COARTIC_TEST"]) == ([], "1")
    other.join()
    assert (seen, "COARTIC_TEST" in os.environ) == (["2"], False)


def test_a_picture_leaves_its_figure_as_it_was_and_has_no_date(monkeypatch):
    figure = Figure(layout="constrained")
    axes = figure.add_subplot()
    axes.plot([1, 2], "o")
    axes.set_axis_off()  # letters and ticks take long to draw
    plot = Plot("dots", "", "", "", figure, pd.DataFrame())

    def pictures():
        return [*(picture(figure, ending) for ending in FORMATS), for_page(plot)]

    before = figure.canvas, figure.get_layout_engine()
    drawn = pictures()
    assert (figure.canvas, figure.get_layout_engine()) == before
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "no number")
    assert pictures() == drawn
