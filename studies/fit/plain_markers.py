"""Markers of two simulated people, for the how-to: a simulator that does not use coartic.

    python studies/fit/plain_markers.py studies/fit/markers

writes a file for each person: places (m) of shoulder, elbow, wrist and hand, 100 a second, of two
sessions of trials by people who keep the best trial (:mod:`plain_person`) and rest for 50 ms at
each target. Places have noise of 0.001 of the arm's length; m1's elbow is lost once for 30 ms.
"""

import random
import sys
from pathlib import Path

from plain_person import LINKS, START, places, practise

NOISE, REST, GAP = 0.001 * sum(LINKS), 5, range(150, 153)
TRIALS = 12
MARKERS = ("right_1", "right_2", "right_3", "right_tip")


def samples(rng):
    """Yield trial, time (s) and places of the markers (m) of each sample."""
    q, clock, last = list(START), 0, 1
    for trial, _, _, _, moves in practise(False, TRIALS, rng):
        if trial > last:
            q, clock, last = list(START), 0, trial
        for steps, end in [*moves, (REST, moves[-1][1])]:
            for k in range(steps):
                here = [a + (b - a) * k / max(steps - 1, 1) for a, b in zip(q, end, strict=True)]
                yield trial, clock / 100, places(here)
                clock += 1
            q = end


def main(folder):
    """Write the recordings."""
    for subject in ("m1", "m2"):
        rng, noise = random.Random(subject), random.Random(f"{subject} noise")
        axes = ",".join(f"{name}_{axis}" for name in MARKERS for axis in "xy")
        lines = [f"subject,session,trial,time,{axes}"]
        for number, (trial, time, points) in enumerate(samples(rng)):
            at = [f"{x + noise.gauss(0, NOISE):.4f}" for point in points for x in point]
            if number in GAP and subject == "m1":
                at[2:4] = "", ""
            session = 1 if trial <= TRIALS / 2 else 2
            lines.append(f"{subject},{session},{trial},{time:.2f},{','.join(at)}")
        Path(folder, f"{subject}.csv").write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
