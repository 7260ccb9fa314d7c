"""Runs on a Dask cluster: the same results, and a sentence for whatever is wrong with it."""

import asyncio

import pytest

from coartic import CoarticError, load_task
from coartic.benchmarks import cluster as cluster_module
from coartic.benchmarks.cluster import Dask
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform
from tests.support.suites import (
    InProcess,
    cell_on,
    paper_cells,
    planned,
    run_and_write,
    same_results,
)

pytestmark = [pytest.mark.process, pytest.mark.filterwarnings("ignore")]  # Dask's own
QUIET = {"dashboard_address": None, "silence_logs": 50}
CELLS = paper_cells(tasks=["ascending", "descending"])


@pytest.fixture(scope="module")
def distributed():
    return pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def address(distributed):
    """Of a cluster in this process, which is as far as patches reach."""
    more = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp://"}
    with distributed.LocalCluster(**more, **QUIET) as cluster:
        yield cluster.scheduler_address


def test_runs_come_out_as_they_do_here(address, tmp_path):
    there = run_and_write(tmp_path / "there", CELLS, executor=Dask(address), runs=3, trials=40)
    same_results(there, run_and_write(tmp_path / "here", CELLS, runs=3, trials=40))
    assert set(there.runs.together) == {3}


OWN = """
from coartic.method import Information, Method, Result
from coartic.motion.solution import Movement

class Mine(Method):
    name = "mine"
    title = citation = "x"
    information = frozenset({Information.CORRECTIVE_PROCESS})
    def solve(self, session):
        goals = range(1, session.goals_count + 1)
        return Result(tuple(Movement(n, "right", "corrective") for n in goals))
"""


def test_a_method_of_a_file_runs_on_workers(address, tmp_path):
    """All that goes there is serialised. A method whose file was changed there is refused."""
    (tmp_path / "mine.py").write_text(OWN)
    cell = cell_on(load_task("ascending"), registry([tmp_path / "mine.py"])["mine"])
    runs = run_and_write(tmp_path / "out", [cell], executor=Dask(address)).runs
    assert runs.status.tolist() == ["ok", "ok"]
    (tmp_path / "mine.py").write_text(f"{OWN}# changed")
    with pytest.raises(CoarticError, match="mine.py, or a file that it loads, has changed"):
        run_and_write(tmp_path / "other", [cell], executor=Dask(address))


@pytest.mark.usefixtures("distributed")
def test_nobody_at_an_address(tmp_path):
    import dask

    with dask.config.set({"distributed.comm.timeouts.connect": "0.5s"}):
        for address in ("tcp://127.0.0.1:1", "nonsense://x"):
            with pytest.raises(CoarticError, match=f"scheduler {address} does not answer.*8786"):
                perform(planned(CELLS), tmp_path, executor=Dask(address))


def test_a_scheduler_that_is_lost(distributed, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "Local", InProcess)
    cluster = distributed.LocalCluster(n_workers=1, processes=False, protocol="tcp://", **QUIET)
    with cluster:
        executor = Dask(cluster.scheduler_address)
        client = executor._client()
        monkeypatch.setattr(executor, "_client", lambda: client)

        def watch(progress, what):
            if progress.done == 2:
                client._timeout = 0.1  # s; it would wait for half a minute that it comes back
                cluster.close()

        with pytest.raises(CoarticError, match=r"is lost.*repeat the command"):
            perform(planned(CELLS), tmp_path / "out", executor=executor, watch=watch)
    again = run_and_write(tmp_path / "out", CELLS)
    assert (again.runs.status == "ok").all()


def test_a_scheduler_that_does_not_answer(address, tmp_path, monkeypatch):
    """As one on a machine that has lost its power: nobody closes the connection."""
    executor = Dask(address)
    client = executor._client()
    monkeypatch.setattr(executor, "_client", lambda: client)
    monkeypatch.setattr(cluster_module, "ANSWER_S", 0.3)

    async def sleep(**_):
        await asyncio.sleep(60)

    client.scheduler.ncores = sleep
    with pytest.raises(CoarticError, match=r"has not answered for 0.3 s.*repeat the command"):
        perform(planned(CELLS), tmp_path / "out", executor=executor)
    again = run_and_write(tmp_path / "out", CELLS)
    assert (again.runs.status == "ok").all()
