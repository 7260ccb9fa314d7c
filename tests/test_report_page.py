"""The page in a real browser: Chromium, driven by Playwright."""

from functools import partial

import pytest

from coartic.analysis.control import shared_goal
from coartic.analysis.study import solved, typical_run

pytestmark = pytest.mark.browser


@pytest.fixture
def opened(visited, report):
    """Opens the page; what it logs, throws or asks the network for fails the test."""
    return partial(visited, (report / "report.html").as_uri())


OPEN_ALL = """document.querySelectorAll("details").forEach((each) => { each.open = true; })"""


def test_tables_are_searched_sorted_and_unfolded(opened):
    page = opened()
    # A table that is folded opens for a link to a cell, and is sorted by its headers.
    table = page.locator("#T_methods")
    assert not table.is_visible()
    page.goto(f"{page.url}#T_methods")
    assert table.is_visible()

    def rows():
        """Cells of each row in sight."""
        rows = table.locator("tbody tr:visible").all()
        return [row.locator("td").all_inner_texts() for row in rows]

    place = table.locator("thead th").all_inner_texts().index("reward ± SD")
    rewards = [float(row[place].split()[0].replace("−", "-")) for row in rows()]
    for ordered in (sorted(rewards), sorted(rewards, reverse=True)):
        table.locator("thead button", has_text="reward").first.click()
        shown = [float(row[place].split()[0].replace("−", "-")) for row in rows()]
        assert shown == ordered
    before = rows()
    page.fill("#methods-search", "learner ascending")
    after = rows()
    assert 0 < len(after) < len(before)
    assert all("Ascending" in row and "learner" in " ".join(row) for row in after)
    page.fill("#methods-search", "")
    assert rows() == before


def part(page, name):
    """A part of the figure to play with."""
    return page.locator(f".play [data-is={name}]")


def test_the_figure_shows_the_folders_own_runs_until_a_goal_is_moved(opened, traced):
    from playwright.sync_api import expect

    page = opened(reduced_motion="reduce")
    shared = shared_goal(traced)
    difference = f"{float(f'{shared.posture_difference:.2f}'):g}"
    said = page.locator(".play .beside")
    said.get_by_text(f"posture difference is {difference} ").first.wait_for()
    page.get_by_text("Try more").click()
    tasks = {task.label: name for name, task in traced.tasks.items()}
    options = part(page, "preset").locator("option").all_inner_texts()[1:]
    assert len(options) == 3
    for preset, text in enumerate(options, 1):
        part(page, "preset").select_option(str(preset))
        stored = part(page, "stored").locator("option:not([value=''])")
        label = stored.first.get_attribute("value")
        part(page, "stored").select_option(label)
        good = solved(traced.cells[tasks[text.removesuffix(" †")], label])
        median = good.set_index("run_id").reward[typical_run(good)]
        expect(part(page, "score")).to_contain_text(f" {-median:.0f} ticks")
    page.get_by_role("button", name="Goal 2").focus()
    page.keyboard.press("ArrowUp")
    expect(page.get_by_role("radio", name="A learner")).to_be_checked()
    part(page, "play").press("Tab")
    expect(part(page, "stored")).to_have_value("")
    expect(part(page, "score")).to_contain_text("The learner")


def test_nothing_scrolls_sideways_and_all_is_accessible(opened):
    """On a phone the panels of a figure are drawn one by one, instead of side by side."""
    from axe_playwright_python.sync_playwright import Axe

    page = opened(reduced_motion="reduce")
    page.evaluate(OPEN_ALL)
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for name, seen in (("wide", width > 390), ("narrow", width == 390)):
            drawn = page.locator(f"#figure-saved .{name}").all()
            assert [each.is_visible() for each in drawn] == [seen] * len(drawn) != []
    # Rows of a table are alike: two of each. Pictures count by their labels alone.
    alike = "tbody tr:nth-child(n+3), svg > :not(:has(a))"
    page.eval_on_selector_all(alike, "all => all.forEach(each => each.remove())")
    rules = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"], "resultTypes": ["violations"]}
    for width, scheme in ((390, "dark"), (1280, "light")):
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme)
        accessibility = Axe().run(page, options=rules)
        assert accessibility.violations_count == 0, accessibility.generate_report()
