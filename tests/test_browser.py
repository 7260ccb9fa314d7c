"""The page in a real browser: Chromium, driven by Playwright."""

import re

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

from coartic import load_task


@pytest.fixture(scope="module")
def address(report):
    """Of the page."""
    return (report / "report.html").as_uri()


@pytest.fixture
def opened(visited, address):
    """Opens the page; what it logs, throws or asks the network for fails the test."""

    def open_page(width=1280, link=address, **options):
        return visited(link, width, **options)

    return open_page


IN_SIGHT = """rows => rows.filter(row => row.checkVisibility())
    .map(row => [row.textContent.toLowerCase(), row.children[1].innerText])"""


def claims_in_sight(page):
    """All text of each claim, and its verdict."""
    return page.eval_on_selector_all("#table-claims tbody tr", IN_SIGHT)


def test_tables_are_searched_filtered_sorted_and_unfolded(opened, address):
    page = opened()
    before = claims_in_sight(page)
    page.fill("#claims-search", "first movement")
    after = claims_in_sight(page)
    assert 0 < len(after) < len(before)
    assert all(word in text for text, _ in after for word in ("first", "movement"))
    page.fill("#claims-search", "")
    page.select_option("#claims-verdict", "undecided")
    chosen = claims_in_sight(page)
    assert 0 < len(chosen) < len(before)
    assert {verdict.removesuffix(" (not counted)") for _, verdict in chosen} == {"undecided"}
    page.select_option("#claims-verdict", "")
    assert claims_in_sight(page) == before
    # Tables are sorted by their headers.
    head = page.locator("#table-methods thead button", has_text="reward").first
    column = page.locator("#table-methods thead th").all_inner_texts()
    place = next(k for k, text in enumerate(column) if text.startswith("reward"))

    def values():
        cells = page.locator(f"#table-methods tbody tr td:nth-child({place + 1})")
        return [float(text.split()[0].replace("−", "-")) for text in cells.all_inner_texts()]

    for ordered in (sorted(values()), sorted(values(), reverse=True)):
        head.click()
        assert values() == ordered
    # A link to a claim unfolds it.
    claim = page.locator("#table-claims tbody tr").nth(3).get_attribute("id")
    page.goto(f"{address}#{claim}")
    assert page.locator(f"#{claim} dl").is_visible()


def tick(page):
    return int(page.locator(".player input[type=range]").input_value())


def test_the_player_plays_by_keyboard_and_shows_the_robot_where_the_run_ended(opened, traced):
    page = opened(reduced_motion="reduce")
    play = page.locator(".player .play")
    slider = page.locator(".player input[type=range]")
    slider.fill("0")
    play.focus()
    page.keyboard.press("Space")
    assert play.inner_text() == "Pause"
    page.wait_for_function("document.querySelector('.player input[type=range]').value > 20")
    page.keyboard.press("Space")
    assert play.inner_text() == "Play"
    stopped = tick(page)
    page.wait_for_timeout(300)
    assert tick(page) == stopped
    page.keyboard.press("Tab")  # one tick back
    page.keyboard.press("Enter")
    assert tick(page) == stopped - 1
    page.keyboard.press("Tab")  # one tick on
    page.keyboard.press("Enter")
    assert tick(page) == stopped
    page.keyboard.press("Tab")  # the slider
    page.keyboard.press("End")
    assert "all goals hit" in page.locator(".player .facts").first.inner_text()
    # The hand that is drawn is the robot module's, by the stored configuration.
    arms = page.locator(".player .arm.right").all()
    goals = page.locator(".player .goal").all()
    task = load_task("ascending")
    ends = []
    for task_name in ("ascending", "descending"):
        cell = traced.trajectories(task_name, "dual-process/EC1")
        ends += [
            task.robot.forward_kinematics(run.execution.configurations[-1], "right")
            for run in cell.runs
        ]
    assert arms
    for arm in arms:
        x, y = map(float, arm.get_attribute("points").split()[-1].split(","))
        drawn = np.array([x, -y])
        assert min(np.linalg.norm(drawn - end) for end in ends) < 2e-3  # the page rounds
        centres = [
            [float(goal.get_attribute("cx")), -float(goal.get_attribute("cy"))] for goal in goals
        ]
        assert min(np.linalg.norm(drawn - centre) for centre in centres) < task.radius + 2e-3


def place(page):
    """The chosen position of the goal that moves, and where the slider says that the bases are."""
    slider = page.locator("#next-goal-place")
    heights = re.findall(r"base at height (\S+)\.", slider.get_attribute("aria-valuetext"))
    return int(slider.input_value()), *map(float, heights)


def centre(page):
    """Of the handle in the second picture."""
    box = page.locator(".touch .handle:visible").nth(1).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.parametrize(("moved", "least"), [(2, 0.05), (3, 0.3)])
def test_the_next_goal_moves_by_keyboard_and_pointer_and_only_what_is_learned_follows(
    opened, moved, least
):
    page = opened()
    page.select_option("#next-goal-moved", str(moved))
    page.locator("#next-goal-place").focus()
    page.keyboard.press("Home")
    seen = [place(page)]
    for _ in range(5):
        page.keyboard.press("ArrowRight")
        seen.append(place(page))
        chosen = page.locator(".touch svg:visible .shown")
        assert chosen.count() == 2
        for goal, arm in zip(
            chosen.locator(".moved").all(), chosen.locator(".arm").all(), strict=True
        ):
            assert goal.is_visible()
            x, y = map(float, arm.get_attribute("points").split()[-1].split(","))
            aim = np.array(load_task("ascending").goals[moved - 2])
            assert np.linalg.norm([x, -y] - aim) < 0.1 + 2e-3  # the page rounds
    places, alone, learned = zip(*seen, strict=True)
    assert places == (0, 1, 2, 3, 4, 5)
    assert len(set(alone)) == 1
    assert learned == tuple(sorted(learned))
    assert learned[-1] > learned[0] + least
    # The pointer drags the goal down.
    page.mouse.move(*centre(page))
    page.mouse.down()
    page.mouse.move(0, 2000, steps=5)
    assert place(page) == seen[0]
    page.mouse.up()
    page.mouse.move(0, 0)
    assert place(page) == seen[0]


def test_the_next_goal_is_dragged_by_a_finger(opened):
    page = opened(390, has_touch=True, is_mobile=True)
    page.locator("#next-goal-place").fill("0")
    page.locator(".touch svg:visible").nth(1).scroll_into_view_if_needed()
    before = page.evaluate("scrollY")
    x, y = centre(page)
    finger = page.context.new_cdp_session(page)
    moves = [("touchStart", y), *(("touchMove", y - step) for step in range(5, 300, 5))]
    for kind, height in moves:
        points = [{"x": x, "y": height}]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert place(page)[0] == 5
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert page.evaluate("scrollY") == before  # the page did not scroll instead


STATE = """[...document.querySelectorAll("select[id], input[id]")].map(each => each.value)
    .concat([...document.querySelectorAll(".facts")].map(each => each.innerText))"""


def test_the_address_holds_the_view(opened, address):
    page = opened(reduced_motion="reduce")
    untouched = page.evaluate(STATE)
    assert page.url == address
    page.focus("#next-goal-moved")
    page.select_option("#next-goal-moved", "2")
    page.locator("#next-goal-place").fill("5")
    page.wait_for_url("**?next-goal-moved=2&next-goal-place=5#next-goal")
    # A link is not changed by what moves by itself, and by being scrolled to.
    moving = opened(link=page.url, reduced_motion="no-preference")
    moving.locator("#player").scroll_into_view_if_needed()
    moving.wait_for_function("Number(document.getElementById('player-tick').value) > 20")
    assert "player" not in moving.url
    page.focus("#player-view")
    page.select_option("#player-view", "own")
    page.select_option("#player-0", "ascending initial")
    page.select_option("#player-1", "two-armed-1 dual-process/EC4")
    page.locator("#player-tick").fill("57")
    page.get_by_label("One tick back").click()
    page.focus("#claims-verdict")
    page.select_option("#claims-verdict", "undecided")
    page.locator("#runtimes").scroll_into_view_if_needed()
    page.evaluate("document.getElementById('runtimes').scrollIntoView()")
    page.wait_for_url("**player-tick=56**#runtimes")
    again = opened(link=page.url, reduced_motion="no-preference")
    assert again.evaluate(STATE) == page.evaluate(STATE) != untouched
    again.wait_for_timeout(300)
    assert again.url == page.url
    top = "document.getElementById('runtimes').getBoundingClientRect().top"
    assert abs(again.evaluate(top)) < 2
    # Back at the beginning nothing is left of it.
    page.evaluate("scrollTo(0, 0)")
    page.select_option("#claims-verdict", "")
    page.select_option("#next-goal-moved", untouched[0])
    page.locator("#next-goal-place").fill(untouched[1])
    page.select_option("#player-view", "0")
    page.locator("#player-tick").fill(untouched[5])
    page.wait_for_url(address)
    # What an old link names and the page does not have is left out.
    odd = opened(link=f"{address}?player-0=nobody&player-tick=x&nothing=1", reduced_motion="reduce")
    assert odd.evaluate(STATE) == untouched


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_nothing_scrolls_sideways_and_all_is_accessible(opened, width, scheme):
    page = opened(width, color_scheme=scheme, reduced_motion="reduce")
    page.eval_on_selector_all("details", "all => all.forEach((each) => { each.open = true; })")
    page.locator(".player select").first.select_option("own")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    # Rows of a table are alike: three of each.
    page.eval_on_selector_all("tbody tr:nth-child(n+4)", "all => all.forEach(row => row.remove())")
    rules = {
        "runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"],
        "resultTypes": ["violations"],
    }
    accessibility = Axe().run(page, options=rules)
    assert accessibility.violations_count == 0, accessibility.generate_report()


def test_printing_shows_every_picture_once(opened):
    page = opened(color_scheme="dark")
    page.emulate_media(media="print")
    figures = page.locator("figure").all()
    assert figures
    for figure in figures:
        assert [svg.is_visible() for svg in figure.locator("svg").all()] == [True]
    ids = [figure.get_attribute("id") for figure in figures]
    assert len(ids) == len(set(ids))
    ink = page.evaluate("getComputedStyle(document.body).color")
    assert max(map(int, re.findall(r"\d+", ink))) < 80  # dark on white


def test_without_scripts_all_is_there(browser, address):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(address)
    assert page.locator(".without").is_visible()
    assert page.locator("#table-claims tbody tr").count() > 10
    # Both ends of the way of the goal are drawn, for both goals and methods.
    assert not page.locator("#next-goal-place").is_visible()
    assert [goal.is_visible() for goal in page.locator(".touch .moved").all()].count(True) == 8
    assert not page.locator("#claims-search").is_visible()
    context.close()
