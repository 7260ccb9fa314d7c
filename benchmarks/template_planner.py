"""NAME: write here what your planner does. Check it with: coartic check NAME --method-file FILE."""

import numpy as np

from coartic.method import Information, Method, MethodError, Result, Session
from coartic.motion.solution import Movement
from coartic.robot import Hand


class Planner(Method):
    """Go to the nearest posture for each goal, as a start for your own planner.

    For each goal, the planner finds a posture of each hand by damped least squares. It then moves
    straight in joint space to the nearest of these postures. The planner does not consider later
    goals: improve this first. On the paper's tasks, the gap of this planner is 22.6 %; the gap of
    the corrective process with its best hands is smaller, 13.9 %.
    """

    name = "NAME"  # id in commands and tables
    title = "Nearest posture, goal by goal"  # title in lists and citations
    citation = "C. W. Wampler (1986). Manipulator inverse kinematic solutions."  # work to cite
    tuned_on = "nothing"  # tasks on which you chose its constants
    stochastic = False  # it draws no random numbers, so that it is run once on each task
    information = frozenset(  # all that it uses; the session refuses anything else
        {Information.GOALS, Information.FORWARD_KINEMATICS, Information.JACOBIAN}
    )

    def solve(self, session: Session) -> Result:
        """Return a movement for each goal, or raise MethodError if no posture is found."""
        q, movements = session.q0, []  # length units (base) and rad (joints)
        for number, goal in enumerate(session.goals, 1):  # goals count from 1
            postures = [(hand, self.posture(session, q, hand, goal)) for hand in session.hands]
            lengths = [
                (float(np.linalg.norm(posture - q)), hand, posture)
                for hand, posture in postures
                if posture is not None
            ]
            if not lengths:
                raise MethodError("infeasible", f"no posture was found for goal {number}")
            _, hand, q = min(lengths, key=lambda length: length[0])
            movements.append(Movement(number, hand, "planned", q))
        return Result(tuple(movements))

    def posture(
        self, session: Session, q: np.ndarray, hand: Hand, goal: np.ndarray
    ) -> np.ndarray | None:
        """Return a posture near ``q`` in which a hand is at a goal, or None."""
        locked = [place for place, name in enumerate("xy") if name in session.locked_base]
        for _ in range(200):
            miss = goal - session.forward_kinematics(q, hand)  # length units
            if np.hypot(*miss) < session.radius - 0.012:  # a little inside the rim
                return q
            jacobian = session.jacobian(q, hand)
            jacobian[:, locked] = 0.0  # a locked base does not move
            step = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 0.01 * np.eye(2), miss)
            q = q + step / max(1.0, np.abs(step).max() / 0.2)  # at most 0.2 (length unit, rad)
        return None


# A planner that optimises the reward as a formula declares Information.REWARD_FORMULA, one that
# uses trials declares Information.REWARD_BY_TRIAL and calls `session.trial`: see "Make a method of
# your own" in the documentation.
