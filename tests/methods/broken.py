"""Methods that break one law of the conformance kit each, and one that keeps them all."""

import random
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from pydantic import ConfigDict

import coartic
from coartic import load_task
from coartic.method import Information, Method, Parameters, Result, Session
from coartic.motion.solution import Movement, movements_of

CORRECTIVE = frozenset({Information.CORRECTIVE_PROCESS})
SEEN = []
AT_IMPORT = random.random()


def by_correction(session):
    """A plain solution: every goal by the corrective process, the last hand first."""
    hand = session.hands[-1]
    session.correct(session.q0, hand, 1)
    return tuple(Movement(k, hand, "corrective") for k in range(1, session.goals_count + 1))


class Good(Method):
    name = "test/good"
    title = "Keeps every law"
    citation = "None (2026)."
    information = CORRECTIVE
    stochastic = False

    def solve(self, session):
        return Result(by_correction(session), self.details(session) or {})

    def details(self, session):
        """What it does besides, and says of it."""


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

    def details(self, session):
        return {"drawn": random.random()}


class Local(Good):
    name = "test/local"

    def details(self, session):
        return {"drawn_at_import": AT_IMPORT}


class Remembers(Good):
    name = "test/remembers"

    def details(self, session):
        SEEN.append(session.seed)
        return {"seen": len(set(SEEN))}


class Spendthrift(Good):
    name = "test/spendthrift"
    information = CORRECTIVE | {Information.REWARD_BY_TRIAL}

    def details(self, session):
        for _ in range(20):
            session.trial(by_correction(session))


class Peeks(Good):
    name = "test/peeks"

    def details(self, session):
        session.jacobian(session.q0, session.hands[0])


class Overdeclares(Good):
    name = "test/overdeclares"
    information = CORRECTIVE | {Information.JACOBIAN}


class Unhelpful(Good):
    name = "test/unhelpful"

    def details(self, session):
        if session.goals_count == 1:
            raise ZeroDivisionError("no goal is that far")


class Taker(Good):
    """Takes the whole task, which is for this project's own methods."""

    name = "test/taker"

    def details(self, session):
        return {"goals": len(session.reveal(Information.CORRECTIVE_PROCESS).goals)}


class Freeloader(Good):
    """Has the corrective process do the work without declaring it."""

    name = "test/freeloader"
    information = frozenset()

    def solve(self, session):
        hand = session.hands[-1]
        goals = range(1, session.goals_count + 1)
        return Result(tuple(Movement(goal, hand, "corrective") for goal in goals))


class MeansParameters(Parameters):
    means: str = "objective"


class Outsider(Good):
    name = "test/outsider"
    Parameters = MeansParameters

    def details(self, session):
        task, correction = load_task("ascending"), by_correction(session)
        own = Session(task, 0, Information)
        searched = coartic.Task(**task.model_dump() | {"initial_hands": "best-single-hand"})
        means = {
            "objective": lambda: coartic.objective(task, "RRR").many([[0.0] * 18] * 5),
            "learn": lambda: coartic.learn(task, "EC1", seed=0, trials=9),
            "execute": lambda: coartic.execute(task, correction),
            "initial hands": lambda: coartic.initial_hands(searched),
            "session": lambda: (own.trial(correction), own.trials("RRR", np.zeros((3, 3, 10)))),
            "environment in a thread": lambda: step_in_a_thread(task),
        }
        means[self.parameters.means]()


def step_in_a_thread(task):
    from coartic.gym import TaskEnv

    env = TaskEnv(task)
    env.reset()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(env.step, env.action_space.sample()).result()


class Lucky(Good):
    """Draws, though it says that no seed matters."""

    name = "test/lucky"

    def details(self, session):
        return {"drawn": session.rng.random()}


class Timid(Good):
    """Finds nothing where movements miss."""

    name = "test/timid"

    def details(self, session):
        assert session.model.motor_noise == 0.0, "nothing is certain"


class Proud(Good):
    """Answers its best trial, in noise, too."""

    name = "test/proud"
    information = CORRECTIVE | {Information.REWARD_BY_TRIAL}
    stochastic = True

    def solve(self, session):
        hands = session.find_initial_hands()
        start = session.trials(hands, np.full((1, session.goals_count, session.dof), np.nan))
        count = 6 if session.trials_left is not None else 30
        targets = start.reached + 0.02 * session.rng.standard_normal(
            (count, session.goals_count, session.dof)
        )
        for k in map("xy".index, session.locked_base):
            targets[..., k] = session.q0[k]
        best = targets[session.trials(hands, targets).rewards.argmax()]
        return Result(movements_of(hands, best))


class Draws(Lucky):
    """Draws as it should."""

    name = "test/draws"
    stochastic = True
