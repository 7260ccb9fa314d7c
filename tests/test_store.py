"""Records: whole or not at all, checked, and never mixed with those of other code."""

import contextlib
import dataclasses
import json
import os
import re
import uuid
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from coartic import CoarticError, files
from coartic.benchmarks.harness import record_of
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.store import Damage, RecordError, Store
from coartic.runs import codec
from tests.support.packs import (
    pack_lines,
    packs_of,
    read_pack,
    records_of,
    write_lines,
    write_pack,
)
from tests.support.suites import InProcess, paper_cells, perform_plan, run_specs

ROOT = Path(__file__).parent.parent
pytestmark = pytest.mark.usefixtures("one_by_one")


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
        store.write([record])
    assert store.read(spec.run_id) == record
    assert set(store.packs()) == {spec.run_id}
    assert [path.name for path in store.records.glob("[!.]*")] == ["00000001.pack"]
    ((run_id, found),) = read_pack(store.records / "00000001.pack").items()
    assert (run_id, found) == (spec.run_id, record.model_dump(mode="json"))


@pytest.mark.parametrize(
    "harm",
    [
        lambda data: data[:-10],
        lambda data: data[:40],
        lambda data: b"",
        lambda data: data.replace(b"-3", b"-4"),
        lambda data: b"\x80\x04pickle",
        lambda data: data.replace(b"common", b"uncommon"),
        lambda data: data.replace(b" ", b"  "),
    ],
)
def test_damage_is_noticed_reported_and_redone(harm, tmp_path):
    store, planned = Store(tmp_path), specs()
    perform_counting(store, planned)
    whole = store.read(planned[1].run_id)
    path = store.packs().path(planned[1].run_id)
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(RecordError, match=planned[1].run_id):
        store.read(planned[1].run_id)
    progress, performed = perform_counting(store, planned)
    assert [damage.path for damage in progress.damaged] == [path]
    assert performed == [planned[1].run_id]
    again = store.read(planned[1].run_id)
    assert again.result() == whole.result()


def test_a_record_under_a_wrong_name_is_damage(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    perform_counting(store, planned)
    first, second = (store.packs().path(spec.run_id) for spec in planned)
    (shared, (name, _, _)), (_, (_, _, other)) = map(pack_lines, (first, second))
    write_lines(first, [(shared[0], shared[2]), (name, other)])
    (found,) = [r for r in store.read_known([planned[0].run_id]) if isinstance(r, Damage)]
    assert f"it holds the record of {planned[1].run_id}" in found.reason


def test_only_missing_runs_are_done(tmp_path):
    store, planned = Store(tmp_path), specs(runs=4)
    assert perform_counting(store, planned[:2])[1] == [s.run_id for s in planned[:2]]
    progress, performed = perform_counting(store, planned)
    assert performed == [spec.run_id for spec in planned[2:]]
    assert (progress.total, progress.present, progress.done) == (4, 2, 2)
    assert perform_counting(store, planned)[1] == []
    assert len(perform_counting(store, planned, redo=True)[1]) == 4


def of_other_code(spec):
    entry = dataclasses.replace(spec.entry, code="c0ffee")
    return dataclasses.replace(spec.setting, entry=entry).spec(spec.run, spec.seed)


def test_other_code_makes_records_stale(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    perform_counting(store, planned)
    old = {spec.run_id for spec in planned}

    class Pretend(InProcess):
        """Workers that have the changed code, too."""

        def perform(self, jobs):
            yield from super().perform({**job, "code": planned[0].entry.code} for job in jobs)

    changed = [of_other_code(spec) for spec in planned]
    progress = perform_plan(changed, store, Pretend())
    assert set(progress.stale) == old
    assert progress.done == 2
    assert set(store.packs()) == old | {spec.run_id for spec in changed}
    assert not perform_counting(store, planned)[1]  # the old ones serve the old code


def test_workers_with_other_code_are_refused(tmp_path):
    planned = specs(runs=1)
    foreign = of_other_code(planned[0])

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
    assert set(store.packs()) == {planned[0].run_id}
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
@pytest.mark.parametrize("line", [0, 1])
def test_a_checksum_that_fits_no_record(body, line, tmp_path):
    store, planned = Store(tmp_path), specs(runs=1)
    perform_counting(store, planned)
    path = store.packs().path(planned[0].run_id)
    lines = [(name, content) for name, _, content in pack_lines(path)]
    lines[line] = (lines[line][0], body)
    write_lines(path, lines)
    progress, performed = perform_counting(store, planned)
    assert (len(progress.damaged), len(performed)) == (1, 1)
    assert len(list(store.records.glob("damaged-*"))) == 1  # kept, out of the way


@pytest.mark.parametrize("number", [b"NaN", b"Infinity", b"-Infinity"])
def test_a_record_holds_numbers_alone(number, tmp_path):
    """Python's JSON reads words that no number is written with."""
    store, (spec,) = Store(tmp_path), specs(runs=1)
    perform_counting(store, [spec])
    path = store.packs().path(spec.run_id)
    shared, (name, _, body) = pack_lines(path)
    body = re.sub(rb'"wall_s":[-+.e0-9]+', b'"wall_s":' + number, body, count=1)
    assert number in body
    write_lines(path, [(shared[0], shared[2]), (name, body)])
    with pytest.raises(RecordError, match=spec.run_id):
        store.read(spec.run_id)


def test_something_else_in_place_of_a_pack(tmp_path):
    store, planned = Store(tmp_path), specs(runs=2)
    store.records.mkdir(parents=True)
    (store.records / "00000001.pack").mkdir()
    os.mkfifo(store.records / "00000007.pack")
    progress, performed = perform_counting(store, planned)
    assert len(progress.damaged) == len(performed) == 2
    assert not perform_counting(store, planned)[1]


def done(count=4):
    """Specifications, and records of them by run id."""
    planned = specs(runs=count)
    answers = InProcess().perform([spec.job() for spec in planned])
    return planned, [record_of(*pair) for pair in zip(answers, planned, strict=True)]


def test_a_pack_says_what_is_common_once(tmp_path):
    store, (_, records) = Store(tmp_path), done()
    with store.locked():
        store.write(records)
    (path,) = packs_of(tmp_path)
    names = [name.decode() for name, _, _ in pack_lines(path)]
    dates = [record.environment.date for record in records]
    assert names.count("common") == len(set(dates))
    assert [name for name in names if name != "common"] == [r.run_id for r in records]
    assert {r.run_id: r.model_dump(mode="json") for r in records} == records_of(tmp_path)
    assert dict(store.packs()) == {record.run_id: record for record in records}


def test_packs_are_bounded(tmp_path, monkeypatch):
    store, (_, records) = Store(tmp_path), done()
    monkeypatch.setattr(codec, "FULL", 1)
    with store.locked():
        store.write(records)
    assert [list(read_pack(path)) for path in packs_of(tmp_path)] == [[r.run_id] for r in records]


@pytest.fixture(scope="module")
def made():
    """As :func:`done`, once."""
    return done()


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_pack_loses_the_damaged_lines_alone(data, made, tmp_path):
    """Wherever a byte is changed or the pack is cut."""
    planned, records = made
    folder = tmp_path / uuid.uuid4().hex
    store = Store(folder)
    with store.locked():
        store.write(records)
    (path,) = packs_of(folder)
    content = path.read_bytes()
    at = data.draw(st.integers(0, len(content) - 1), label="at")
    if data.draw(st.booleans(), label="cut"):
        harmed = content[:at]
    else:
        byte = data.draw(st.integers(0, 255).filter(lambda b: b != content[at]), label="byte")
        harmed = content[:at] + bytes([byte]) + content[at + 1 :]
    path.write_bytes(harmed)
    whole, common, found = set(), False, harmed.splitlines(keepends=True)
    for line in content.splitlines(keepends=True):
        if line.startswith(b"common"):
            common = line in found
        elif common and line in found:
            whole.add(line.split(b" ")[0].decode())
    with store.locked():
        known = list(store.read_known([spec.run_id for spec in planned]))
        kept = {r.run_id: r for r in known if not isinstance(r, Damage)}
        for damage in known:
            if isinstance(damage, Damage):
                store.set_aside(damage)
    assert kept == {r.run_id: r for r in records if r.run_id in kept}
    assert kept.keys() >= whole
    assert dict(store.packs()) == kept
    assert not store.packs().damaged
    assert {p.read_bytes() for p in store.records.glob("damaged-*")} <= {harmed}


class KilledError(BaseException):
    """In place of SIGKILL."""


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_sequence_of_writes_and_kills(data, made, tmp_path):
    """What was written last of a run is what is there, or what was there before the kill."""
    _, records = made
    folder = tmp_path / uuid.uuid4().hex
    now: dict[str, tuple[object, ...]] = {}
    steps = data.draw(
        st.lists(
            st.tuples(
                st.lists(st.sampled_from(records), min_size=1, max_size=4, unique_by=id),
                st.sampled_from([None, "write", "rename", "rename done", "drop"]),
            ),
            min_size=1,
            max_size=6,
        )
    )
    for number, (lot, killed) in enumerate(steps):
        store = Store(folder)
        timed = [
            record.model_copy(
                update={"timing": record.timing.model_copy(update={"wall_s": number})}
            )
            for record in lot
        ]
        with pytest.MonkeyPatch.context() as patch:
            kill_at(patch, killed)
            with contextlib.suppress(KilledError), store.locked():
                store.write(timed)
                store.drop_superseded()
        found = dict(Store(folder).packs())
        for record in timed:
            before = now.get(record.run_id, (None,))
            sure = killed in (None, "drop", "rename done")
            now[record.run_id] = (record,) if sure else (*before, record)
        for run_id, possible in now.items():
            assert found.get(run_id) in possible
            now[run_id] = (found.get(run_id),)
    with Store(folder).locked():
        pass
    assert not list(folder.rglob("*.part"))


def kill_at(patch, moment):
    """Have the next write end at a moment, and leave things as they are then."""
    replace_, unlink = os.replace, Path.unlink

    def replaced(source, target):
        if moment == "rename":
            raise KilledError
        replace_(source, target)
        if moment == "rename done":
            raise KilledError

    def synced(descriptor):
        if moment == "write":
            raise KilledError

    def unlinked(path, missing_ok=False):
        if moment == "drop" and path.suffix == ".pack":
            raise KilledError
        if path.suffix == ".pack":
            unlink(path, missing_ok=missing_ok)

    if moment is not None:
        patch.setattr(files.os, "replace", replaced)
        patch.setattr(files.os, "fsync", synced)
        patch.setattr(Path, "unlink", unlinked)  # of temporary files, which a kill leaves behind


def test_what_is_written_anew_replaces_what_was_there(tmp_path):
    store, planned = Store(tmp_path), specs(runs=3)
    perform_counting(store, planned)
    assert len(packs_of(tmp_path)) == 3
    perform_counting(store, planned[:2], redo=True)
    with store.locked():
        store.drop_superseded()
    assert [path.name for path in packs_of(tmp_path)] == [
        "00000003.pack", "00000004.pack", "00000005.pack",
    ]  # fmt: skip
    assert not perform_counting(store, planned)[1]


def test_a_bad_record_above_a_good_one(tmp_path):
    """A forged pack of a higher number replaces nothing."""
    store, planned = Store(tmp_path), specs(runs=2)
    perform_counting(store, planned)
    good = store.read(planned[0].run_id)
    forged = records_of(tmp_path)[planned[0].run_id]
    forged["solution"]["reward"] += 10
    write_pack(store.records / "00000050.pack", {planned[0].run_id: forged})
    progress, performed = perform_counting(store, planned)
    assert ([d.path.name for d in progress.damaged], performed) == (["00000050.pack"], [])
    assert store.read(planned[0].run_id) == good


def test_records_of_an_older_version_are_refused(tmp_path):
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / f"{'0' * 16}-{'0' * 12}.json").write_text("sha256:")
    with pytest.raises(CoarticError, match="has records of an older version.*another --out"):
        perform_counting(Store(tmp_path), specs(runs=1))


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(CoarticError, match="cannot write to"):
        Store(tmp_path / "file" / "below").locked().__enter__()


def test_nothing_of_a_results_folder_is_unpickled():
    pattern = re.compile(r"\b(pickle|cloudpickle|joblib\.load|dill|shelve|allow_pickle)\b")
    for package in ("coartic", "baselines", "benchmarks", "analysis"):
        for path in (ROOT / package).rglob("*.py"):
            assert not pattern.search(path.read_text(encoding="utf-8")), path
