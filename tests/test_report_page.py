"""The page in a real browser: Chromium, driven by Playwright."""

import itertools

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
    page.goto(f"{address}#T_methods")
    assert page.locator("#T_methods").is_visible()
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


def part(page, name):
    """A part of the figure to play with."""
    return page.locator(f".play [data-is={name}]")


def test_the_figure_shows_the_folders_own_runs_until_a_goal_is_moved(opened, traced):
    page = opened(reduced_motion="reduce")
    shared = shared_goal(traced)
    said = page.locator(".play .beside")
    said.get_by_text(
        f"posture difference is {float(f'{shared.posture_difference:.2f}'):g} "
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


def test_a_phone_shows_the_panels_of_a_figure_one_below_the_other(opened):
    page = opened(width=390)
    page.eval_on_selector_all("details", "all => all.forEach((each) => { each.open = true; })")
    panels = page.eval_on_selector_all(
        ".drawn.narrow svg",
        """all => all.map((panel) => {
            const frame = panel.getBoundingClientRect();
            const drawn = panel.firstChild.getBoundingClientRect().width;
            const figure = panel.closest("figure").id;
            return [figure, frame.left, frame.right, frame.top, frame.bottom, drawn];
        })""",
    )
    of_figure = {}
    for figure, left, right, top, bottom, drawn in panels:
        assert 0 <= left < right <= 390
        assert drawn > 0
        of_figure.setdefault(figure, []).append((top, bottom))
    assert {"figure-saved", "figure-tasks", "figure-runtimes"} <= {*of_figure}
    for rows in of_figure.values():
        assert len(rows) > 1
        assert all(bottom <= top + 1 for (_, bottom), (top, _) in itertools.pairwise(rows))
    assert not any(drawn.is_visible() for drawn in page.locator("#figure-saved .wide").all())


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
