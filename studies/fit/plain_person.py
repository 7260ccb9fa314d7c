"""Four simulated people in metres, for the how-to: a simulator that does not use coartic.

    python studies/fit/plain_person.py docs/examples/recordings

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

LINKS, START = (0.33, 0.27, 0.09), (0.6, 1.4, 0.5)
GOALS, RADIUS = ((0.05, 0.45), (0.25, 0.40), (0.20, 0.25), (-0.05, 0.35)), 0.01
STEP, GAIN, EXPLORATION, MOTOR = 0.01, 0.05, 0.05, 0.005
MARKERS = ("right_1", "right_2", "right_3", "right_tip")
NOISE, REST, GAP, TRIALS = 0.001 * sum(LINKS), 5, range(150, 153), 12
"""Recordings of markers: noise (SD), samples at rest, samples without a marker, and trials."""


def places(q):
    """Return the places of shoulder, elbow, wrist and hand."""
    x, y, angle, found = 0.0, 0.0, 0.0, [(0.0, 0.0)]
    for length, joint in zip(LINKS, q, strict=True):
        angle += joint
        x, y = x + length * math.cos(angle), y + length * math.sin(angle)
        found.append((x, y))
    return found


def move(q, target, goal, stops):
    """Return the posture where a straight movement ends, and its control steps. It ends where the
    hand hits the goal or the target is reached; with ``stops`` also where the hand is nearly as at
    the target."""
    way = [b - a for a, b in zip(q, target, strict=True)]
    steps, end = math.ceil(math.hypot(*way) / STEP), places(target)[-1]
    for k in range(steps + 1):
        share = min(k * STEP / (math.hypot(*way) or 1.0), 1.0)
        here = [a + share * d for a, d in zip(q, way, strict=True)]
        hand = places(here)[-1]
        if math.dist(hand, goal) <= RADIUS or (stops and math.dist(hand, end) <= RADIUS / 10):
            break
    return here, k + 1


def correct(q, goal):
    """Return the posture that descent on the distance to the goal finds."""
    q = list(q)
    while math.dist((points := places(q))[-1], goal) > RADIUS / 10:
        x, y = points[-1]
        for j, (a, b) in enumerate(points[:-1]):
            q[j] += GAIN * (-(y - b) * (goal[0] - x) + (x - a) * (goal[1] - y))
    return q


def practise(averages, trials, rng):
    """Yield trial, goal (both from 1), duration (s) and recorded posture (rad) of each hit, and its
    movements, as pairs of control steps and the posture at the end; trial 1 is clumsy. With
    ``averages`` what is kept moves half the way to each better trial."""
    kept, best = [None] * len(GOALS), math.inf
    for trial in range(1, trials + 1):
        q, hits, total = list(START), [], 0
        for goal, stored in zip(GOALS, kept, strict=True):
            target = [q[0] + 0.3, q[1] - 0.3, q[2] - 0.6]
            if stored:
                target = [angle + rng.gauss(0, EXPLORATION) for angle in stored]
            q, ticks = move(q, target, goal, True)
            moves = [(ticks, q)]
            if math.dist(places(q)[-1], goal) > RADIUS:
                q, more = move(q, correct(q, goal), goal, False)
                ticks += more
                moves.append((more, q))
            total += ticks
            hits.append((ticks, q, moves))
        if total < best:
            best = total
            kept = [
                [(a + b) / 2 if averages else b for a, b in zip(old or new, new, strict=True)]
                for old, (_, new, _) in zip(kept, hits, strict=True)
            ]
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


def markers(subject):
    """Yield the lines of the recording of a person's markers."""
    rng, noise = random.Random(subject), random.Random(f"{subject} noise")
    axes = ",".join(f"{name}_{axis}" for name in MARKERS for axis in "xy")
    yield f"subject,session,trial,time,{axes}"
    for number, (trial, time, points) in enumerate(samples(rng)):
        at = [f"{x + noise.gauss(0, NOISE):.4f}" for point in points for x in point]
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
