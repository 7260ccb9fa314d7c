"""The page of ``coartic play`` in a real browser: what it says is what the package finds."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import CONDITIONS, Movement, execute, learn, load_task
from coartic.analysis import solutions_of
from coartic.analysis.signatures import distance_of_means
from coartic.play import page as pages

pytestmark = pytest.mark.browser


TRIALS = 30  # of 10,000 that the page makes, as tests see the same in fewer


def written(folder, trials):
    """The address of a page that makes so many trials."""
    file = folder / "play.html"
    html = pages.play_page().replace("TRIALS = 10000;", f"TRIALS = {trials};")
    file.write_text(html, encoding="utf-8")
    return f"{file.as_uri()}#open=1"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    return written(tmp_path_factory.mktemp("play"), TRIALS)


@pytest.fixture
def opened(visited, address):
    """The page in a state; it is loaded once, and stays."""

    def open_page(state=""):
        return settled(visited(f"{address}&{state}", reduced_motion="reduce", stays=True))

    return open_page


DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def text(page, name):
    return page.locator(f"[data-is={name}]").inner_text()


def ticks(page, who, where="score"):
    """What the page says that somebody needs."""
    (found,) = re.findall(rf"{who} (\d+) ticks", text(page, where))
    return int(found)


def slide(page, name, value):
    page.get_by_role("slider", name=name).fill(str(value))
    page.evaluate(DRAWN)


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


def practised(task, condition, trials=TRIALS):
    """Runs of the learner, and the ticks that the page should say: of the median run."""
    runs = [learn(task, condition, seed=seed, trials=trials) for seed in range(5)]
    return runs, -sorted(run.reward for run in runs)[2]


def test_coarticulation_appears_with_practice(visited, tmp_path):
    trials = 600  # on every machine
    page = settled(visited(written(tmp_path, trials), reduced_motion="reduce"))
    assert trials_made(page) == trials
    postures, before, after = [], [], []  # postures at the goal that they share
    lists = page.locator("[data-is=movements] ol").all()
    for shown, role, name in zip(lists, ("Blue", "Orange"), pages.UP_OR_DOWN, strict=True):
        runs, due = practised(name, "EC1", trials)
        before.append(ticks(page, role, "before"))
        after.append(ticks(page, role))
        assert before[-1] == -learn(name, "EC1", seed=0, trials=1).reward
        assert after[-1] == due
        # A bar for each movement of the median run, over that of the first trial.
        now, first = (
            [*run.execute().ticks_by_goal()]
            for run in (
                sorted(runs, key=lambda run: run.reward)[2],
                learn(name, "EC1", seed=0, trials=1),
            )
        )
        words = [line.split()[-2:] for line in shown.locator("li").all_inner_texts()]
        assert [int(count) for count, _ in words] == now
        more = [int(change.strip("()").replace("−", "-").replace("±", "")) for _, change in words]
        assert more == [count - each for count, each in zip(now, first, strict=True)]
        assert more[0] > 0 > more[1]
        postures.append(np.array([run.execute().configurations[0] for run in runs]))
    learned = distance_of_means(*postures)
    assert learned > 0.1
    words = f"the posture difference is {float(f'{learned:.2f}'):g}."
    assert words in text(page, "finding")
    saved = [first - now for first, now in zip(before, after, strict=True)]
    assert f"saves blue {saved[0]} ticks and orange {saved[1]}." in text(page, "finding")
    assert "5 runs each" in text(page, "meaning")
    # Earlier, by the slider, there was less of it.
    reset = page.get_by_role("button", name="Reset")
    assert reset.is_disabled()
    slide(page, "Practice", 1)
    assert "same posture" in text(page, "finding")
    assert [ticks(page, role) for role in ("Blue", "Orange")] == before
    reset.click()
    assert words in text(settled(page), "finding")
    assert reset.is_disabled()


ACT = """<script>
  const figure = document.getElementById("play");
  const button = figure.querySelector("[data-is=play]");
  const act = (kind) => button.dispatchEvent(new Event(kind, { bubbles: true }));
  ["pointerdown", "click"].forEach(act);
  const count = (frames) => {
    if (figure.matches("[data-settled]")) window.frames_until_settled = frames;
    else requestAnimationFrame(() => count(frames + 1));
  };
  count(0);
</script>"""


def test_practice_goes_on_while_the_movement_is_shown(visited, tmp_path):
    """The trials shown grow by 5 % a frame, from a twentieth of a trial. If the button ended this,
    the page would settle as soon as all trials are made."""
    trials = 3  # made long before as many frames as are due
    address = written(tmp_path, trials).partition("#")[0]
    with (tmp_path / "play.html").open("a", encoding="utf-8") as file:
        file.write(ACT)
    page = visited(address)
    page.wait_for_function("window.frames_until_settled")
    assert page.evaluate("window.frames_until_settled") > np.log(trials / 0.05) / np.log(1.05)
    assert trials_made(page) == trials
    button = page.get_by_role("button", name="Pause")
    button.click()
    page.evaluate(DRAWN)
    assert page.get_by_role("button", name="Show movement").is_visible()  # and stays so


def test_postures_by_hand_have_their_true_score_and_are_in_the_link(opened):
    page = opened("preset=3&who=you")
    assert ticks(page, "You") == ticks(page, "Corrective process alone")
    assert "Optimum" not in text(page, "score")  # it is not proven
    elbow = page.get_by_role("button", name="left arm, elbow 2")
    box = elbow.bounding_box()
    elbow.hover()
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 20, box["y"] + box["height"] / 2 + 30, steps=2)
    page.mouse.up()
    page.get_by_label("Place it at").select_option("2")
    page.get_by_label("hit by the").select_option("0")
    page.get_by_role("button", name="Base").focus()
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
        page.get_by_role("button", name="Save your trials").click()
    trials = pd.read_csv(download.value.path())
    assert trials.trial.max() == 3  # a drag, a hand, a key; the other key moves nothing
    task = load_task("two-armed-1")
    last = solutions_of(task, trials).runs[-1]
    assert last.ticks_by_goal() == done.ticks_by_goal()
    assert np.allclose(last.configurations, done.configurations)
    comes_back(page)


def test_the_link_holds_the_whole_state(opened):
    page = opened()
    assert "posture difference" in text(page, "finding")
    page.get_by_role("radio", name="each movement").check()
    assert "same posture" in text(settled(page), "finding")  # no coarticulation by such a reward
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
    changed_to(page, "open=1&preset=3&explores=EC3&reward=movement")
    slide(page, "It leans towards the next goal", 4)
    settled(page)
    # The learner's condition, by the Python that the page shows for it.
    code = page.locator("[data-is=python]").text_content()
    condition = eval(code, {"CONDITIONS": CONDITIONS, "replace": replace})
    assert (condition.drift, condition.credit) == (1.0, "subtask")
    assert ticks(page, "The learner") == practised("two-armed-1", condition)[1]
    # Entries that are no state are left out, and goals and joints far out lie nearer.
    changed_to(page, "preset=3&who=constructor&mate=__proto__&explores=constructor&__proto__=1")
    assert ticks(page, "The learner") > 0
    changed_to(page, "who=alone&preset=1&goals=60,0;6,-70,1;6,-70")
    assert page.get_by_role("button", name="Goal 1, at 12, 0.").count() == 1
    assert page.get_by_role("button", name="Goal 2, at 6, -12.").count() == 1


def test_nothing_scrolls_sideways_and_all_is_accessible(opened):
    from axe_playwright_python.sync_playwright import Axe

    page = opened()
    for width, scheme, state in (
        (1280, "light", "drift=0.03&reward=movement"), (390, "dark", "preset=4&who=you")
    ):  # fmt: skip
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=scheme)
        changed_to(page, state)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        accessibility = Axe().run(page, options={"resultTypes": ["violations"]})
        assert accessibility.violations_count == 0, accessibility.generate_report()
