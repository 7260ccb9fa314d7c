"""The page of ``coartic play`` in a real browser: what it says is what the package finds."""

import re
import struct
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from coartic import CONDITIONS, Movement, Task, corrective_trial, execute, learn, load_task
from coartic.analysis import solutions_of
from coartic.analysis.signatures import standardised_posture_difference
from coartic.motion.solution import hand_sequences, initial_hands
from coartic.play import page as pages
from tests.support.strategies import changed, metres_task

pytestmark = pytest.mark.browser


TRIALS = 30  # of 10,000 that the page makes, as tests see the same in fewer


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    file = tmp_path_factory.mktemp("play") / "play.html"
    html = pages.play_page().replace("TRIALS = 10000;", f"TRIALS = {TRIALS};")
    file.write_text(html, encoding="utf-8")
    return file.as_uri()


@pytest.fixture
def opened_task(visited, tmp_path):
    """Opens the page of a task, with so many trials and other changes of its code."""

    def open_page(task=None, trials=600, changes=()):
        html = pages.play_page(*[task] if task else [])
        for old, new in (("TRIALS = 10000;", f"TRIALS = {trials};"), *changes):
            html = html.replace(old, new)
        file = tmp_path / "play.html"
        file.write_text(html, encoding="utf-8")
        return settled(visited(f"{file.as_uri()}#open=1", reduced_motion="reduce"))

    return open_page


@pytest.fixture
def opened(visited, address):
    """The page in a state; it is loaded once, and stays."""

    def open_page(state="", width=1280, **options):
        options = {"reduced_motion": "reduce", "stays": True, **options}
        return visited(f"{address}#open=1&{state}", width, **options)

    return open_page


SIDES = (("x", "width"), ("y", "height"))
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def text(page, name):
    return page.locator(f"[data-is={name}]").inner_text()


def ticks(page, who):
    """What the page says that somebody needs."""
    (found,) = re.findall(rf"{who} (\d+) ticks", text(page, "score"))
    return int(found)


def press(page, name):
    page.get_by_role("button", name=name).click()
    page.evaluate(DRAWN)


def choose(page, name):
    page.get_by_role("radio", name=name).check()
    return settled(page)


def slide(page, name, value):
    page.get_by_role("slider", name=name).fill(str(value))
    page.evaluate(DRAWN)


def drag(page, handle, across, down):
    """By the pointer, from its middle by so many pixels."""
    box = handle.bounding_box()
    x, y = (box[axis] + box[size] / 2 for axis, size in SIDES)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + across, y + down, steps=2)
    page.mouse.up()


def settled(page):
    """Wait until nothing is to come."""
    page.evaluate(DRAWN)
    page.wait_for_selector(".play[data-settled]")
    return page


STATE = """() => [...document.querySelectorAll('.play :is(select, input, .beside, .handle)')]
    .filter(each => each.checkVisibility())
    .map(each => [each.value, each.checked, each.innerText, each.ariaLabel])"""


def comes_back(page, anew=False):
    """Loaded anew, or by its link from another state, it is what it was: its address has all that
    it shows."""
    link, shown = page.url, settled(page).evaluate(STATE)
    if anew:
        page.reload()
    else:
        changed_to(page, "who=alone&preset=4")
        page.goto(link)
    assert settled(page).evaluate(STATE) == shown
    assert page.url == link


def changed_to(page, state):
    """Follow a link from the page to itself."""
    page.goto(f"{page.url.partition('#')[0]}#{state}")
    return settled(page)


def trials_made(page):
    return int(re.sub(r"\D", "", text(page, "progress").partition(",")[0]))


def test_it_is_one_small_file_without_addresses():
    html = pages.play_page()
    assert len(html.encode()) <= 300_000
    assert html.count("TRIALS = 10000;") == 1  # of which tests make fewer
    assert not re.findall(r"(?:src|href)=[\"'](?!data:)|url\(|@import", html)
    for name, label in (
        ("two-armed-2", "Two-armed 2 †"),
        ("long/v1/i000", load_task("long/v1/i000").label),
    ):
        own = pages.play_page(load_task(name))
        assert f'"presets":[{{"label":"{label}"' in own.replace("\\u2020", "†")


def median_of(runs):
    """Reward of the run that the page shows."""
    return sorted(run.reward for run in runs)[len(runs) // 2]


def learned(task, condition, trials=TRIALS):
    """Ticks that the learner needs, as the page should say."""
    return -median_of([learn(task, condition, seed=seed, trials=trials) for seed in range(5)])


def test_coarticulation_appears_with_practice(opened_task):
    page = opened_task()
    trials = trials_made(page)
    assert trials == 600  # on every machine
    postures = []  # at the goal that they share
    for role, name in zip(("Blue", "Orange"), pages.UP_OR_DOWN, strict=True):
        runs = [learn(name, "EC1", seed=seed, trials=trials) for seed in range(5)]
        assert ticks(page, role) == -median_of(runs)
        postures.append(np.array([run.execute().configurations[0] for run in runs]))
    learned = standardised_posture_difference(*postures)
    assert learned > 2
    words = f"the posture difference is {learned:.1f} standard deviations."
    assert words in text(page, "finding")
    assert "5 runs each)" in text(page, "meaning")
    # Earlier, by the slider, there was less of it.
    reset = page.get_by_role("button", name="Reset")
    assert reset.is_disabled()
    slide(page, "Practice", 1)
    assert "same posture" in text(page, "finding")
    reset.click()
    assert words in text(settled(page), "finding")
    assert reset.is_disabled()


def test_a_task_from_a_file_begins_with_the_hands_of_the_package(opened_task, tmp_path):
    file = tmp_path / "shelf.toml"
    goals = [(2.1, 3.6), (4.4, 3.6), (5.2, 0.55), (7.0, 3.6)]
    Task(name="shelf", goals=goals, initial_hands="best-single-hand").save(file)
    task = load_task(file)
    trials = 1000  # after which it is not as fast as the corrective process by chance
    page = opened_task(task, trials)
    spent = learned(task, "EC4", trials)
    assert ticks(page, "The learner") == spent
    best = max(hand_sequences(task), key=lambda hands: corrective_trial(task, hands).reward)
    alone = corrective_trial(task, best).reward
    assert ticks(page, "Corrective process alone") == -alone
    words = f"{-alone - spent} ticks fewer than the corrective process alone (best hands {best})."
    assert words in text(page, "finding")
    slide(page, "Practice", 0)
    assert ticks(page, "The learner") == -corrective_trial(task, initial_hands(task)).reward


def test_an_arm_in_metres_is_in_proportion(opened_task):
    task = metres_task(0.03)
    page = opened_task(task, 100, [("figure = new", "figure = window.player = new")])
    width, height = (page.evaluate(f"player.problems[0].robot.base_size[{k}]") for k in (0, 1))
    assert (width / 0.33, width / height) == (pytest.approx(1 / 4), pytest.approx(5))
    left, bottom, right, top = page.evaluate("player.box")
    assert right - left < 1.2
    assert top - bottom < 1.0
    assert page.evaluate("player.within([0.1234, 0.4567])") == [0.123, 0.457]
    before = page.evaluate("player.state.goals.length")
    press(page, "Add a goal")
    after = page.evaluate("player.state.goals")
    assert len(after) == before + 1
    assert all(abs(x) < 0.6 and abs(y) < 0.6 for x, y in after)


def test_a_moved_goal_is_answered_at_once_and_by_what_is_learned(opened):
    page = settled(opened("who=alone&preset=1&others="))
    assert ticks(page, r"Optimum \(proven\)") == 292
    handle = page.get_by_role("button", name="Goal 3, at")
    handle.focus()
    for _ in range(2):
        page.keyboard.press("ArrowDown")
    page.keyboard.press("Shift+ArrowLeft")
    task = changed("ascending", goals=[[6.0, 0.1], [6.0, 2.0], [5.98, 3.8]])
    page.wait_for_url("**goals=6,0.1;6,2;5.98,3.8*")
    assert ticks(settled(page), "Corrective process alone") == -corrective_trial(task, "RRR").reward
    assert "Optimum" not in text(page, "score")
    choose(page, "learner")
    assert trials_made(page) == TRIALS
    assert ticks(page, "The learner") == learned(task, "EC1")
    # By the pointer, too, and out of reach it says so.
    drag(page, handle, -100, 28)
    page.wait_for_url(re.compile(r"goals=6,0.1;6,2;(?!5.98)[45][.\d]*,[23]"))


def test_when_a_goal_moves_the_learner_repeats_its_posture_and_the_planner_does_not(opened):
    page = settled(opened("preset=1&others="))
    press(page, "Move goal 3 now")
    settled(page)
    task = changed("ascending", goals=[[6.0, 0.1], [6.0, 2.0], [5.0, 4.0]])
    practised = learn("ascending", "EC1", seed=0, trials=TRIALS).solution
    after, before = (execute(each, practised) for each in (task, "ascending"))
    assert np.array_equal(after.configurations[1], before.configurations[1])
    assert ticks(page, "The learner's next trial") == after.ticks > ticks(page, "The planner")
    shifts = re.findall(r"by (\d[.\d]*\b)", text(page, "finding"))
    assert shifts[0] == "0"
    assert float(shifts[1]) > 0.1
    comes_back(page)
    choose(page, "each movement")  # and it learns anew
    assert "Corrective process alone" in text(page, "score")


def test_postures_by_hand_have_their_true_score_and_are_in_the_link(opened):
    page = settled(opened("preset=3&who=you"))
    assert ticks(page, "You") == ticks(page, "Corrective process alone")
    assert "Optimum" not in text(page, "score")  # it is not proven
    handle = page.get_by_role("button", name="left arm, elbow 2")
    drag(page, handle, 20, 30)
    page.get_by_label("Place it at").select_option("2")
    page.get_by_label("hit by the").select_option("0")
    page.get_by_role("button", name="Box").focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowUp")  # it is on a rail
    postures = re.search(r"own=([^&]+)", settled(page).url)[1]
    movements = []
    for goal, row in enumerate(postures.split(";"), 1):
        hand, *joints = map(float, row.split(","))
        side = ("left", "right")[int(hand)]
        placed = np.array(joints) if joints else None
        movements.append(Movement(goal, side, "learned" if joints else "corrective", placed))
    assert [movement.kind for movement in movements] == ["learned"] * 2 + ["corrective"] * 2
    done = execute("two-armed-1", movements)
    assert done.hands == "LLLR"
    assert ticks(page, "You") == done.ticks
    with page.expect_download() as download:
        press(page, "Save your trials")
    trials = pd.read_csv(download.value.path())
    assert trials.trial.max() == 3  # a drag, a hand, a key; the other key moves nothing
    task = load_task("two-armed-1")
    last = solutions_of(task, trials).runs[-1]
    assert last.ticks_by_goal() == done.ticks_by_goal()
    assert np.allclose(last.configurations, done.configurations)
    comes_back(page)


def test_the_link_holds_the_whole_state(opened):
    page = settled(opened())
    assert "posture difference" in text(page, "finding")
    choose(page, "each movement")
    assert "same posture" in text(page, "finding")  # no coarticulation by such a reward
    page.get_by_label("Task").select_option("3")
    page.get_by_label("It explores").select_option("EC3")
    page.get_by_role("button", name="Goal 2").focus()
    page.keyboard.press("ArrowRight")
    settled(page)
    slide(page, "Practice", 800)
    slide(page, "Tick", 123)
    assert f"trials={trials_made(settled(page))}&" in page.url
    comes_back(page, anew=True)
    assert trials_made(changed_to(page, "trials=20")) == 20
    changed_to(page, "preset=3&explores=EC3&reward=movement&drift=1")
    condition = shown_condition(page)
    assert (condition.drift, condition.credit) == (1.0, "subtask")
    assert ticks(page, "The learner") == learned("two-armed-1", condition)
    # Entries that are no state are left out, and goals and joints far out lie nearer.
    changed_to(page, "preset=3&who=constructor&mate=__proto__&explores=constructor&__proto__=1")
    assert ticks(page, "The learner") > 0
    changed_to(page, "who=alone&preset=1&goals=60,0;6,-70,1;6,-70")
    assert page.get_by_role("button", name="Goal 1, at 12, 0.").count() == 1
    assert page.get_by_role("button", name="Goal 2, at 6, -12.").count() == 1


def shown_condition(page):
    """The learner's condition, by the Python that the page shows for it."""
    code = page.locator("[data-is=python]").text_content()
    return eval(code, {"CONDITIONS": CONDITIONS, "replace": replace})


def test_a_slider_leads_from_trial_and_error_to_planning(opened):
    page = settled(opened("preset=2&others=&trials=25"))
    dial = page.get_by_role("slider", name="How far exploration leans towards the next goal")
    by_drift = [ticks(page, "The learner")]
    dial.focus()
    for key, drift in (("ArrowRight", "0.03"), ("End", "1")):
        page.keyboard.press(key)
        by_drift.append(ticks(settled(page), "The learner"))
        assert f"drift={drift}&" in page.url
        assert drift in dial.get_attribute("aria-valuetext")
        assert text(page, "progress").endswith(f"drift {drift}")
    assert by_drift[0] >= by_drift[1] > by_drift[2]  # the same trials find better movements
    comes_back(page)
    page.get_by_label("Task").select_option("1")
    assert "drift=1" in settled(page).url
    choose(page, "planner")
    expect(dial).to_be_hidden()
    for nonsense in ("x", "0.2"):
        changed_to(page, f"preset=2&others=&trials=25&drift={nonsense}")
        assert shown_condition(page) == CONDITIONS["EC1"]
        assert ticks(page, "The learner") == by_drift[0]
    changed_to(page, "preset=2&others=&drift=1")
    press(page, "Reset")
    expect(dial).to_have_value("0")


def test_goals_come_apart_from_others_and_reset_takes_them_back(opened):
    page = settled(opened("who=alone"))
    task = page.get_by_label("Task").locator("option:checked")
    for _ in range(3):
        assert text(page, "why") == ""
        press(page, "Add a goal")
    assert text(page, "why") == "A task can have at most 6 goals here."
    labels = page.locator(".handle").evaluate_all("all => all.map(each => each.ariaLabel)")
    places = [re.search(r"at (\S+), (\S+)\. ", label).groups() for label in labels]
    places = np.array(places, dtype=float)
    assert len(places) == 11
    distances = np.linalg.norm(places[:, None] - places, axis=2) + 10 * np.eye(11)
    assert distances.min() >= 1
    assert "reach" not in text(page, "finding")
    expect(task).to_have_text("Up or down (changed)")
    press(page, "Reset")
    expect(task).to_have_text("Up or down")
    assert "both robots" in text(page, "lead")
    # A link to this file is of use with the file.
    press(page, "Copy link")
    page.get_by_text("only on this machine").get_by_text("send play.html").wait_for()


def test_on_a_phone_picture_slider_and_finding_come_first(visited, address):
    page = settled(visited(f"{address}#trials=1", 390, reduced_motion="reduce"))
    for width, height in ((390, 844), (844, 390)):
        page.set_viewport_size({"width": width, "height": height})
        assert "same posture" in text(page, "finding")
        assert text(page, "progress") == "1 trial"
        for part in (".stage", "[data-is=trials]", "[data-is=finding]"):
            box = page.locator(part).bounding_box()
            assert box["y"] + box["height"] <= height
    expect(page.get_by_label("Task")).to_be_hidden()
    page.get_by_text("Try more").click()
    expect(page.get_by_label("Task")).to_be_visible()


def test_it_practises_plays_and_saves_pictures(opened):
    page = opened("preset=1&others=&trials=10", reduced_motion="no-preference")
    page.get_by_role("button", name="Pause").wait_for()
    page.wait_for_function("document.querySelector('[data-is=tick]').value > 30")
    press(page, "Pause")
    expect(page.get_by_role("button", name="Pause")).to_have_count(0)
    slide(page, "Tick", 100)
    tick = page.get_by_role("slider", name="Tick")
    expect(tick).to_have_value("100")
    tick.press("ArrowRight")
    expect(page.get_by_text("102 of")).to_be_visible()
    size = page.locator("[data-is=stage]").evaluate(
        "stage => [stage.clientWidth, stage.clientHeight]"
    )
    with page.expect_download() as download:
        press(page, "Save PNG")
    png = download.value.path().read_bytes()
    assert png.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", png[16:24])
    assert width == 2 * size[0]
    assert height > 2 * size[1]  # words below


def test_nothing_scrolls_sideways_and_all_is_accessible(opened):
    page = opened()
    for width, scheme, state in (
        (1280, "light", "drift=0.03&reward=movement"), (390, "dark", "preset=4&who=you")
    ):  # fmt: skip
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme)
        changed_to(page, state)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        accessibility = Axe().run(page)
        assert accessibility.violations_count == 0, accessibility.generate_report()


def test_without_scripts_there_is_a_picture(page_without_scripts, address):
    page = page_without_scripts
    page.goto(address)
    assert page.locator(".still svg").is_visible()
    assert not page.locator(".stage").is_visible()
