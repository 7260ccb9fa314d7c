"""Prove rewards that no solution of tasks exceeds, and log them.

    python studies/optima/prove.py two-armed/v1/i000..i039 two-armed-1 --processes 2
    python studies/optima/prove.py shelf.toml --seconds 20

Tasks are the names of shipped tasks, ranges of instances, or files. Each proof is appended to the
log when it ends, with a solution if a better one was found. A command that was stopped can be
repeated. It leaves out tasks whose optimum is proven, and tasks that the log has with at least as
many seconds.
"""

import argparse
import json
import math
import sys
from concurrent.futures import as_completed
from pathlib import Path

import shipped
from certificate import certify

from coartic import PAPER, CoarticError, MethodError, execute, load_task
from coartic.baselines.optimum import OptimumSearch, with_locks
from coartic.baselines.shortest_paths import REWARD_INFORMATION, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.benchmarks.pool import process_pool
from coartic.method import Session, run_method
from coartic.tasks.families import named_by
from coartic.tasks.optima import task_hash

SECONDS = 100
"""CPU time for each task, in s. With five goals, about 500 cone programmes take a second."""
CHAINS = 20
"""Number of open subproblems from which better solutions are searched."""


def entries_of(name, known, pool):
    """Return the entries of a task that have a reward, one for each restriction.

    If no reward is shipped, a search for the optimum is run in a process of ``pool``, and the entry
    of its best solution is returned.
    """
    same = task_hash(load_task(name))
    entries = [entry for entry in known.values() if entry["essence"] == same and "reward" in entry]
    if entries:
        return entries
    base, other_arm = shipped.FREE
    reward = pool.submit(best_found, name).result()
    return [{"task": name, "base": base, "other_arm": other_arm, "reward": reward}]


def best_found(name):
    """Return the best reward that a search for the optimum of a task finds."""
    task = load_task(name)
    result, _ = run_method(OptimumSearch(), task)
    return execute(task, result.solution).reward


def distance(entry):
    """Return the distance of a bound from the reward, as a share; infinite without a bound."""
    bound = entry.get("bound")
    return math.inf if bound is None else (bound - entry["reward"]) / max(-entry["reward"], 1)


def prove(entry, seconds):
    """Make a proof within ``seconds`` of CPU time, and return its row of the log.

    The row has the bound, the number of nodes and the seconds, and a solution if a better one was
    found.
    """
    task, still = load_task(entry["task"]), entry["other_arm"] == "still"
    restricted = with_locks(task, entry["base"])
    proof = certify(restricted, -entry["reward"], most_seconds=seconds, still=still)
    chains = proof.chains(CHAINS)
    better = polished(restricted, chains, still) if chains else None
    row = {key: entry[key] for key in ("task", "base", "other_arm", "reward")}
    row |= {"bound": -proof.ticks, "nodes": proof.nodes, "seconds": round(proof.seconds, 2)}
    if better is not None and better.execution.reward > entry["reward"]:
        reward = better.execution.reward
        row |= {"reward": reward, "hands": better.execution.hands}
        row["solution"] = shipped.solution_in_short(task, better.movements, reward)
    return row | {"asked": seconds}


def polished(task, chains, still):
    """Return the solution with the fewest ticks that is found from the starts ``chains``.

    The result is a PlanInTicks, or None if no solution is found. If ``still``, the idle arm must
    not move.
    """
    session = Session(task, 0, REWARD_INFORMATION, model=PAPER, trusted=True)
    problem = trajectory_problem(task.robot, task.hands, len(task.goals), "path-length")
    try:
        plans = shortest_plans(session, task, problem, chains, still=still)
        return fewest_ticks(session, task, problem, plans)
    except MethodError:
        return None


def describe_row(row):
    """Return a sentence about a row of the log."""
    is_proven, more = (
        row["bound"] == row["reward"],
        (", a better solution" if "solution" in row else ""),
    )
    proof = "proven optimal" if is_proven else f"no solution exceeds {row['bound']}"
    words = "{task} (base {base}, other arm {other_arm}): {reward}, {proof}, {nodes} programmes, "
    return f"{words}{{seconds}} s{more}".format(**row, proof=proof)


def prove_all(names, seconds, folder, processes):
    """Prove bounds for tasks, log them, and print a sentence for each.

    Tasks whose bound is nearest to the reward come first.
    """
    known, done = shipped.read(), set()
    for row in shipped.read_log(folder):
        shipped.take_proof(known, row)
        if row["asked"] >= seconds:
            done.add(shipped.key_of(row))
    named = [each for text in names for each in named_by(text)]
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / shipped.LOG
    with process_pool(processes) as pool, log.open("a", encoding="ascii") as file:
        entries = [entry for name in named for entry in entries_of(name, known, pool)]
        entries = [e for e in entries if distance(e) and shipped.key_of(e) not in done]
        tasks = [pool.submit(prove, e, seconds) for e in sorted(entries, key=distance)]
        for task in as_completed(tasks):
            file.write(f"\n{json.dumps(task.result())}\n")  # a line may have been cut off
            file.flush()
            print(describe_row(task.result()), flush=True)


def main():
    """Prove bounds for the tasks of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("tasks", nargs="+", metavar="TASK", help="name, range or file of a task")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="CPU time for each task")
    parser.add_argument("--out", type=Path, default=shipped.OUT, help="folder of the log")
    parser.add_argument("--processes", type=int, default=1, help="tasks at the same time")
    asked = parser.parse_args()
    try:
        prove_all(asked.tasks, asked.seconds, asked.out, asked.processes)
    except CoarticError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
