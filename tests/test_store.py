"""Records: whole or not at all, checked, and never mixed with those of other code."""

import dataclasses
import hashlib
import json
import os
import re
from pathlib import Path

import pytest

from benchmarks.harness import record_of
from benchmarks.specification import Limits
from benchmarks.store import Damage, RecordError, Store
from benchmarks.suites import run_specs
from coartic import CoarticError, files
from tests.support.suites import InProcess, paper_cells, perform_plan

ROOT = Path(__file__).parent.parent


def specs(runs=3, **options):
    cells = paper_cells(tasks=["ascending"])
    return [spec for _, spec in run_specs(cells, runs=runs, seed=0, trials=5, **options)]


class Counting(InProcess):
    def __init__(self):
        self.performed = []

    def perform(self, jobs):
        for answer in super().perform(jobs):
            self.performed.append(answer["run_id"])
            yield answer


def perform_counting(store, planned, **options):
    executor = Counting()
    progress = perform_plan(planned, store, executor, **options)
    return progress, executor.performed


def test_a_record_comes_back(tmp_path):
    store, (spec,) = Store(tmp_path), specs(runs=1)
    answers = InProcess().perform([spec.job()])
    record = record_of(next(answers), spec)
    with store.locked():
        store.write(record)
    assert store.read(spec.run_id) == record
    assert store.ids() == {spec.run_id}
    assert [path.name for path in store.records.glob("[!.]*")] == [f"{spec.run_id}.json"]


@pytest.mark.parametrize(
    "harm",
    [
        lambda data: data[:-10],
        lambda data: data[:40],
        lambda data: b"",
        lambda data: data.replace(b"-3", b"-4"),
        lambda data: b"\x80\x04pickle",
        lambda data: data.replace(b"sha256:", b"sha257:"),
    ],
)
def test_damage_is_noticed_reported_and_redone(harm, tmp_path):
    store, planned = Store(tmp_path), specs()
    perform_counting(store, planned)
    whole = store.read(planned[1].run_id)
    path = store.path(planned[1].run_id)
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(RecordError, match=re.escape(str(path))):
        store.read(planned[1].run_id)
    progress, performed = perform_counting(store, planned)
    assert [damage.path for damage in progress.damaged] == [path]
    assert performed == [planned[1].run_id]
    again = store.read(planned[1].run_id)
    assert again.result() == whole.result()


def test_a_record_under_a_wrong_name_is_damage(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    perform_counting(store, planned)
    first, second = (store.path(spec.run_id) for spec in planned)
    first.write_bytes(second.read_bytes())
    (found,) = [r for r in store.read_known([planned[0].run_id]) if isinstance(r, Damage)]
    assert "holds the record of run" in found.reason


def test_only_missing_runs_are_done(tmp_path):
    store, planned = Store(tmp_path), specs(runs=4)
    assert perform_counting(store, planned[:2])[1] == [s.run_id for s in planned[:2]]
    progress, performed = perform_counting(store, planned)
    assert performed == [spec.run_id for spec in planned[2:]]
    assert (progress.total, progress.present, progress.done) == (4, 2, 2)
    assert perform_counting(store, planned)[1] == []
    assert len(perform_counting(store, planned, redo=True)[1]) == 4


def test_other_code_makes_records_stale(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    perform_counting(store, planned)
    old = {spec.run_id for spec in planned}

    class Pretend(InProcess):
        """Workers that have the changed code, too."""

        def perform(self, jobs):
            yield from super().perform({**job, "code": planned[0].entry.code} for job in jobs)

    changed = [
        dataclasses.replace(spec, entry=dataclasses.replace(spec.entry, code="c0ffee"))
        for spec in planned
    ]
    progress = perform_plan(changed, store, Pretend())
    assert set(progress.stale) == old
    assert progress.done == 2
    assert store.ids() == old | {spec.run_id for spec in changed}
    assert not perform_counting(store, planned)[1]  # the old ones serve the old code


def test_workers_with_other_code_are_refused(tmp_path):
    planned = specs(runs=1)
    foreign = dataclasses.replace(
        planned[0], entry=dataclasses.replace(planned[0].entry, code="c0ffee")
    )

    class Elsewhere:
        def perform(self, jobs):
            for job in jobs:
                said = {"error": "other code", "foreign_code": True, "answer": None}
                yield {"run_id": job["run_id"], "outcome": json.dumps(said)}

    with pytest.raises(CoarticError, match="other code"):
        perform_plan([foreign], Store(tmp_path), Elsewhere())


def test_lost_runs_are_asked_for_again_and_given_up_with_words(tmp_path):
    planned = specs(runs=5)

    class Lossy(Counting):
        def perform(self, jobs):
            for index, answer in enumerate(super().perform(jobs)):
                if index == 2:
                    return
                yield answer

    progress = perform_plan(planned, Store(tmp_path), Lossy())
    assert progress.done == 5

    class Dead:
        asked = 0

        def perform(self, jobs):
            self.asked += 1
            return iter(())

    class Slow(Counting):
        """One answer a round, as where workers keep dying."""

        def perform(self, jobs):
            yield next(super().perform(jobs))

    assert perform_plan(specs(runs=9), Store(tmp_path / "slow"), Slow()).done == 9
    with pytest.raises(CoarticError, match="5 runs were lost again and again"):
        perform_plan(planned, Store(tmp_path / "other"), Dead())


def test_timeouts_are_redone_under_a_longer_limit_or_on_demand(tmp_path):
    store = Store(tmp_path)

    class Slow:
        def perform(self, jobs):
            for job in jobs:
                failure = {"failure": "timeout", "reason": "slow", "wall_s": 1.0}
                yield {"run_id": job["run_id"], **failure}

    short = specs(runs=1, limits=Limits(1.0))
    progress = perform_plan(short, store, Slow())
    assert progress.failed == 1
    record = store.read(short[0].run_id)
    assert (record.status, record.meter, record.solution) == ("timeout", None, None)
    assert perform_counting(store, short)[1] == []
    assert perform_plan(specs(runs=1, limits=Limits(2.0)), store, Slow()).done == 1
    assert len(perform_counting(store, short, retry_failed=True)[1]) == 1
    assert store.read(short[0].run_id).status == "ok"


def test_a_full_disk_loses_nothing_that_was_there(tmp_path, monkeypatch):
    store, planned = Store(tmp_path), specs(runs=3)
    real = os.fsync
    calls = []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) > 1:
            raise OSError(28, "No space left on device")
        real(descriptor)

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(CoarticError, match="No space left on device"):
        perform_counting(store, planned)
    monkeypatch.undo()
    assert store.ids() == {planned[0].run_id}
    assert list(store.records.glob("*.part")) == []
    assert perform_counting(store, planned)[1] == [spec.run_id for spec in planned[1:]]


def test_left_over_parts_are_cleared(tmp_path):
    store = Store(tmp_path)
    store.records.mkdir()
    for folder in (tmp_path, store.records):
        (folder / f".coartic-{'a' * 32}.part").write_text("half a rec")
        (folder / ".mine.part").write_text("the user's")
    with store.locked():
        pass
    assert sorted(path.name for path in tmp_path.rglob("*.part")) == [".mine.part"] * 2


def test_one_suite_at_a_time(tmp_path):
    """A second writer is told so, and goes ahead once the first is done."""
    one, two = Store(tmp_path), Store(tmp_path)
    with one.locked(), pytest.raises(CoarticError, match="another suite is at work"):
        perform_counting(two, specs(runs=1))
    assert perform_counting(two, specs(runs=1))[0].done == 1


@pytest.mark.parametrize("body", [b'{"a":1}', b"[]", b"not json", b'{"run_id":"x"}'])
def test_a_checksum_that_fits_no_record(body, tmp_path):
    store, planned = Store(tmp_path), specs(runs=1)
    perform_counting(store, planned)
    head = b"sha256:" + hashlib.sha256(body).hexdigest().encode() + b"\n"
    store.path(planned[0].run_id).write_bytes(head + body + b"\n")
    progress, performed = perform_counting(store, planned)
    assert (len(progress.damaged), len(performed)) == (1, 1)
    assert len(list(store.records.glob("damaged-*"))) == 1  # kept, out of the way


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"-Infinity"])
def test_a_record_holds_numbers_alone(number, tmp_path):
    """Python's JSON reads words that no number is written with."""
    store, (spec,) = Store(tmp_path), specs(runs=1)
    perform_counting(store, [spec])
    body = store.path(spec.run_id).read_bytes().partition(b"\n")[2].rstrip(b"\n")
    body = re.sub(rb'"wall_s":[-+.e0-9]+', b'"wall_s":' + number, body, count=1)
    assert number in body
    head = b"sha256:" + hashlib.sha256(body).hexdigest().encode() + b"\n"
    store.path(spec.run_id).write_bytes(head + body + b"\n")
    with pytest.raises(RecordError, match=spec.run_id):
        store.read(spec.run_id)


def test_something_else_in_place_of_a_record(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    store.records.mkdir(parents=True)
    store.path(planned[0].run_id).mkdir()
    os.mkfifo(store.path(planned[1].run_id))
    progress, performed = perform_counting(store, planned)
    assert len(progress.damaged) == len(performed) == 2


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(CoarticError, match="cannot write to"):
        Store(tmp_path / "file" / "below").locked().__enter__()


def test_nothing_of_a_results_folder_is_unpickled():
    pattern = re.compile(r"\b(pickle|cloudpickle|joblib\.load|dill|shelve|allow_pickle)\b")
    for package in ("coartic", "baselines", "benchmarks", "analysis"):
        for path in (ROOT / package).rglob("*.py"):
            assert not pattern.search(path.read_text(encoding="utf-8")), path
