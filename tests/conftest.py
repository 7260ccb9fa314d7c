"""Shared by all tests."""

import gc
import os
import shutil
import signal
import sys
from functools import cache

import pytest
from hypothesis import given, settings, strategies

from coartic.internal.threads import worker_variables

# While modules are imported and tests collected, nothing is garbage: see the end of this file.
gc.disable()

# As in the processes of a suite: one thread, and the same bits on every processor. NumPy reads this
# when it is first imported.
os.environ.update(worker_variables())

# The same examples every time: a run that fails says something of the code, not of its luck.
# Others are tried with --hypothesis-profile=new.
settings.register_profile("same", derandomize=True, max_examples=20, deadline=None)
settings.register_profile("new", deadline=None)
settings.load_profile("same")

# Tests that interrupt themselves or others do so in the background as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _kernels():
    """Compiled or loaded before the first test, on no test's clock."""
    if "PYTEST_XDIST_WORKER" in os.environ:  # the process that hands out tests runs none
        from coartic import load_task
        from coartic.learner.learning import warm_up

        warm_up(load_task("ascending"))


@pytest.fixture(scope="session", autouse=True)
def _first_example():
    """Hypothesis looks for garbage among all objects before its first example: now they are few."""
    given(strategies.none())(lambda _: None)()


@pytest.fixture(scope="session", autouse=True)
def _parts_of_reports_fail_aloud():
    """A part of a report that cannot be made fails the test, where a user gets the others."""
    from coartic.analysis.report import sections

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sections, "attempt", lambda failures, name, make, *args: make(*args))
        yield


@pytest.fixture(autouse=True)
def _plain_width(monkeypatch):
    """Output as wide as it is without a terminal, whatever started the tests."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture
def unranked(monkeypatch):
    """Commands print no ranking, which takes most of their time."""
    monkeypatch.setattr("coartic.cli.run.say_ranking", lambda *_: None)


@pytest.fixture
def in_this_process(unranked, monkeypatch):
    """Runs without processes of their own, which take long and have tests of their own."""
    from coartic.benchmarks import pool, reproduce, runner
    from tests.support.suites import InProcess

    for module in (pool, reproduce, runner):
        monkeypatch.setattr(module, "Local", InProcess)


@pytest.fixture(autouse=True)
def _pages_here(request):
    """Examples of pages run in this process."""
    if isinstance(request.node, pytest.DoctestItem):
        request.getfixturevalue("in_this_process")


@pytest.fixture(scope="module")
def not_repeated():
    """No run of a method of a file is made again in the end."""
    from coartic.benchmarks import runner

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "perform_in_order", lambda *_: ())
        yield


@pytest.fixture
def ranked(in_this_process, monkeypatch):
    """Runs in this process, by commands that print the ranking."""
    from coartic.cli.read import say_ranking

    monkeypatch.setattr("coartic.cli.run.say_ranking", say_ranking)


@pytest.fixture(scope="session")
def commands():
    """The command line, put together once."""
    from typer.main import get_command

    from coartic.cli import app

    return get_command(app)


@pytest.fixture
def coartic(commands, monkeypatch, capsys):
    """Calls the command line in this process: exit code, standard output, standard error."""
    from coartic import cli

    monkeypatch.setattr(cli, "app", commands)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["coartic", *map(str, arguments)])
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code or 0
        return code, *capsys.readouterr()

    return call


@pytest.fixture(scope="session")
def traced(tmp_path_factory):
    """A results folder that nobody writes into: the paper's cells beside other methods."""
    from coartic.analysis.study import load
    from tests.support.suites import made_once, run_and_write, traced_cells

    def make(folder):
        run_and_write(folder, traced_cells(), runs=4, trials=150)

    return load(made_once(tmp_path_factory, "traced", make))


@pytest.fixture(scope="session")
def shipped_folder(tmp_path_factory):
    """A folder with the results folders of the suites whose runs ship."""
    from store_tables import unpack

    from coartic.runs.shipped import shipped_hashes
    from tests.support.suites import made_once

    def make(folder):
        for suite in shipped_hashes():
            unpack(suite, folder / suite)

    return made_once(tmp_path_factory, "shipped-results", make)


@pytest.fixture(scope="session")
def shipped_study(shipped_folder):
    """Loads a suite whose runs ship, once. Nobody changes the study."""
    from coartic.analysis.study import load

    return cache(lambda suite: load(shipped_folder / suite))


@pytest.fixture(scope="session")
def shipped(shipped_study):
    """The shipped results of suite ``comparison``, which nobody changes."""
    return shipped_study("comparison").worlds[""]


@pytest.fixture(scope="session")
def report(traced, tmp_path_factory):
    """The folder of a report on those results, as a user gets it."""
    from coartic.analysis.report import build, sections
    from tests.support.suites import made_once

    def make(folder):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(build, "picture", lambda *_: b"")  # drawn for the page already
            patch.setattr(sections, "visible_sections", lambda study: build.SECTIONS)  # all
            build.write_report(traced, folder / "report", for_paper=False)

    return made_once(tmp_path_factory, "traced-report", make) / "report"


@pytest.fixture(scope="session")
def browser():
    """Chromium, driven by Playwright."""
    from playwright.sync_api import sync_playwright

    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    found = os.environ.get("COARTIC_BROWSER") or next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.skip("no Chromium is installed; set COARTIC_BROWSER to the one to use")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="session")
def pages(browser):
    """Pages by the options of their contexts. They stay, as a new page starts two processes."""
    return {}


@pytest.fixture
def visited(browser, pages):
    """Opens a page; what it logs, throws or asks the network for fails the test. A page that stays
    is there for the next test, for whose link to another part of it nothing is loaded."""
    problems, opened = [], {}
    listeners = {
        "console": lambda message: problems.append(message.text),
        "pageerror": lambda error: problems.append(str(error)),
        "request": lambda request: (
            None
            if request.url.startswith(("file:", "data:", "blob:"))
            else problems.append(request.url)
        ),
    }

    def visit(
        link,
        width=1280,
        color_scheme="light",
        reduced_motion="no-preference",
        stays=False,
        **options,
    ):
        key = repr(options)
        if key not in pages:
            context = browser.new_context(**options)
            context.set_default_timeout(180_000)  # ms; a machine may be busy
            pages[key] = context.new_page()
        page = pages[key]
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(media="screen", color_scheme=color_scheme, reduced_motion=reduced_motion)
        page.mouse.move(0, 0)
        for event, listener in listeners.items():
            page.on(event, listener)
        opened[page] = stays
        page.goto(link)
        return page

    yield visit
    for page, stays in opened.items():
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
        if not stays:
            page.goto("about:blank")
    assert problems == []


FIRST = (
    *("test_report_page", "test_play_page", "test_report"),
    *("test_pages", "test_figures", "test_signatures", "test_conformance"),
    *("test_pool", "test_cli", "test_method_files", "test_runner", "test_cluster"),
)
"""Modules that begin: those that use one browser and read one report, so that no other worker takes
the last of them, then those that use tables of the shipped runs, and those that start processes;
they take longest, and none is left alone with them at the end."""


def pytest_collection_modifyitems(items):
    """These modules, then the others."""
    rank = {f"tests/{name}.py": number for number, name in enumerate(FIRST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(FIRST)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One a core that this process may use: each more imports and draws the same once more."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def pytest_collection_finish():
    """What is imported and collected stays: looking through it again and again takes long."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 1_000)
    gc.enable()


def pytest_unconfigure():
    """pytest looks five times for garbage that says something when it goes: once is enough."""
    gc.collect()
    gc.freeze()
