"""Make the table of postures of seven people from the public files.

    python studies/people/make_table.py FOLDER

FOLDER has the files ``S01_trajs.mat`` to ``S07_trajs.mat`` of HuG-MP (MIT licence, see
``postures.LICENSE``). The table ``postures.csv`` has a row for each person, target, context and
repeat: joint angles in degrees at the start of the reach, at its end, and at the end of the next
movement. In ``carry_over_postures.csv`` the context is not what comes next, but the target (or
rest) at which the reach starts; the next movement always goes to rest.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

ADDRESS = "https://github.com/TUM-ITR/HuG-MP"
COMMIT = "78dc65418a12b2be141ed0f83113e7c53590e702"
IN_REPOSITORY = "dataset/dataset/processed_dataset"
PEOPLE = range(1, 8)
REST = "R"
REACHES = {
    (1, "12"): (1, 1),
    (1, REST): (4, 1),
    (9, "11"): (2, 4),
    (9, REST): (4, 5),
    (11, "9"): (3, 4),
    (11, REST): (4, 7),
}
"""By target and context (the next target, or rest): the task, and its motion, in which the target
is reached from rest. Both are counted from 1, as in the description of the data set."""
AFTER = {
    (9, "4"): (1, 5),
    (9, "11"): (3, 5),
    (9, REST): (4, 5),
    (11, "9"): (2, 5),
    (11, REST): (4, 7),
}
"""By target and context (the target before, or rest): the task, and its motion, in which the target
is reached. The motion that follows goes to rest."""
TABLES = {"postures": REACHES, "carry_over_postures": AFTER}
POSTURES = [f"{posture}_{joint}" for posture in ("start", "end", "next") for joint in range(1, 5)]


def postures_of(tasks, person, reaches=REACHES):
    """Return a row for each repeat of each of some reaches of a person.

    ``tasks`` has shape (repeats, tasks). An entry is a list of motions, which are arrays of shape
    (4, samples). Empty entries are left out.
    """
    rows = []
    for (target, context), (task, motion) in reaches.items():
        for repeat, motions in enumerate(tasks[:, task - 1], 1):
            if np.size(motions):
                reach, following = motions[motion - 1], motions[motion]
                angles = np.concatenate([reach[:, 0], reach[:, -1], following[:, -1]])
                named = {"person": person, "target": target, "context": context, "repeat": repeat}
                rows.append(named | dict(zip(POSTURES, angles, strict=True)))
    return rows


def make_table(folder, reaches=REACHES):
    """Return the table of some reaches of all people. Raises SystemExit if a file is missing."""
    rows = []
    for person in PEOPLE:
        path = Path(folder) / f"S{person:02d}_trajs.mat"
        if not path.is_file():
            raise SystemExit(
                f"{path} does not exist. Get the seven files S01_trajs.mat to S07_trajs.mat from "
                f"{ADDRESS} (commit {COMMIT[:8]}, folder {IN_REPOSITORY}), and put them into the "
                f"folder {folder}."
            )
        rows += postures_of(loadmat(path, squeeze_me=True)["tasks"], person, reaches)
    return pd.DataFrame(rows).set_index("person")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    for name, reaches in TABLES.items():
        make_table(sys.argv[1], reaches).to_csv(
            Path(__file__).with_name(f"{name}.csv"), float_format="%.6g", lineterminator="\n"
        )
