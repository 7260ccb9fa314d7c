"""Methods that break one law of the conformance kit each, and one that keeps them all."""

import itertools
import random
import time

from pydantic import ConfigDict

from coartic.method import Information, Method, Parameters, Result
from coartic.solution import Movement

CORRECTIVE = frozenset({Information.CORRECTIVE_PROCESS})
COUNTER = itertools.count()
SEEN = []


def by_correction(session, hands=None):
    """A plain solution: every goal by the corrective process, the last hand first."""
    session.hand_over(Information.CORRECTIVE_PROCESS)
    hands = hands or [session.hands[-1]] * session.goals_count
    return tuple(Movement(k, hand, "corrective") for k, hand in enumerate(hands, 1))


class Good(Method):
    name = "test/good"
    title = "Keeps every law"
    citation = "None (2026)."
    told = CORRECTIVE

    def solve(self, session):
        return Result(by_correction(session))


class Uncited(Good):
    name = "test/uncited"
    citation = ""


class LooseParameters(Parameters):
    model_config = ConfigDict(extra="ignore")


class Loose(Good):
    name = "test/loose"
    Parameters = LooseParameters


class Unexecutable(Good):
    name = "test/unexecutable"

    def solve(self, session):
        return Result(by_correction(session)[:1])


class Random(Good):
    name = "test/random"

    def solve(self, session):
        return Result(by_correction(session), {"drawn": random.random()})


class Remembers(Good):
    name = "test/remembers"

    def solve(self, session):
        SEEN.append(session.seed)
        return Result(by_correction(session), {"seen": len(set(SEEN))})


class Spendthrift(Good):
    name = "test/spendthrift"
    told = CORRECTIVE | {Information.REWARD_BY_TRIAL}

    def solve(self, session):
        solution = by_correction(session)
        for _ in range(20):
            session.trial(solution)
        return Result(solution)


class Peeks(Good):
    name = "test/peeks"

    def solve(self, session):
        session.jacobian(session.q0, session.hands[0])
        return Result(by_correction(session))


class Overdeclares(Good):
    name = "test/overdeclares"
    told = CORRECTIVE | {Information.JACOBIAN}


class Unhelpful(Good):
    name = "test/unhelpful"

    def solve(self, session):
        if session.goals_count == 1:
            raise ZeroDivisionError("no goal is that far")
        return Result(by_correction(session))


class Sleeps(Good):
    name = "test/sleeps"

    def solve(self, session):
        time.sleep(3600)
        return Result(())


class Dies(Good):
    name = "test/dies"

    def solve(self, session):
        import os

        print("last words", flush=True)
        os._exit(7)
