"""Look at processes (only on Linux), and call functions in separate processes."""

import contextlib
import importlib.util
import multiprocessing
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def python(*arguments, cwd=None, fails=False, **environment):
    """Run Python with these arguments in a new process, and return the completed process."""
    command, env = [sys.executable, *arguments], os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=cwd, env=env | environment, capture_output=True, text=True)
    assert fails == bool(done.returncode), done.stderr
    return done


def processes():
    """Return parent, session, working folder and command of each running process, by its id."""
    processes = {}
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, parent, _, session = (place / "stat").read_text().rpartition(") ")[2].split()[:4]
            if state != "Z":
                folder, command = os.readlink(place / "cwd"), (place / "cmdline").read_text()
                processes[int(place.name)] = int(parent), int(session), folder, command
    return processes


def folders_of_session(number):
    """Return the working folders of the processes of a session."""
    return [folder for _, session, folder, _ in processes().values() if session == number]


def comes(condition):
    """Return True as soon as a condition is true, or False after ten minutes."""
    for _ in range(6000):
        if condition():
            return True
        time.sleep(0.1)
    return False


def started(what, *arguments):
    """Start a process that calls a function with one end of a pipe and these arguments.

    Returns the process and the other end of the pipe. On Linux the process is a fork, which has
    already imported the slow modules; elsewhere it is a new process.
    """
    how = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    received, answers = how.Pipe(duplex=False)
    process = how.Process(target=what, args=(answers, *arguments))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns that a fork does not copy threads
        process.start()
    answers.close()
    return process, received


def apart(what, *arguments):
    """Call a function of a module in a separate process (:func:`started`), and return its result.

    If the function fails, the process prints a traceback, and ChildProcessError is raised.
    """
    process, received = started(_say, what, arguments)
    try:
        return received.recv()
    except EOFError:
        raise ChildProcessError("it ended without an answer") from None
    finally:
        process.join()


def _say(answers, what, arguments):
    answers.send(what(*arguments))


at_release = pytest.mark.skipif(
    os.environ.get("COARTIC_PACKAGES") != "1", reason="only for a release: COARTIC_PACKAGES=1"
)


def pythons():
    """Return the paths of this machine's Pythons by their minor version.

    They are this Python, and those on the path and of pyenv. Shims are left out, because they may
    not start.
    """
    by_minor = {sys.version_info[1]: [Path(sys.executable)]}
    places = map(Path, os.environ.get("PATH", "").split(os.pathsep))
    for place in (*places, *Path.home().glob(".pyenv/versions/*/bin")):
        for path in place.glob("python3.[0-9]*"):
            minor = path.name.removeprefix("python3.")
            if minor.isdigit() and "shims" not in path.parts:
                by_minor.setdefault(int(minor), []).append(path)
    return by_minor


def program(path):
    """Import a file that imports modules from its folder, as if it were run, and return its module.

    Modules of the same names from other folders are removed from ``sys.modules``.
    """
    for other in path.parent.glob("*.py"):
        if getattr(sys.modules.get(other.stem), "__file__", None) != str(other):
            sys.modules.pop(other.stem, None)
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(f"{path.parent.name}_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def programs(study, *names):
    """Return the modules of some files of a folder of ``studies/``."""
    return [program(ROOT / "studies" / study / f"{name}.py") for name in names]


def forget(*packages):
    """Remove packages from ``sys.modules``, so that they are imported again."""
    for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[name]


def begin_after_deaths(folder, workers, verbose):
    """Set up a worker of a suite, as ``pool._begin`` does; the first two are killed."""
    from coartic.benchmarks.pool import _begin

    for number in range(2):
        with contextlib.suppress(FileExistsError):
            (folder / f"dead{number}").touch(exist_ok=False)
            os.kill(os.getpid(), 9)
    _begin(folder, workers, verbose)


def begin_never(*_):
    """End a worker before it has a job."""
    os._exit(1)
