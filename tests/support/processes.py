"""Processes as Linux shows them, none elsewhere; and what is done in one of its own."""

import contextlib
import importlib.util
import multiprocessing
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).parents[2]


def python(*arguments, cwd=None, fails=False, **environment):
    """Output and end of Python on this code, in a process of its own."""
    command, env = [sys.executable, *arguments], os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=cwd, env=env | environment, capture_output=True, text=True)
    assert fails == bool(done.returncode), done.stderr
    return done


def processes():
    """Parent, session, working folder and command of each, by id; without those that have ended."""
    processes = {}
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, parent, _, session = (place / "stat").read_text().rpartition(") ")[2].split()[:4]
            if state != "Z":
                folder, command = os.readlink(place / "cwd"), (place / "cmdline").read_text()
                processes[int(place.name)] = int(parent), int(session), folder, command
    return processes


def folders_of_session(number):
    """Where the processes of a session are."""
    return [folder for _, session, folder, _ in processes().values() if session == number]


def comes(condition):
    """Whether a condition comes true, for which a busy machine has ten minutes."""
    for _ in range(6000):
        if condition():
            return True
        time.sleep(0.1)
    return False


def started(what, *arguments):
    """A fork of this process, which has imported already what takes longest (a fresh one where
    there are none), that calls a function with an end of a pipe and these arguments; and the other
    end."""
    how = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    received, answers = how.Pipe(duplex=False)
    process = how.Process(target=what, args=(answers, *arguments))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of threads, which a fork does not have
        process.start()
    answers.close()
    return process, received


def apart(what, *arguments):
    """What a function of a module returns in a process of its own (:func:`started`). Raises
    ChildProcessError where it fails, after its traceback."""
    process, received = started(_say, what, arguments)
    try:
        return received.recv()
    except EOFError:
        raise ChildProcessError("it ended without an answer") from None
    finally:
        process.join()


def _say(answers, what, arguments):
    answers.send(what(*arguments))


def pythons():
    """Pythons of this machine by their minor version: this one, and those on the path and of pyenv,
    but no shims, which need not start."""
    by_minor = {sys.version_info[1]: [Path(sys.executable)]}
    places = map(Path, os.environ.get("PATH", "").split(os.pathsep))
    for place in (*places, *Path.home().glob(".pyenv/versions/*/bin")):
        for path in place.glob("python3.[0-9]*"):
            minor = path.name.removeprefix("python3.")
            if minor.isdigit() and "shims" not in path.parts:
                by_minor.setdefault(int(minor), []).append(path)
    return by_minor


def program(path):
    """The module of a file that imports others from its folder, as where it is run: modules of the
    same names from other folders are forgotten."""
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
    """Programs of a folder of ``studies/``."""
    return [program(ROOT / "studies" / study / f"{name}.py") for name in names]


def forget(*packages):
    """Have these imported anew."""
    for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[name]
