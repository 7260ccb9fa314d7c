"""Figures: what they show is what the runs say."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from coartic import CoarticError, load_task
from coartic.analysis import FIGURES
from coartic.analysis.figures.plot import FORMATS, Plot, for_page, picture
from coartic.analysis.methods import KNOWN_METHODS, title_of
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


def contrast(color):
    """With white, as WCAG 2 defines it."""
    parts = np.array(to_rgb(color))
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05)


@pytest.mark.parametrize("name", [name for name in FIGURES if name != "gaps-by-family"])
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


def test_a_figure_has_chosen_style(tmp_path):
    study = study_of([row("mine", -300, task="ascending")])
    plot = FIGURES["ranking"](study, style={"axes.labelsize": 20.0})
    assert plot.figure.axes[0].xaxis.label.get_fontsize() == 20.0
    plot.save(tmp_path / "mine.svg")
    assert "<svg" in (tmp_path / "mine.svg").read_text("utf-8")
    with pytest.raises(CoarticError, match=r"\.svg, \.pdf, \.png, not in '\.doc'"):
        plot.save(tmp_path / "mine.doc")


def test_names_and_looks_tell_methods_apart():
    """The same looks whatever methods from files are there, whose colour no other method has."""
    assert len({title_of(method) for method in KNOWN}) == len(KNOWN)
    alone, both = (
        study_of([row(method, -300, task="ascending") for method in methods]).methods.look
        for methods in ([*KNOWN_METHODS], ["mine", *KNOWN_METHODS, "theirs"])
    )
    single = [label for label in both.index if not label.startswith("dual-process (")]
    assert len({*both[single]}) == len(single)
    assert both[[*alone.index]].equals(alone)
    own = {color for color, _ in both[["mine", "theirs"]]}
    assert len(own) == 1
    assert not own & {color for color, _ in alone}


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
