"""Prove a reward that no solution of a task exceeds.

    python studies/optima/prove.py ascending two-armed/v1/i000..i039
    python studies/optima/prove.py shelf.toml --nodes 2000

Tasks are the names of shipped tasks, ranges of instances, or files. The bound of a shipped task is
written into the shipped data, in which the sharper bound is kept. For any other task a good reward
is searched first (``optimum/search``), and the bound is only shown. It takes hours for many
tasks; ``--open`` leaves out what is proven, and what was tried with as many nodes.
"""

import argparse
import sys

import shipped
from certificate import certify

from coartic import CoarticError, execute, load_task
from coartic.baselines.optimum import OptimumSearch, with_locks
from coartic.method import run_method
from coartic.tasks.families import named_by
from coartic.tasks.optima import essence

NODES = 20_000
"""Cone programmes for each task, some 300 a second with five goals."""


def entries_of(task, known):
    """Return the shipped entries of a task that have a reward: one for each restriction."""
    same = essence(task)
    return [each for each in known.values() if each["essence"] == same and "reward" in each]


def searched(task):
    """Return an entry of the best solution that a search finds."""
    result, _ = run_method(OptimumSearch(), task)
    reward = execute(task, result.solution).reward
    base, other_arm = shipped.FREE
    return {"task": task.name, "base": base, "other_arm": other_arm, "reward": reward}


def is_open(entry, nodes):
    """Return whether an entry has no proof, and a bound of fewer nodes."""
    return entry.get("bound") != entry["reward"] and (entry.get("nodes") or 0) < nodes


def prove(task, entry, nodes):
    """Prove a bound with so many nodes; the entry keeps the sharper one."""
    still = entry["other_arm"] == "still"
    restricted = with_locks(task, entry["base"])
    ticks, _ = certify(restricted, -entry["reward"], nodes, still=still)
    if ticks:
        entry["bound"] = min(-ticks, entry.get("bound") or 0)
    entry["nodes"] = nodes


def in_words(entry):
    """Return a sentence about an entry."""
    restriction = (entry["base"], entry["other_arm"])
    which = "" if restriction == shipped.FREE else " (base {}, other arm {})".format(*restriction)
    bound, reward = entry.get("bound"), entry["reward"]
    proof = f"no solution exceeds {bound}" if bound else "nothing is proven"
    proof = "proven optimal" if bound == reward else proof
    return f"{entry['task']}{which}: {reward}, {proof}"


def proofs(names, nodes, open_alone):
    """Prove bounds for tasks and write them; yield a sentence for each.

    Raises CoarticError for a task that cannot be used.
    """
    known = shipped.read()
    for name in (each for text in names for each in named_by(text)):
        task = load_task(name)
        ships = entries_of(task, known)
        for entry in ships or [searched(task)]:
            if open_alone and not is_open(entry, nodes):
                continue
            prove(task, entry, nodes)
            if ships:
                shipped.write(known)
            yield in_words(entry)


def main():
    """Prove bounds for the tasks of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("tasks", nargs="+", metavar="TASK", help="name, range or file of a task")
    parser.add_argument("--nodes", type=int, default=NODES, help="cone programmes for each task")
    parser.add_argument("--open", action="store_true", help="leave out what is done")
    asked = parser.parse_args()
    try:
        for sentence in proofs(asked.tasks, asked.nodes, asked.open):
            print(sentence, flush=True)
    except CoarticError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
