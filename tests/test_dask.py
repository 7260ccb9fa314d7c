"""Real Dask schedulers and workers, which are missing, killed, stopped and refused."""

import datetime
import functools
import ipaddress
import json
import logging
import logging.handlers
import os
import queue
import re
import signal
import socket
import threading
import time
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import dask
import pytest

from coartic import CoarticError
from coartic.benchmarks import cluster as cluster_module
from coartic.benchmarks.cluster import Dask
from tests.support.commands import call
from tests.support.nursery import Nursery
from tests.support.suites import paper_cells, run_and_write, same_tables, suite_of

LOOPBACK = ("--host", "127.0.0.1", "--no-dashboard")


SCHEDULER, WORKER = "distributed.cli.dask_scheduler", "distributed.cli.dask_worker"
CALLER = "tests.support.caller"


@pytest.fixture(scope="module")
def nursery():
    """Schedulers and workers begin as forks: to import Dask takes longer than all they do."""
    found = Nursery((SCHEDULER, WORKER, CALLER))
    yield found
    found.close()


class Process:
    """A module of Python's as a process with a session of its own and its output in a file."""

    def __init__(self, nursery, log, *command, environment):
        self.log = log
        with log.open("wb") as output, open(os.devnull, "rb") as nothing:
            streams = [file.fileno() for file in (nothing, output, output)]
            self.process = nursery.start(command, {**os.environ, **environment}, streams)

    @property
    def alive(self):
        return self.process.poll() is None

    def signal(self, number):
        os.killpg(self.process.pid, number)

    def kill(self):
        with suppress(ProcessLookupError):
            self.signal(signal.SIGKILL)
        self.process.wait()

    def wait_for(self, pattern, seconds=60):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = re.search(pattern, self.log.read_text(errors="replace"))
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"{pattern} not in {self.log.read_text(errors='replace')}")


class Cluster:
    """A scheduler on the loopback, and as many workers as a test asks for."""

    def __init__(self, nursery, folder, protocol="tcp", **environment):
        self._nursery = nursery
        self._folder, self._protocol = folder, protocol
        self._environment = {"DASK_DISTRIBUTED__WORKER__DAEMON": "False", **environment}
        self._scheduler, self._workers, self._started = None, [], 0

    def _start(self, *command):
        self._started += 1
        log = self._folder / f"{self._started}.log"
        return Process(self._nursery, log, *command, environment=self._environment)

    @property
    def scheduler(self):
        if self._scheduler is None or not self._scheduler.alive:
            options = (*LOOPBACK, "--protocol", self._protocol, "--port", "0", "--no-show")
            self._scheduler = self._start(SCHEDULER, *options)
        return self._scheduler

    @functools.cached_property
    def _pattern(self):
        return rf"Scheduler at:\s+({self._protocol}://127\.0\.0\.1:\d+)"

    @property
    def address(self):
        return self.scheduler.wait_for(self._pattern)[1]

    def workers(self, number):
        """Have exactly so many workers connected."""
        address, options = self.address, (*LOOPBACK, "--nthreads", "1", "--no-nanny")
        self._workers = [worker for worker in self._workers if worker.alive]
        for worker in self._workers[number:]:
            worker.kill()
        missing = number - len(self._workers)
        self._workers = self._workers[:number] + [
            self._start(WORKER, address, *options) for _ in range(missing)
        ]
        for worker in self._workers:
            worker.wait_for(f"Registered to:\\s+{address}")
        return list(self._workers)

    def close(self):
        for process in [*self._workers, self._scheduler]:
            if process is not None:
                process.kill()


@pytest.fixture(scope="module")
def shared(nursery, tmp_path_factory):
    made = Cluster(nursery, tmp_path_factory.mktemp("cluster"))
    yield made
    made.close()


@pytest.fixture
def cluster(shared):
    """The shared cluster, without workers of a scheduler that an earlier test killed."""
    if not shared.scheduler.alive:
        shared.close()
    return shared


@pytest.fixture
def quick(monkeypatch):
    """Jobs that only wait for a file, and a scheduler that is asked often."""

    def wait_for_file(job):
        import time
        from pathlib import Path

        while job["file"] and not Path(job["file"]).exists():
            time.sleep(0.01)
        return {"run_id": job["run_id"]}

    monkeypatch.setattr(cluster_module, "supervise", wait_for_file)
    monkeypatch.setattr(cluster_module, "_ASK_EVERY_S", 0.1)
    monkeypatch.setattr(cluster_module, "_SAY_EVERY_S", 0.25)
    monkeypatch.setattr(cluster_module, "_CLOSE_S", 0.2)


@pytest.fixture
def held(tmp_path):
    """What a job waits for; there when the test is over, or its worker would wait for ever."""
    file = tmp_path / "held"
    yield file
    file.touch()


def jobs(number, file=""):
    return [{"run_id": f"{n} {file}".strip(), "file": str(file)} for n in range(number)]


def test_without_workers_it_says_so_and_gives_up(cluster, quick):
    cluster.workers(0)
    said, clock = [], time.monotonic()
    executor = Dask(cluster.address, workers_s=0.6, say=said.append)
    with pytest.raises(CoarticError, match=r"no Dask worker was connected .* for 0\.6 s; start"):
        list(executor.perform(jobs(3)))
    assert time.monotonic() - clock < 5
    calls, *waits = said
    assert calls == f"calling the Dask scheduler at {cluster.address}: 30 s at most"
    assert waits[0] == f"no Dask worker is connected to {cluster.address}: waiting, 1 s at most"
    assert len(waits) == 2


def test_workers_may_come_late_die_and_come_again(cluster, quick, held):
    cluster.workers(0)
    said = []

    def say(line):
        said.append(line)
        if line.startswith("no Dask worker"):
            cluster.workers(1)
            if len(said) > 2:
                held.touch()

    answers = Dask(cluster.address, workers_s=60, say=say).perform([*jobs(1), *jobs(1, held)])
    assert next(answers) == {"run_id": "0"}
    waits = f"no Dask worker is connected to {cluster.address}: waiting, 60 s at most"
    comes = f"Dask workers are connected to {cluster.address}"
    assert said[1:] == [waits, comes]
    cluster.workers(0)
    assert list(answers) == [{"run_id": f"0 {held}"}]
    assert said[1:] == [waits, comes] * 2


def test_workers_that_all_die_and_stay_away(cluster, quick, held):
    cluster.workers(2)
    executor = Dask(cluster.address, workers_s=0.3)
    answers = executor.perform([*jobs(1), *jobs(1, held)])
    assert next(answers) == {"run_id": "0"}
    cluster.workers(0)
    with pytest.raises(CoarticError, match="what is done is kept, and the same command"):
        list(answers)


def test_ctrl_c_ends_the_wait_for_workers(cluster, quick):
    def say(line):
        if line.startswith("no Dask worker"):
            signal.raise_signal(signal.SIGINT)

    cluster.workers(0)
    with pytest.raises(KeyboardInterrupt):
        list(Dask(cluster.address, say=say).perform(jobs(1)))


def answering(answer):
    def work(job):  # within a function: Dask then sends it instead of this module's name
        if isinstance(answer, Exception):
            raise answer
        return answer

    return work


@pytest.mark.parametrize(
    "answer",
    [
        ModuleNotFoundError("No module named \x1b[31m'benchmarks'\nat all"),
        "done",
        {"run_id": "another"},
    ],
)
def test_workers_that_cannot_perform_runs_are_said_so(cluster, quick, monkeypatch, answer):
    monkeypatch.setattr(cluster_module, "supervise", answering(answer))
    cluster.workers(1)
    with pytest.raises(CoarticError, match="install the same version of coartic on") as caught:
        list(Dask(cluster.address).perform(jobs(2)))
    assert str(caught.value).isprintable()


def test_results_equal_the_local_ones_though_a_worker_dies(cluster, tmp_path):
    cells = paper_cells(tasks=["two-armed-1", "ascending"])
    local = run_and_write(tmp_path / "local", cells, runs=3, trials=100)
    seen = []
    workers = cluster.workers(2)

    def watch(progress, spec):
        if spec is not None:
            seen.append(spec.run_id)
        if len(seen) == 3 and workers[0].alive:
            threading.Thread(target=workers[0].kill).start()

    far = run_and_write(
        tmp_path / "far", cells, runs=3, trials=100, executor=Dask(cluster.address), watch=watch
    )
    assert [worker.alive for worker in workers] == [False, True]
    assert len(seen) == len(set(seen)) == 12
    same_tables(far, local)


def test_instances_of_families_reach_a_worker_whole(cluster, tmp_path):
    """Tasks that no file has."""
    cells = suite_of(
        tmp_path,
        'tasks = ["two-armed/v1/i003", "aligned/v1/i000"]\n'
        'methods = ["dual-process/EC4", "corrective-alone/given"]',
    )
    local = run_and_write(tmp_path / "local", cells, runs=2, trials=50)
    cluster.workers(1)
    far = run_and_write(tmp_path / "far", cells, runs=2, trials=50, executor=Dask(cluster.address))
    assert len(far.runs) == 6
    same_tables(far, local)


def test_a_worker_of_another_version_is_said_so(cluster, tmp_path):
    class Elsewhere(Dask):
        def perform(self, jobs):
            return super().perform([{**job, "code": "c0ffee"} for job in jobs])

    cluster.workers(1)
    with pytest.raises(CoarticError, match="c0ffee where the suite was started; install the same"):
        run_and_write(tmp_path, paper_cells(), runs=1, executor=Elsewhere(cluster.address))


@pytest.fixture
def logged():
    """What reaches the handlers of Dask's loggers, which write on the terminal."""
    records = queue.SimpleQueue()
    handler = logging.handlers.QueueHandler(records)
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "asyncio")]
    for logger in loggers:
        logger.addHandler(handler)
    yield records
    for logger in loggers:
        logger.removeHandler(handler)


@pytest.mark.parametrize("how", [signal.SIGSTOP, signal.SIGKILL])
def test_a_scheduler_that_goes_away_is_said_so(cluster, quick, held, how, logged):
    cluster.workers(1)
    scheduler, executor = cluster.scheduler, Dask(cluster.address)
    answers = executor.perform([*jobs(1), *jobs(1, held)])
    assert next(answers) == {"run_id": "0"}
    executor.scheduler_s = 0.5
    clock = time.monotonic()
    scheduler.signal(how)
    try:
        with pytest.raises(CoarticError, match=r"lost the Dask scheduler .* what is done is kept"):
            list(answers)
    finally:
        with suppress(ProcessLookupError):
            scheduler.signal(signal.SIGCONT)
    assert time.monotonic() - clock < 10
    assert logged.empty()


@contextmanager
def other_services():
    """Ports of a web server, of one that says nothing, and of one that says anything."""

    class Web(BaseHTTPRequestHandler):
        def log_message(self, *_):
            pass

    def chat():
        with suppress(OSError):
            while True:
                connection, _ = chatty.accept()
                connection.sendall(bytes(range(256)) * 100)
                connection.close()

    with (
        ThreadingHTTPServer(("127.0.0.1", 0), Web) as web,
        socket.create_server(("127.0.0.1", 0)) as mute,
        socket.create_server(("127.0.0.1", 0)) as chatty,
    ):
        threading.Thread(target=web.serve_forever, daemon=True).start()
        threading.Thread(target=chat, daemon=True).start()
        yield {
            "web": web.server_address[1],
            "mute": mute.getsockname()[1],
            "chatty": chatty.getsockname()[1],
        }
        chatty.shutdown(socket.SHUT_RDWR)
        web.shutdown()


CALLERS = 4  # at once: they wait more than they do
PORT = "missing port number"
SCHEME = "unknown address scheme"
NAMED = "Name or service not known|Servname not supported|No address|name resolution"
WRONG_ADDRESSES = {  # and what is said of them
    "": f"an empty address .*{PORT}",
    "tcp://127.0.0.1": PORT,
    "scheduler.json": PORT,
    "\x1b[31mred\n": rf"\\x1b\[31mred .*{PORT}",
    "tcp://" + "a" * 5000: f"{'a' * 100}.*{PORT}",
    "tcp://127.0.0.1:port": "invalid literal",
    "tcp://127.0.0.1:-1": NAMED,
    "tcp://127.0.0.1:1": "refused|no answer within 0.5 s",
    "tcp://127.0.0.1:99999999": "refused|no answer|OverflowError|Servname",
    "tcp://a..b:8786": "label empty or too long",
    "tcp://[::1": "needs brackets",
    "tcp://{web}": "no answer within 0.5 s|MemoryError|CommClosedError|StreamClosedError",
    "tcp://{mute}": "no answer within 0.5 s",
    "tcp://{chatty}": "MemoryError|ValueError|StreamClosedError",
    "ws://{web}": "no answer within 0.5 s|404|501|WebSocket",
    "tls://{web}": "certificates: docs/cluster.md",
    "tls://127.0.0.1:1": "certificates: docs/cluster.md",
    "http://{web}": SCHEME,
    "gateway://127.0.0.1:1": SCHEME,
    "ucx://127.0.0.1:1": "install distributed-ucxx, or use tcp://host:port",
    "inproc://127.0.0.1/1/1": "inproc address",
    "inproc://": "such as tcp://127.0.0.1:8786",
}


def test_wrong_addresses_get_a_sentence_each_and_nothing_else(nursery, tmp_path):
    with other_services() as ports:
        places = {name: f"127.0.0.1:{port}" for name, port in ports.items()}
        addresses = [
            re.sub(r"\{(\w+)\}", lambda found: places[found[1]], address)
            for address in WRONG_ADDRESSES
        ]
        callers = [
            Process(
                nursery, tmp_path / f"{first}.log", CALLER, json.dumps(addresses[first::CALLERS]),
                environment={},
            )
            for first in range(CALLERS)
        ]  # fmt: skip
        assert [caller.process.wait(120) for caller in callers] == [0] * CALLERS
    said = [caller.log.read_text(encoding="utf-8").splitlines() for caller in callers]
    answers = [json.loads(said[n % CALLERS].pop(0)) for n in range(len(addresses))]
    assert not any(said)
    for (sentence, seconds), pattern in zip(answers, WRONG_ADDRESSES.values(), strict=True):
        assert re.match(f"no Dask scheduler at .*({pattern})", sentence), sentence
        assert sentence.isprintable()
        assert len(sentence) < 700
        assert seconds < 5


@pytest.mark.parametrize("address", ["", "ucx://127.0.0.1:1"])
def test_a_wrong_address_ends_the_command_with_exit_code_2(monkeypatch, capsys, tmp_path, address):
    code, out, error = call(
        monkeypatch, capsys, "run", "quick", "--out", tmp_path / "out", "--scheduler", address
    )
    assert (code, out) == (2, "")
    calls, sentence = filter(None, error.splitlines())
    assert calls.startswith("calling the Dask scheduler at ")
    assert sentence.startswith("Error: no Dask scheduler at ")


def certificate(folder, name, authority=None):
    """Files with a new key and its certificate, signed by an authority (or by itself)."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    issuer, signer = authority or (subject, key)
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder(issuer, subject, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(hours=1))
        .add_extension(x509.BasicConstraints(ca=authority is None, path_length=None), True)
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), False
        )
        .sign(signer, hashes.SHA256())
    )
    (folder / f"{name}.crt").write_bytes(made.public_bytes(serialization.Encoding.PEM))
    (folder / f"{name}.key").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return subject, key


def tls(folder, authority, name, *roles):
    """Dask's configuration: the authority that is trusted, and what each role shows."""
    settings = {"distributed.comm.tls.ca-file": str(folder / f"{authority}.crt")}
    for role in roles:
        settings[f"distributed.comm.tls.{role}.cert"] = str(folder / f"{name}.crt")
        settings[f"distributed.comm.tls.{role}.key"] = str(folder / f"{name}.key")
    return settings


def as_environment(settings):
    """As docs/cluster.md says: DASK_, and two underscores for a dot."""
    return {
        "DASK_" + key.upper().replace(".", "__").replace("-", "_"): value
        for key, value in settings.items()
    }


def test_over_tls_runs_are_performed_and_strangers_are_refused(nursery, quick, tmp_path):
    certificate(tmp_path, "node", certificate(tmp_path, "authority"))
    certificate(tmp_path, "stranger", certificate(tmp_path, "other"))
    ours = tls(tmp_path, "authority", "node", "scheduler", "worker", "client")
    secured = Cluster(nursery, tmp_path, "tls", **as_environment(ours))
    try:
        address = secured.address
        strangers = {
            "no certificate": {},
            "authority alone": tls(tmp_path, "authority", "node"),
            "another authority's": tls(tmp_path, "other", "stranger", "client"),
            "trusts us, signed by another": tls(tmp_path, "authority", "stranger", "client"),
        }
        for settings in strangers.values():
            with dask.config.set(settings), pytest.raises(CoarticError, match="certificates: doc"):
                list(Dask(address, scheduler_s=5).perform(jobs(1)))
        with pytest.raises(CoarticError, match="no Dask scheduler at tcp://"):
            list(Dask(address.replace("tls", "tcp"), scheduler_s=5).perform(jobs(1)))
        secured.workers(1)
        with dask.config.set(ours):
            assert list(Dask(address).perform(jobs(1))) == [{"run_id": "0"}]
    finally:
        secured.close()
