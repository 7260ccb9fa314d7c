"""Methods that break one law of the conformance kit each, and one that keeps them all."""

import random
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from pydantic import ConfigDict
from scipy._lib._util import check_random_state

import coartic
from coartic import load_task
from coartic.method import Information, Method, Parameters, Result, Session
from coartic.motion.solution import Movement, movements_of

CORRECTIVE = frozenset({Information.CORRECTIVE_PROCESS})
SEEN = []
AT_IMPORT = random.random()


def by_correction(session, hands=None):
    """A plain solution: every goal by the corrective process, the last hand first."""
    session.correct(session.q0, session.hands[-1], 1)
    hands = hands or [session.hands[-1]] * session.goals_count
    return tuple(Movement(k, hand, "corrective") for k, hand in enumerate(hands, 1))


class Good(Method):
    name = "test/good"
    title = "Keeps every law"
    citation = "None (2026)."
    information = CORRECTIVE
    stochastic = False

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


class Local(Good):
    name = "test/local"

    def solve(self, session):
        return Result(by_correction(session), {"drawn_at_import": AT_IMPORT})


class Remembers(Good):
    name = "test/remembers"

    def solve(self, session):
        SEEN.append(session.seed)
        return Result(by_correction(session), {"seen": len(set(SEEN))})


class Spendthrift(Good):
    name = "test/spendthrift"
    information = CORRECTIVE | {Information.REWARD_BY_TRIAL}

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
    information = CORRECTIVE | {Information.JACOBIAN}


class Unhelpful(Good):
    name = "test/unhelpful"

    def solve(self, session):
        if session.goals_count == 1:
            raise ZeroDivisionError("no goal is that far")
        return Result(by_correction(session))


class Taker(Good):
    """Takes the whole task, which is for this project's own methods."""

    name = "test/taker"

    def solve(self, session):
        return Result((), {"goals": len(session.reveal(Information.CORRECTIVE_PROCESS).goals)})


class Freeloader(Good):
    """Has the corrective process do the work without declaring it."""

    name = "test/freeloader"
    information = frozenset()

    def solve(self, session):
        hand = session.hands[-1]
        goals = range(1, session.goals_count + 1)
        return Result(tuple(Movement(goal, hand, "corrective") for goal in goals))


class Forger(Good):
    """Writes into what it is shown."""

    name = "test/forger"
    information = CORRECTIVE | {Information.REWARD_BY_TRIAL}

    def solve(self, session):
        solution = by_correction(session)
        session.trial(solution)
        session.meter.trials = 0
        session.rewards.append(10**6)
        session.q0[:] = 9.0
        try:
            session.spend(trials=-1)
        except ValueError as error:
            return Result(solution, {"said": str(error)})
        return Result(solution)


class MeansParameters(Parameters):
    means: str = "objective"


class Outsider(Good):
    name = "test/outsider"
    Parameters = MeansParameters

    def solve(self, session):
        task = load_task("ascending")
        if self.parameters.means == "objective":
            coartic.objective(task, "RRR").many([[0.0] * 18] * 5)
        elif self.parameters.means == "learn":
            coartic.learn(task, "EC1", seed=0, trials=9)
        elif self.parameters.means == "session":
            own = Session(task, 0, Information)
            own.trial(by_correction(session, ["right"] * 3))
            own.trials("RRR", np.zeros((3, 3, own.dof)))
        elif self.parameters.means == "initial hands":
            found = task.model_dump() | {"initial_hands": "best-single-hand"}
            coartic.initial_hands(coartic.Task(**found))
        elif self.parameters.means == "environments in a thread":
            from coartic.gym import TaskVectorEnv

            env = TaskVectorEnv(5, task)
            env.reset()
            with ThreadPoolExecutor(1) as pool:
                pool.submit(env.step, env.action_space.sample()).result()
        else:
            coartic.execute(task, by_correction(session, ["right"] * 3))
        return Result(by_correction(session))


class Lucky(Good):
    """Draws, though it says that no seed matters."""

    name = "test/lucky"

    def solve(self, session):
        return Result(by_correction(session), {"drawn": session.rng.random()})


class OwnGeneratorParameters(Parameters):
    maker: str = "default_rng"


class OwnGenerator(Good):
    """Has a lucky seed, though it says that no seed matters."""

    name = "test/own-generator"
    Parameters = OwnGeneratorParameters

    def solve(self, session):
        makers = {
            "default_rng": lambda: np.random.default_rng(7),
            "RandomState": lambda: np.random.RandomState(7).uniform(),
            "Random": lambda: random.Random(7).random(),
            "subclass": lambda: OwnRandom(7).doubled(),
            "seed": lambda: np.random.seed(7),  # noqa: NPY002
            "scipy": lambda: check_random_state(7),
        }
        makers[self.parameters.maker]()
        assert isinstance(np.random.mtrand._rand, np.random.RandomState)
        return Result(by_correction(session))


class OwnRandom(random.Random):
    def doubled(self):
        return 2 * self.random()


class Degrees(Good):
    """Moves to targets in degrees."""

    name = "test/degrees"

    def solve(self, session):
        q, goals = session.q0, range(1, session.goals_count + 1)
        q[-4:] = 90.0, -30.0, 10.0, 5.0
        by_correction(session)
        return Result(tuple(Movement(goal, "right", "planned", q) for goal in goals))


class NoTarget(Good):
    """Has an inverse kinematics that fails, which looks like a solution."""

    name = "test/no-target"

    def solve(self, session):
        by_correction(session)
        targets = np.full((session.goals_count, session.dof), np.nan)
        return Result(movements_of("R" * session.goals_count, targets))


class Draws(Good):
    """Draws as it should."""

    name = "test/draws"
    stochastic = True

    def solve(self, session):
        return Result(by_correction(session), {"drawn": session.rng.random()})


class Undrawn(Good):
    """Is declared stochastic, but no seed changes it."""

    name = "test/undrawn"
    stochastic = True
