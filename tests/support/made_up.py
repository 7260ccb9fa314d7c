"""Rows of runs that nobody ran, for what is computed of them."""

import pandas as pd

from analysis.results.folder import Results
from coartic import load_task


def row(method, reward, *, task="two-armed-1", run=0, travel=0.0, status="ok", **more):
    return {
        "task": task, "method": method, "variant": "", "run": run, "status": status,
        "run_id": f"{method}-{run}", "reason": "", "reward": reward, "hands": "LRLR",
        "told": "corrective process, reward by trial", "parameters": "{}", "trials": 10,
        "movement_ticks": 5000, "forward_kinematics": 1_234_567, "jacobians": 950,
        "solver_iterations": 0, "build_s": 0.5, "solve_s": 0.25, "wall_s": 1.0, "warm": run > 0,
        "solution_corrections": 0, "other_arm_travel": travel, "proven_bound": None, **more,
    }  # fmt: skip


def fake_results(tmp_path, runs):
    manifest = {
        "specification": {
            "suite": "paper", "runs": 3, "trials": 10_000, "seed": 0,
            "tasks": {"two-armed-1": load_task("two-armed-1").model_dump(mode="json")},
            "cells": [{"task": "two-armed-1", "method": "dual-process/EC2", "variant": ""}],
        },
        "environment": {
            "coartic": "0", "commit": {"id": "abc", "dirty": True}, "model_code": "code",
            "python": "3", "platform": "here", "date": "today",
        },
    }  # fmt: skip
    frame = pd.DataFrame(runs).assign(
        task="two-armed-1", method="dual-process/EC2", variant="", commit="abc", packages="p"
    )
    frame = frame.assign(trials=10_000, failed_trials=[7] + [0] * (len(frame) - 1))
    frame = frame.assign(
        told="corrective process, reward by trial", parameters="{}", other_arm_travel=1.0,
        movement_ticks=1, forward_kinematics=1, jacobians=1, solver_iterations=0, build_s=0.0,
        solve_s=0.1, wall_s=0.2, warm=True, solution_corrections=0, proven_bound=None,
    )  # fmt: skip
    frame = frame.astype({"reward": "Int64", "initial_reward": "Int64"})
    sequences = pd.DataFrame({"task": [], "hands": [], "reward": [], "reason": []})
    return Results(tmp_path, manifest, frame, sequences)
