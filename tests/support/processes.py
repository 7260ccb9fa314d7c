"""Processes as Linux shows them; none elsewhere."""

import contextlib
import os
import time
from pathlib import Path


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
