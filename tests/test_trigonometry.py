"""The kernels' cosine and sine against more digits than they have."""

import mpmath
import numpy as np
import pytest

from coartic.motion.kernels.compile import entry
from coartic.motion.kernels.trigonometry import MAX_ANGLE, cosine, sine


@entry
def _fill(angles, out):
    for i in range(len(angles)):
        out[0, i] = cosine(angles[i])
        out[1, i] = sine(angles[i])


def _evaluate(angles):
    out = np.empty((2, len(angles)))
    _fill(angles, out)
    return out


@pytest.mark.parametrize("span", [1e-3, 1.0, 7.0, 1e3, MAX_ANGLE * 0.999])
def test_error_below_two_tenths_of_a_femto(span):
    """Also where a multiple of π/2 is near, so that nearly all digits of an angle cancel."""
    angles = np.random.default_rng(5).uniform(-span, span, 200)
    angles[:50] = np.round(angles[:50] / (np.pi / 2)) * (np.pi / 2)
    computed = _evaluate(angles)
    for angle, cos, sin in zip(angles, *computed, strict=True):
        assert abs(mpmath.cos(mpmath.mpf(float(angle))) - float(cos)) < 2e-16
        assert abs(mpmath.sin(mpmath.mpf(float(angle))) - float(sin)) < 2e-16


def test_huge_angles_and_non_numbers_go_to_the_library_and_0_is_exact():
    angles = np.array([MAX_ANGLE, -1e9, 1e300])
    np.testing.assert_array_equal(_evaluate(angles), [np.cos(angles), np.sin(angles)])
    np.testing.assert_array_equal(
        _evaluate(np.array([np.nan, 0.0])), [[np.nan, 1.0], [np.nan, 0.0]]
    )
