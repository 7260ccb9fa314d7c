"""Commands that write files: what they say when they are interrupted, and where they do not."""

import os
import signal

import pytest

from coartic import CoarticError
from coartic.analysis.report.document import Document
from coartic.analysis.report.write import write_report
from coartic.benchmarks.run import run_suite
from tests.support.commands import call

BEFORE = "nothing is written in {}"
WITHIN = "{} holds old files beside new ones until the same command has ended"


def interrupt(*_, **__):
    """Ctrl-C, while this is called."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture
def interrupted(monkeypatch, capsys):
    """What a command says on standard error, and that it ends as Ctrl-C ends a process."""

    def end(number):
        raise SystemExit(-number)

    def said(*arguments):
        monkeypatch.setattr(signal, "raise_signal", end)
        code, out, error = call(monkeypatch, capsys, *arguments)
        assert (code, out) == (-signal.SIGINT, "")
        return error

    return said


@pytest.mark.parametrize("command", ["analyse", "report"])
def test_interrupted_before_it_writes(command, interrupted, monkeypatch, tmp_path):
    monkeypatch.setattr("coartic.analysis.study.load", interrupt)
    out = tmp_path / "report" if command == "report" else tmp_path
    assert interrupted(command, tmp_path) == f"interrupted; {BEFORE.format(out)}\n"
    assert list(tmp_path.iterdir()) == []


def test_interrupted_while_it_writes(interrupted, monkeypatch, tmp_path):
    monkeypatch.setattr("coartic.analysis.study.load", lambda folder: None)
    monkeypatch.setattr(
        "coartic.analysis.report.analyses.analyse", lambda study: {"claims.md": b""}
    )
    monkeypatch.setattr("coartic.files.publish", interrupt)
    assert interrupted("analyse", tmp_path) == f"interrupted; {WITHIN.format(tmp_path)}\n"

    def write(made, study, out, *, printed, begin):
        begin()
        interrupt()

    monkeypatch.setattr("coartic.analysis.report.build.build", lambda *_, **__: None)
    monkeypatch.setattr("coartic.analysis.report.build.write", write)
    out = tmp_path / "report"
    assert interrupted("report", tmp_path) == f"interrupted; {WITHIN.format(out)}\n"


def test_a_report_begins_to_be_written_when_all_is_made(tmp_path):
    out, seen = tmp_path / "report", []
    write_report(Document("t", ()), {}, out, begin=lambda: seen.append(out.exists()))
    assert seen == [False]
    assert (out / "report.html").exists()


def test_no_results_in_the_folder_of_a_report(tmp_path):
    write_report(Document("t", ()), {}, tmp_path)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(CoarticError, match="holds a report, and nothing else is written there"):
        run_suite("quick", tmp_path)
    assert sorted(tmp_path.rglob("*")) == before
