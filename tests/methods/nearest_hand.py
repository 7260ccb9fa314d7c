"""Always use the hand that is nearest to the goal."""

from pydantic import Field

from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.solution import Movement


class NearestHandParameters(Parameters):
    reluctance: float = Field(default=0.0, ge=0)  # length a hand must be nearer to take over


class NearestHand(Method):
    name = "nearest-hand"
    title = "Corrective process with the nearest hand"
    citation = "An example of this package."
    information = frozenset(
        {
            Information.GOALS,
            Information.FORWARD_KINEMATICS,
            Information.CORRECTIVE_PROCESS,
        }
    )
    stochastic = False
    Parameters = NearestHandParameters

    def solve(self, session: Session) -> Result:
        q, previous, movements = session.q0, None, []
        for number, goal in enumerate(session.goals, 1):
            misses = {}
            for hand in session.hands:
                dx, dy = session.forward_kinematics(q, hand) - goal
                misses[hand] = (dx * dx + dy * dy) ** 0.5
                if previous is not None and hand != previous:
                    misses[hand] += self.parameters.reluctance
            previous = min(misses, key=misses.get)
            correction = session.correct(q, previous, number)
            if not correction.converged:
                raise MethodError("infeasible", f"no posture was found for goal {number}")
            q = correction.q
            movements.append(Movement(number, previous, "planned", q))
        return Result(tuple(movements))
