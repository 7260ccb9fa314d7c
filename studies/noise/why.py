"""Describe why noise costs ticks: how far methods aim from the goals, and what their hits save."""

import pandas as pd
from order import NOISE


def tabulate_why(gaps, rows):
    """Return aims and costs of noise by method, in ticks for a task.

    - ``off``: median distance of an aim from the centre of its goal, in radii of the goal;
    - ``aims``: mean ticks that noise of 0.01 costs the solution as it aims;
    - ``hits``: the same at the postures in which it hits;
    - ``free``: what movements to these postures cost without noise.
    """
    name = gaps.drop_duplicates("run_id").set_index("run_id").name
    rows = rows[rows.question == "practised"]
    column = rows.target + (rows.motor_noise == NOISE).map({True: "1", False: "0"})
    ticks = rows.assign(column=column).pivot_table("ticks", ["run_id", "task"], "column")
    off = rows.groupby(["run_id", "task"]).off.first()
    costs = pd.DataFrame({
        "off": off, "aims": ticks["T1"] - ticks["T0"], "hits": ticks["P1"] - ticks["P0"],
        "free": ticks["P0"] - ticks["T0"],
    })  # fmt: skip
    costs["name"] = costs.index.get_level_values("run_id").map(name)
    by_task = costs.groupby(["name", "task"]).agg(
        off=("off", "median"), aims=("aims", "mean"), hits=("hits", "mean"), free=("free", "mean")
    )
    by_name = by_task.groupby("name", sort=False)
    return by_name[["aims", "hits", "free"]].mean().assign(off=by_name.off.median())
