"""Figures: what they show is what the runs say."""

import html
import itertools
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from coartic import CoarticError, load_task
from coartic.analysis import FIGURES, load
from coartic.analysis.figures.plot import FORMATS, Plot, for_page, picture
from coartic.analysis.figures.style import means, tip
from coartic.analysis.methods import COLORS, KNOWN_METHODS, title_of
from coartic.analysis.report.sections import SECTIONS, finding
from coartic.pictures import drawing
from tests.support.figures import misplaced, texts_of
from tests.support.made_up import row, study_of
from tests.support.suites import KNOWN, ROOT


@pytest.fixture(scope="module")
def shipped():
    """The shipped results with five runs of each method on each task, on which figures and
    sentences name the same methods as on all runs."""
    study = load("shipped")
    return replace(study, stored=study.stored[study.stored.run < 5])


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


@pytest.mark.parametrize("width", [None, 3.4])
def test_a_long_name_is_whole(width):
    long = "mine, " + 5 * "with a name that goes on and on, "
    study = study_of([row(name, -300, task="ascending") for name in (long, "hill-climbing")])
    figure = FIGURES["ranking"](study, width=width).figure
    assert misplaced(figure) == ([], [])
    words = " ".join(label.get_text() for label in figure.axes[0].get_yticklabels())
    assert long.strip() in words.replace("\n", " ")


def test_means_refuse_text_in_the_ends_of_intervals():
    frame = pd.DataFrame({"h": [0, 1], "gap": [0.2, 0.1], "gap_low": ["0", ""], "gap_high": 0.3})
    for wrong in (frame, frame.assign(gap_low=0.1).drop(columns="gap_high")):
        with pytest.raises(CoarticError, match="gap_"):
            means(Figure().add_subplot(), wrong, x="h", y="gap")


def test_short_names_fit_and_differ():
    short = [title_of(method, short=True) for method in KNOWN_METHODS]
    assert len({*short}) == len(short)
    assert max(map(len, short)) <= 22


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_leaves_a_figure_of_any_width_or_lies_on_another(name, shipped):
    for width in (None, 3.4):
        plot = FIGURES[name](shipped, width=width)
        if plot is None and name == "gaps-by-family":
            pytest.skip("the shipped results have no such figure")
        assert misplaced(plot.figure) == ([], []), width
        light = [lightness(to_hex(text.get_color()), np.eye(3)) for text in texts_of(plot.figure)]
        assert max(light) < 49.9  # a contrast of 4.5 : 1 with white
        assert ("†" in plot.caption) == any(
            "†" in each.get_text() for each in texts_of(plot.figure)
        )
        assert (plot.figure.get_figwidth() == width) == bool(width)
        assert width is None or plot.figure.get_figheight() < 4.01
        assert plot.id == name
        assert all(map(len, (plot.alt, plot.caption, plot.data)))


@pytest.mark.parametrize(
    ("method", "task", "named"),
    [
        ("dual-process/EC1", "ascending", ["learner (diamonds)"]),
        ("mine", "ascending", ["methods from files"]),
        ("cma-es/bandit", "two-armed-1", ["†"]),
    ],
)
def test_a_caption_names_what_its_figure_shows(method, task, named):
    caption = FIGURES["ranking"](study_of([row(method, -500, task=task)])).caption
    absent = "learner (diamonds)", "methods from files", "all tasks", "†"
    assert [words for words in absent if words in caption] == named


def test_a_figure_has_chosen_style(shipped, tmp_path):
    plot = FIGURES["ranking"](shipped, style={"axes.labelsize": 20.0})
    assert plot.figure.axes[0].xaxis.label.get_fontsize() == 20.0
    plot.save(tmp_path / "mine.pdf")
    assert (tmp_path / "mine.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(CoarticError, match=r"ends in \.svg, \.pdf, \.png; not in '\.doc'"):
        plot.save(tmp_path / "mine.doc")


def test_the_gallery_shows_every_figure():
    shown = re.findall(r'FIGURES\["([^"]+)"\]', (ROOT / "docs" / "gallery.md").read_text("utf-8"))
    assert sorted(shown) == sorted(FIGURES)


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


def lightness(color, seen):
    """L* of CIELAB of a colour ``#rrggbb`` as somebody sees it."""
    parts = np.array([int(color[place : place + 2], 16) / 255 for place in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    y = np.clip(seen @ linear, 0, 1) @ [0.2126, 0.7152, 0.0722]
    return 116 * np.cbrt(y) - 16 if y > 0.008856 else 903.3 * y


# Machado, Oliveira & Fernandes (2009), IEEE TVCG 15, table 1, severity 1.0, of linear RGB.
SEEN = np.array([
    np.eye(3),
    [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
     [-0.003882, -0.048116, 1.051998]],
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
     [-0.011820, 0.042940, 0.968881]],
])  # fmt: skip
"""In full colour, with protanopia and with deuteranopia."""


def test_methods_that_a_sentence_compares_differ_in_lightness_and_mark(shipped):
    own = study_of([row("mine", -300, task="ascending")]).methods.look["mine"]
    titles, looks = shipped.methods.title, shipped.methods.look
    css = (ROOT / "analysis" / "report" / "page.css").read_text("utf-8").partition("(prefers-")[2]
    dark = dict(re.findall(r"--(\w+): (#\w{6})", css))
    compared = 0
    for section in SECTIONS:
        for words in finding(shipped, section):
            named, words = [own], words.replace("from the corrective process alone", "")
            for label in titles.sort_values(key=lambda each: -each.str.len(), kind="stable").index:
                if titles[label] in words:
                    words = words.replace(titles[label], "")
                    named.append(looks[label])
            for one, other in itertools.combinations(named, 2):
                assert one[0] != other[0]
                assert one[1] != other[1]
                for colors, seen in itertools.product((COLORS, dark), SEEN):
                    pair = (lightness(colors[name], seen) for name, _ in (one, other))
                    assert abs(np.subtract(*pair)) >= 10, (words, one, other)
                compared += 1
    assert compared > 10


@pytest.mark.parametrize("text", ["mine: 1 %", 'the "best", it\'s said', "a < b & c"])
def test_a_page_shows_the_text_of_a_mark(text):
    drawing = Figure()
    (dot,) = drawing.subplots().plot([1], [1], marker="o")
    tip(dot, text)
    page = for_page(Plot("one", "", "", "", drawing, pd.DataFrame()))
    shown = re.findall("<title>(.*?)</title>", page)
    assert [html.unescape(each) for each in shown] == [text]


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
