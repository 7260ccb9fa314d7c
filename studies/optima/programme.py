"""Solve a cone programme again and again: CVXPY states it once, and Clarabel solves it."""

import math

import clarabel
import numpy as np
from scipy import sparse

MAX_MULTIPLIER = 1e4
"""Largest multiplier that is used. Rounding is then far below the tolerance of a bound."""
_PLANTED = 1e6  # larger than any number of the programme
# Any multipliers give a bound, so those of the solver need not be exact.
_SETTINGS = {
    "verbose": False, "max_threads": 1, "presolve_enable": False, "input_sparse_dropzeros": False,
    "tol_feas": 1e-5,
}  # fmt: skip


class Programme:
    """Canonical data of a problem of CVXPY with one parameter, in a solver.

    ``values`` are the first values of the parameter. Constraints must be in the order of the
    canonical data: equations, inequalities, second-order cones. To find the positions of the
    parameter's numbers in the data, the data are made once with a unique number for each of them.
    """

    def __init__(self, problem, parameter, variables, values):
        import cvxpy as cp  # slow to import, and needed for proofs alone

        parameter.value = _PLANTED + np.arange(values.size, dtype=float).reshape(values.shape)
        data, _, _ = problem.get_problem_data(cp.CLARABEL, canon_backend=cp.SCIPY_CANON_BACKEND)
        self._places = []  # data, positions in them, and indices of the parameter's numbers there
        for numbers in (data["A"].data, data["b"]):
            places = np.flatnonzero(numbers >= _PLANTED)
            self._places.append((numbers, places, (numbers[places] - _PLANTED).astype(np.intp)))
        first = data["param_prob"].var_id_to_col
        self._variables = [(first.get(each.id, 0), each.shape) for each in variables]
        self._ends = np.cumsum([constraint.size for constraint in problem.constraints])[:-1]
        self._fill(values)
        dims, self._settings = data["dims"], clarabel.DefaultSettings()
        for name, value in _SETTINGS.items():
            setattr(self._settings, name, value)
        cones = [clarabel.ZeroConeT(dims.zero), clarabel.NonnegativeConeT(dims.nonneg)]
        cones += [clarabel.SecondOrderConeT(size) for size in dims.soc]
        quadratic = sparse.csc_array((len(data["c"]),) * 2)
        self._solver = clarabel.DefaultSolver(
            quadratic, data["c"], data["A"], data["b"], cones, self._settings
        )

    def _fill(self, values):
        for numbers, places, sources in self._places:
            numbers[places] = values.ravel()[sources]
        return [numbers for numbers, _, _ in self._places]

    def solve(self, values, gap):
        """Return the variables and the multipliers of the constraints, as two lists.

        ``values`` are the values of the parameter, and ``gap`` is the absolute or relative duality
        gap. If there is no solution, the multipliers are far out on a ray along which the dual
        objective grows. If the solver fails, the multipliers can be any finite numbers.
        """
        matrix, right = self._fill(values)
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = gap
        self._solver.update(A=matrix, b=right, settings=self._settings)
        solution = self._solver.solve()
        x, z = finite(solution.x), finite(solution.z)
        if solution.status == clarabel.SolverStatus.PrimalInfeasible:
            z *= MAX_MULTIPLIER / max(1.0, np.abs(z).max())
        variables = [
            x[first : first + math.prod(shape)].reshape(shape, order="F")
            for first, shape in self._variables
        ]
        return variables, np.split(z, self._ends)


def finite(numbers):
    """Return numbers as an array, with zeros for NaN and infinite numbers."""
    numbers = np.asarray(numbers)
    return np.where(np.isfinite(numbers), numbers, 0.0)
