"""Compiled code is never older than the sources it comes from."""

import os
import shutil
import sys

import numba
import numpy as np
import pytest

from tests.support.processes import ROOT, apart, forget

pytestmark = pytest.mark.process

KERNEL = """
from coartic.motion.kernels.compile import entry, joint_lever

@entry
def across(xs, ys):
    _, dy = joint_lever(xs, ys, 0, 1)
    return dy
"""


def write_kernel(folder):
    """The kernel, beside a copy of the package that it is compiled with."""
    ignored = shutil.ignore_patterns("__pycache__", "analysis", "baselines", "benchmarks", "cli")
    shutil.copytree(ROOT / "coartic", folder / "coartic", ignore=ignored)
    (folder / "kernel.py").write_text(KERNEL, encoding="utf-8")


def lever(folder):
    """What the kernel computes in a process of its own, by the packages there, and how often it
    was loaded."""
    forget("coartic")
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    from kernel import across, joint_lever

    with pytest.raises(TypeError, match="lever can only be called by other kernels"):
        joint_lever(np.zeros(2), np.zeros(2), 0, 1)
    dy = across(np.array([1.0, 6.5]), np.zeros(2))
    return float(dy), sum(across.dispatcher.stats.cache_hits.values())


def test_what_is_kept_follows_changes_and_survives_damage(tmp_path):
    """Another file than the cached function's changes; the result follows. A full disk, say, cuts
    the index short, or the code."""
    write_kernel(tmp_path)
    assert apart(lever, tmp_path) == (5.5, 0)
    for ending, share in (("nbi", 0.5), ("nbc", 0.99)):
        files = list((tmp_path / "coartic" / "__pycache__").rglob(f"*.{ending}"))
        assert files
        for path in files:
            os.truncate(path, int(share * path.stat().st_size))
        assert apart(lever, tmp_path) == (5.5, 0)
    assert apart(lever, tmp_path) == (5.5, 1)
    robot = tmp_path / "coartic" / "robot.py"
    text = robot.read_text(encoding="utf-8")
    assert text.count("xs[tip] - xs[joint]\n") == 1
    robot.write_text(
        text.replace("xs[tip] - xs[joint]\n", "xs[tip] - 0.5 * xs[joint]\n"), encoding="utf-8"
    )
    assert apart(lever, tmp_path) == (6.0, 0)


SLOTS = """
from coartic import Robot
from coartic.motion.kernels.compile import entry, inner
from coartic.motion.kernels.slots import batch_for

@inner
def add_links(slots):
    for k in range(len(slots.length)):
        for slot in range(72):
            slots.x[k + 1, slot] = slots.x[k, slot] + slots.length[k, slot]

@entry
def length(slots):
    add_links(slots[0])
    return slots[0]["x"][-1, 0]

def reach_of(links):
    slots = batch_for(Robot(left_links=(1.0,) * links, right_links=(1.0,) * links)).slots
    slots["length"][:] = 1.0
    return length(slots)
"""


def reaches(folder, numbers):
    """Of straight arms of so many unit links, and how often their kernel was loaded from a folder
    where it is kept."""
    forget("coartic")
    numba.config.CACHE_DIR = str(folder)
    sys.path.insert(0, str(folder))
    from slots import length, reach_of

    return [reach_of(links) for links in numbers], sum(length.dispatcher.stats.cache_hits.values())


def test_machine_code_of_several_processes_goes_together(tmp_path):
    """Each compiles for a number of links; one that loads all of it knows all robots. Up to four
    links share the code of four, up to eight the code of eight."""
    (tmp_path / "slots.py").write_text(SLOTS, encoding="utf-8")
    for links in (8, 4):
        assert apart(reaches, tmp_path, [links]) == ([links], 0)
    assert apart(reaches, tmp_path, [1, 3, 5]) == ([4, 4, 8], 2)
