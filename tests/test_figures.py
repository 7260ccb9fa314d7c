"""Figures: what they show is what the runs say."""

import re

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from coartic import CoarticError, load_task
from coartic.analysis import load
from coartic.analysis.figures.plot import FORMATS, Plot, for_page, picture
from coartic.analysis.methods import KNOWN_METHODS, title_of
from coartic.analysis.sections import FIGURES
from coartic.analysis.sections.ranking import name_in_figure
from coartic.pictures import drawing
from tests.support.figures import misplaced
from tests.support.made_up import row, study_of
from tests.support.suites import KNOWN, ROOT


@pytest.fixture(scope="module")
def shipped():
    return load("shipped")


def test_robots_and_goals_are_drawn_where_they_are():
    task, axes = load_task("two-armed-1"), Figure().add_subplot()
    circles = drawing.circle_goals(axes, task)
    drawing.fill_goals(circles, [True, False, False, False])
    assert [circle.get_fill() for circle in circles] == [True, False, False, False]
    assert [circle.center for circle in circles] == [*map(tuple, task.goals)]
    move = drawing.draw_robot(axes, task, task.q0)
    move(task.q0 + 1.0)
    for line, hand in zip(axes.lines, ("left", "right"), strict=True):
        due = task.robot.joint_positions(task.q0 + 1.0, hand)
        np.testing.assert_array_equal(line.get_xydata(), due)


def test_a_long_name_keeps_its_end(traced):
    for letters, name in ((44, 22 * "a" + 22 * "b"), (60, f"{22 * 'a'}…{21 * 'b'}")):
        assert name_in_figure(traced, letters // 2 * "a" + letters // 2 * "b") == name


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_leaves_a_figure_of_any_width_or_lies_on_another(name, shipped):
    for width in (None, 3.4):
        plot = FIGURES[name](shipped, width=width)
        if plot is None and name == "gaps-by-family":
            pytest.skip("the shipped results have no such figure")
        assert misplaced(plot.figure) == ([], []), width
        assert (plot.figure.get_figwidth() == width) == bool(width)
        assert plot.id == name
        assert all(map(len, (plot.alt, plot.caption, plot.data)))


def test_a_figure_has_chosen_methods_tasks_and_style(shipped, tmp_path):
    chosen = {"methods": ["cma-es/bandit", "dual-process (EC1, EC4)"], "tasks": ["ascending"]}
    plot = FIGURES["ranking"](shipped, style={"axes.labelsize": 20.0}, **chosen)
    every = FIGURES["ranking"](shipped, tasks=["ascending"])
    assert plot.data.method.tolist() == ["cma-es/bandit", "dual-process/EC1"]
    gaps = every.data.set_index("method").gap
    assert plot.data.gap.tolist() == gaps[plot.data.method].tolist()
    assert plot.figure.axes[0].xaxis.label.get_fontsize() == 20.0
    plot.save(tmp_path / "mine.pdf")
    assert (tmp_path / "mine.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(CoarticError, match=r"ends in \.svg, \.pdf, \.png; not in '\.doc'"):
        plot.save(tmp_path / "mine.doc")
    with pytest.raises(CoarticError, match="unknown method 'cma-es/bandits'.*cma-es/bandit"):
        FIGURES["ranking"](shipped, methods=["cma-es/bandits"])


def test_the_gallery_shows_every_figure():
    shown = re.findall(r'FIGURES\["([^"]+)"\]', (ROOT / "docs" / "gallery.md").read_text("utf-8"))
    assert sorted(shown) == sorted(FIGURES)


def test_names_and_looks_tell_methods_apart():
    """The same looks whatever methods from files are there, which are brown."""
    assert len({title_of(method) for method in KNOWN}) == len(KNOWN)
    fixed = [method for method, known in KNOWN_METHODS.items() if known.look]
    alone, both = (
        study_of([row(method, -300, task="ascending") for method in methods]).methods.look
        for methods in ([*KNOWN_METHODS], ["mine", *KNOWN_METHODS, "theirs"])
    )
    assert len({*alone[fixed]}) == len(fixed)
    assert both[[*KNOWN_METHODS]].equals(alone)
    brown = {color for color, _ in both[["mine", "theirs"]]}
    assert brown == {"brown"}
    assert not brown & {color for color, _ in alone}
    assert both["mine"] != both["theirs"]


def test_a_picture_leaves_its_figure_as_it_was_and_has_no_date(monkeypatch):
    figure = Figure(layout="constrained")
    figure.add_subplot()
    plot = Plot("empty", "", "", "", figure, pd.DataFrame())

    def pictures():
        return [*(picture(figure, ending) for ending in FORMATS), for_page(plot)]

    before = figure.canvas, figure.get_layout_engine()
    drawn = pictures()
    assert (figure.canvas, figure.get_layout_engine()) == before
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "no number")
    assert pictures() == drawn
