"""Four simulated people in metres, for the how-to: a simulator that does not use coartic.

    python studies/fit/plain_person.py studies/fit

A right arm (upper arm, forearm, hand) practises four targets of 1 cm. p1 keeps the best trial; p2
averages: what is kept moves half the way to each better trial, as none of the six models does.
metres.csv has the duration in s (100 control steps) and joint angles with motor noise of 0.005 rad.

m1 and m2, with a file each in markers, keep the best trial, and rest for 50 ms at each target:
places (m) of shoulder, elbow, wrist and hand, 100 a second, of two sessions, with noise of 0.001 of
the arm's length; m1's elbow is lost once for 30 ms.
"""

import math
import random
import sys
from pathlib import Path

import numpy as np

LINKS, START, CLUMSY = np.array([(0.33, 0.27, 0.09), (0.6, 1.4, 0.5), (0.3, -0.3, -0.6)])
GOALS, RADIUS = (0.05 + 0.45j, 0.25 + 0.40j, 0.20 + 0.25j, -0.05 + 0.35j), 0.01
STEP, GAIN, EXPLORATION, MOTOR = 0.01, 0.05, 0.05, 0.005
MARKERS = ("right_1", "right_2", "right_3", "right_tip")
NOISE, REST, GAP, TRIALS = 0.001 * sum(LINKS), 5, range(150, 153), 12
"""Recordings of markers: noise (SD), samples at rest, samples without a marker, and trials."""


def places(q):
    """Return the places of shoulder, elbow, wrist and hand as x + iy, shape ``(..., 4)``."""
    links = LINKS * np.exp(1j * np.cumsum(q, axis=-1))
    return np.concatenate([0 * links[..., :1], np.cumsum(links, axis=-1)], axis=-1)


def move(q, target, goal, stops):
    """Return the posture where a straight movement ends, and its control steps. It ends where the
    hand hits the goal or the target is reached; with ``stops`` also where the hand is nearly as at
    the target."""
    way = math.dist(q, target)
    shares = np.minimum(np.arange(math.ceil(way / STEP) + 1) * STEP / (way or 1.0), 1.0)
    postures = q + shares[:, None] * (target - q)
    hand = places(postures)[:, -1]
    ends = (abs(hand - goal) <= RADIUS) | (stops & (abs(hand - hand[-1]) <= RADIUS / 10))
    ends[-1] = True
    return postures[ends.argmax()], int(ends.argmax()) + 1


def correct(q, goal):
    """Return the posture that descent on the distance to the goal finds."""
    while abs(error := goal - (points := places(q))[-1]) > RADIUS / 10:
        q = q + GAIN * ((points[-1] - points[:-1]).conj() * error).imag
    return q


def practise(averages, trials, rng):
    """Yield trial, goal (both from 1), duration (s) and recorded posture (rad) of each hit, and its
    movements, as pairs of control steps and the posture at the end; trial 1 is clumsy. With
    ``averages`` what is kept moves half the way to each better trial."""
    kept, best = [], math.inf
    for trial in range(1, trials + 1):
        q, hits = START, []
        for number, goal in enumerate(GOALS):
            target = q + CLUMSY
            if kept:
                target = kept[number] + [rng.gauss(0, EXPLORATION) for _ in q]
            q, ticks = move(q, target, goal, True)
            moves = [(ticks, q)]
            if abs(places(q)[-1] - goal) > RADIUS:
                q, more = move(q, correct(q, goal), goal, False)
                moves.append((more, q))
            hits.append((sum(ticks for ticks, _ in moves), q, moves))
        if (total := sum(ticks for ticks, *_ in hits)) < best:
            reached = np.array([q for _, q, _ in hits])
            best, kept = total, [*((kept + reached) / 2 if averages and kept else reached)]
        for goal, (ticks, q, moves) in enumerate(hits, 1):
            yield trial, goal, ticks / 100, [angle + rng.gauss(0, MOTOR) for angle in q], moves


def hits(trials):
    """Yield the lines of the recording of hits."""
    yield "subject,trial,goal,hand,duration,right_1,right_2,right_3"
    for subject, averages in (("p1", False), ("p2", True)):
        for trial, goal, duration, q, _ in practise(averages, trials, random.Random(subject)):
            angles = ",".join(f"{angle:.3f}" for angle in q)
            yield f"{subject},{trial},{goal},right,{duration:.2f},{angles}"


def samples(rng):
    """Yield trial, time (s) and places of the markers (m) of each sample."""
    q, clock, last = START, 0, 1
    for trial, _, _, _, moves in practise(False, TRIALS, rng):
        if trial > last:
            q, clock, last = START, 0, trial
        for steps, end in [*moves, (REST, moves[-1][1])]:
            for k in range(steps):
                yield trial, clock / 100, places(q + (end - q) * k / max(steps - 1, 1))
                clock += 1
            q = end


def markers(subject):
    """Yield the lines of the recording of a person's markers."""
    rng, noise = random.Random(subject), random.Random(f"{subject} noise")
    axes = ",".join(f"{name}_{axis}" for name in MARKERS for axis in "xy")
    yield f"subject,session,trial,time,{axes}"
    for number, (trial, time, points) in enumerate(samples(rng)):
        numbers = np.column_stack([points.real, points.imag]).ravel()
        at = [f"{x + noise.gauss(0, NOISE):.4f}" for x in numbers]
        if number in GAP and subject == "m1":
            at[2:4] = "", ""
        session = 1 if trial <= TRIALS / 2 else 2
        yield f"{subject},{session},{trial},{time:.2f},{','.join(at)}"


def main(folder, trials=100):
    """Write the recordings."""
    files = {f"markers/{subject}": markers(subject) for subject in ("m1", "m2")}
    for name, lines in {"metres": hits(trials), **files}.items():
        Path(folder, f"{name}.csv").write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
