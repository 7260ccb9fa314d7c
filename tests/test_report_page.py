"""The page in a real browser: Chromium, driven by Playwright."""

import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from coartic.analysis.control import shared_goal
from coartic.analysis.study import solved, typical_run

pytestmark = pytest.mark.browser


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


def rows_in_sight(page):
    """All text of each row of the table of methods, and its second cell."""
    return page.eval_on_selector_all("#T_methods tbody tr", IN_SIGHT)


def test_tables_are_searched_sorted_and_unfolded(opened, address):
    page = opened()
    # A table that is folded opens for a link to a cell, and is sorted by its headers.
    assert not page.locator("#T_methods").is_visible()
    page.goto(f"{address}#T_methods_row2_col0")
    assert page.locator("#T_methods_row2_col0").is_visible()
    head = page.locator("#T_methods thead button", has_text="reward").first
    column = page.locator("#T_methods thead th").all_inner_texts()
    place = next(k for k, text in enumerate(column) if text.startswith("reward"))

    def values():
        cells = page.locator(f"#T_methods tbody tr td:nth-child({place + 1})")
        return [float(text.split()[0].replace("−", "-")) for text in cells.all_inner_texts()]

    for ordered in (sorted(values()), sorted(values(), reverse=True)):
        head.click()
        assert values() == ordered
    before = rows_in_sight(page)
    page.fill("#methods-search", "learner ascending")
    after = rows_in_sight(page)
    assert 0 < len(after) < len(before)
    assert all(word in text for text, _ in after for word in ("learner", "ascending"))
    page.fill("#methods-search", "")
    assert rows_in_sight(page) == before


def test_a_table_is_copied_for_a_spreadsheet(opened):
    page = opened()
    page.eval_on_selector_all("details", "all => all.forEach((each) => { each.open = true; })")
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    for row, text in enumerate(("=1", "-x", "@x", "−1.5")):
        cell = page.locator("#T_methods tbody tr").nth(row).locator("td").first
        cell.evaluate("(cell, text) => { cell.textContent = text; }", text)
    page.locator("#T_methods").locator("xpath=../preceding-sibling::p[1]/button").click()
    page.get_by_text("rows are in the clipboard").wait_for()
    lines = page.evaluate("navigator.clipboard.readText()").split("\n")
    rows = [line.split("\t") for line in lines]
    assert [row[0] for row in rows[1:5]] == ["'=1", "'-x", "'@x", "-1.5"]
    assert rows[0][1].startswith("method")


def part(page, name):
    """A part of the figure to play with."""
    return page.locator(f".play [data-is={name}]")


def test_the_figure_shows_the_folders_own_runs_until_a_goal_is_moved(opened, traced):
    page = opened(reduced_motion="reduce")
    shared = shared_goal(traced)
    said = page.locator(".play .beside")
    said.get_by_text(
        f"{shared.standardised_posture_difference:.1f} standard deviations"
    ).first.wait_for()
    page.get_by_text("Try more").click()
    tasks = {task.label: name for name, task in traced.tasks.items()}
    options = part(page, "preset").locator("option").all_inner_texts()
    seen = 0
    for preset, text in enumerate(options[1:], 1):
        part(page, "preset").select_option(str(preset))
        task = tasks[text.removesuffix(" †")]
        stored = part(page, "stored").locator("option:not([value=''])")
        for label in stored.evaluate_all("all => all.map(o => o.value)")[:1]:
            part(page, "stored").select_option(label)
            good = solved(traced.cells[task, label])
            median = good.set_index("run_id").reward[typical_run(good)]
            page.wait_for_function(
                "ticks => document.querySelector('[data-is=score]').innerText.includes(ticks)",
                arg=f" {-median:.0f} ticks",
            )
            seen += 1
    assert seen >= 3
    page.get_by_role("button", name="Goal 2").focus()
    page.keyboard.press("ArrowUp")
    expect(page.get_by_role("radio", name="A learner")).to_be_checked()
    part(page, "play").press("Tab")
    expect(part(page, "stored")).to_have_value("")
    expect(part(page, "score")).to_contain_text("The learner")


def test_a_cell_of_the_ranking_opens_its_film_and_says_its_command(opened, traced):
    page = opened()
    cells = page.locator("#T_ranking .film-of, #T_not-ranked .film-of")
    assert cells.count() > 5
    row = page.locator("#T_not-ranked tr", has_text="hill climbing")
    row.locator(".film-of").click()
    expect(part(page, "stored")).to_have_value("hill-climbing")
    expect(part(page, "preset").locator("option:checked")).to_have_text("Two-armed 1 †")
    run = typical_run(solved(traced.cells["two-armed-1", "hill-climbing"]))
    command = re.compile(rf"^coartic draw \S+ --run {run[:8]} --out film.gif$")
    expect(part(page, "film").locator("code")).to_have_text(command)  # with the next picture
    page.get_by_role("button", name="Pause").wait_for()
    page.wait_for_function("document.querySelector('[data-is=tick]').value > 20")
    expect(page.get_by_role("button", name="Copy link")).to_be_hidden()


def test_nothing_scrolls_sideways_and_all_is_accessible(opened):
    page = opened(reduced_motion="reduce")
    page.eval_on_selector_all("details", "all => all.forEach((each) => { each.open = true; })")
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    # Rows of a table are alike: two of each. Pictures count by their labels alone.
    alike = "tbody tr:nth-child(n+3), svg > :not(:has(a))"
    page.eval_on_selector_all(alike, "all => all.forEach(each => each.remove())")
    rules = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"], "resultTypes": ["violations"]}
    for width, scheme in ((390, "dark"), (1280, "light")):
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme)
        accessibility = Axe().run(page, options=rules)
        assert accessibility.violations_count == 0, accessibility.generate_report()


def test_in_print_every_picture_is_there_once_and_nothing_leaves_its_box(opened, address):
    page = opened(688, f"{address}#print", color_scheme="dark", stays=True)  # A4 in its margins
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate(OVERFLOWS) == []
    assert not page.locator(".play").is_visible()
    figures = page.locator("figure").all()
    assert figures
    for figure in figures:
        expect(figure.locator(".drawn svg").filter(visible=True)).to_have_count(1)
    marks = page.locator("#figure-ranking use")
    assert "none" not in marks.evaluate_all("all => all.map(each => getComputedStyle(each).fill)")
    ink = page.evaluate("getComputedStyle(document.body).color")
    assert max(map(int, re.findall(r"\d+", ink))) < 80  # dark on white


OVERFLOWS = """[...document.querySelectorAll("main *")].filter(each => each.checkVisibility()
    && !each.closest("svg") && getComputedStyle(each).display != "inline"
    && (each.scrollHeight > each.clientHeight + 1 || each.scrollWidth > each.clientWidth + 1))
    .map(each => each.outerHTML.slice(0, 80))"""


def test_without_scripts_all_is_there(page_without_scripts, address):
    page = page_without_scripts
    page.goto(address)
    assert page.locator(".still svg").is_visible()
    assert page.locator("#T_methods tbody tr").count() > 8
    assert not page.locator("#methods-search").is_visible()
