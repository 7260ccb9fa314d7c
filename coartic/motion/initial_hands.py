"""Search for the hand sequence of trial 0, by trials with only the corrective process."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache

import numpy as np

from coartic.errors import NotApplicableError
from coartic.internal.limits import brief_value
from coartic.model import PAPER, MotionModel
from coartic.motion.kernels.trial import COUNTED
from coartic.motion.trials import (
    compiled_task,
    count_trials,
    hand_codes,
    make_trials,
    reason_of_failure,
)
from coartic.robot import HANDS, Hand
from coartic.tasks.task import WITHOUT_REACH, Task, letters_of

MAX_SEQUENCES = 4096  # largest number of hand sequences that are all tried


def ranked_sequences(
    task: Task, sequences: Collection[str], *, model: MotionModel = PAPER
) -> list[tuple[str, int | None, str, dict[str, int]]]:
    """Rank hand sequences by the reward of the corrective process on its own.

    Parameters
    ----------
    task : Task
    sequences : collection of str
        Hand sequences, such as ``"RRLR"``.
    model : MotionModel
        The motion model; its motor noise is ignored.

    Returns
    -------
    list of tuple
        A tuple ``(sequence, reward, reason, counts)`` for each sequence:

        - ``reward`` is the reward of the trial, or None if the trial failed;
        - ``reason`` says why the trial failed, and is empty if it did not;
        - ``counts`` is a dict that maps the names in :data:`COUNTED` to the counts of the trial. As
          in :func:`coartic.execute`, each goal that is tried adds one evaluation of the forward
          kinematics.

        The tuples are sorted

        - by reward, the highest first and failed trials last;
        - then by the number of changes of hand, the fewest first;
        - then in the order of ``sequences``.
    """
    exact = model.without_noise()
    compiled, codes = compiled_task(task, exact), hand_codes(task, [*sequences], len(sequences))
    targets = np.full((*codes.shape, 1, task.robot.dof), np.nan)
    records = make_trials(compiled, codes, targets)
    trials = []
    for hands, goals, counts in zip(sequences, records.goals[..., 0], records.counts, strict=True):
        spent = dict(zip(COUNTED, counts.tolist(), strict=True))
        # coartic.execute also evaluates the position of the hand at each goal that is tried.
        spent["forward_kinematics"] += int(goals["hit"].sum()) + spent["failed_trials"]
        reward = None if spent["failed_trials"] else -spent["movement_ticks"]
        trials.append((hands, reward, reason_of_failure(compiled, goals), spent))
    return sorted(
        trials,
        key=lambda trial: (
            math.inf if trial[1] is None else -trial[1],
            changes_of_hand(trial[0]),
        ),
    )


@lru_cache(maxsize=1024)
def _best_of_all(task_json: str, model: MotionModel) -> tuple[str, int] | None:
    task = Task.model_validate_json(task_json, context=WITHOUT_REACH)
    goals = len(task.goals)
    if too_many_sequences(task.name, goals, len(task.hands)) is None:
        sequences = sequences_with(task.hands, goals, task.name)
    elif task.initial_is_policy:
        return None
    else:
        sequences = [task.initial_hands]
    ranked = ranked_sequences(task, sequences, model=model)
    count_trials(-len(ranked))
    hands, reward, *_ = ranked[0]
    return None if reward is None else (hands, -reward)


def best_hands(task: Task, model: MotionModel = PAPER) -> tuple[str, int] | None:
    """Return the best hand sequence of the corrective process on its own, and its ticks.

    The best sequence is the one with the fewest ticks; the motor noise of ``model`` is ignored. For
    a task with more than 4096 hand sequences, only its initial sequence is tried. The result is
    None

    - if the process completes the task with none of the sequences that are tried;
    - if a task with more than 4096 sequences names a policy instead of an initial sequence.

    Results are cached; the trials are not counted.
    """
    return _best_of_all(task.model_dump_json(), model.without_noise())


def changes_of_hand(sequence: str) -> int:
    """Count how often the hand changes from one goal to the next: 3 for ``"LRLR"``."""
    return sum(a != b for a, b in itertools.pairwise(sequence))


def sequences_with(hands: Collection[Hand], goals: int, task: str) -> list[str]:
    """List all hand sequences for a number of goals, in alphabetical order.

    The sequences, such as ``"LRLR"``, consist of the letters of ``hands``. Raises
    NotApplicableError, with the name ``task`` in the message, if there are more than 4096
    sequences.

    Examples
    --------
    >>> sequences_with(("left", "right"), 2, "mine")
    ['LL', 'LR', 'RL', 'RR']
    """
    ordered = [hand for hand in HANDS if hand in hands]
    if reason := too_many_sequences(task, goals, len(ordered)):
        raise NotApplicableError(reason)
    return [letters_of(sequence) for sequence in itertools.product(ordered, repeat=goals)]


def too_many_sequences(task: str, goals: int, hands: int) -> str | None:
    """Return a sentence if a task has more than 4096 hand sequences, otherwise None.

    ``task`` is the name of the task, ``goals`` the number of its goals, and ``hands`` the number of
    its hands.
    """
    count = hands**goals
    if count <= MAX_SEQUENCES:
        return None
    return f"task {task!r} has {count} hand sequences; at most {MAX_SEQUENCES} are tried"


def hands_among(task: Task, hands: Iterable[Hand] | None) -> tuple[Hand, ...]:
    """Check hands, and return them as a tuple.

    None stands for all hands of the task. Raises ValueError if ``hands`` is empty or names a hand
    that the task does not have.
    """
    if hands is None:
        return task.hands
    chosen = tuple(hands) if isinstance(hands, Iterable) else ()
    if not chosen or not all(isinstance(hand, str) and hand in task.hands for hand in chosen):
        raise ValueError(
            f"hands is {brief_value(hands)}; it must be a list of hands of task {task.name!r}, "
            f"which are {' and '.join(map(repr, task.hands))}"
        )
    return chosen


def search_initial_hands(
    task: Task,
    hands: tuple[Hand, ...] | None = None,
    *,
    model: MotionModel = PAPER,
) -> tuple[str, Mapping[str, int]]:
    """Find the hand sequence of trial 0, and count the trials of the search.

    If the task names a sequence, that sequence is returned with no counts. If the task names a
    policy, the first sequence of :func:`ranked_sequences` is returned. The ranked sequences are

    - ``"best-single-hand"``: the sequences of one hand;
    - ``"best-of-all"``: all sequences.

    The trials of the search are counted by :func:`count_trials`, even if the result comes from the
    cache. If the search fails, its trials are not counted.

    Parameters
    ----------
    task : Task
    hands : tuple of {"left", "right"}, optional
        Hands among which a policy chooses; the task's by default.
    model : MotionModel
        The motion model; its motor noise is ignored.

    Returns
    -------
    sequence : str
        The hand sequence, such as ``"RRRR"``.
    counts : mapping of str to int
        Dict that maps names of counters of :class:`~coartic.method.Meter` to the counts of the
        search; empty if there was no search. The dict is cached: do not change it.

    Raises
    ------
    NotApplicableError
        No sequence tried completes the task, or there are more than 4096 sequences to try.
    ValueError
        ``hands`` is empty or names a hand that the task does not have.
    """
    allowed = hands_among(task, hands)
    if not task.initial_is_policy:
        return task.initial_hands, {}
    ordered = tuple(hand for hand in HANDS if hand in allowed)
    exact = model.without_noise()
    sequence, counts = _search_by_policy(task.model_dump_json(), ordered, exact)
    count_trials(counts["initial_trials"])
    return sequence, counts


@lru_cache(maxsize=64)
def _search_by_policy(
    task_json: str, hands: tuple[Hand, ...], model: MotionModel
) -> tuple[str, Mapping[str, int]]:
    """Search for the hands of trial 0 by the task's policy (:func:`search_initial_hands`).

    The last 64 results are cached (LRU). The task is passed as JSON and ``hands`` as a tuple,
    because arguments of a cached function must be hashable. The caller counts the trials.
    """
    task = Task.model_validate_json(task_json, context=WITHOUT_REACH)
    goals = len(task.goals)
    if task.initial_hands == "best-single-hand":
        candidates = [letters_of([hand] * goals) for hand in hands]
    else:
        candidates = sequences_with(hands, goals, task.name)
    ranked = ranked_sequences(task, candidates, model=model)
    count_trials(-len(ranked))  # the caller counts them, each time
    best, reward, reason, _ = ranked[0]
    if reward is None:
        raise NotApplicableError(
            f"task {task.name!r}: the corrective process does not complete it with any hand "
            f"sequence that initial_hands = {task.initial_hands!r} allows; with {best}, {reason}"
        )
    names = [name for name in COUNTED if name not in ("iterations", "failed_trials")]
    spent = {name: sum(counts[name] for *_, counts in ranked) for name in names}
    return best, {"initial_trials": len(ranked), **spent}
