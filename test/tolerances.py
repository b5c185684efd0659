# SPDX-License-Identifier: Apache-2.0
"""Every tolerance of the tests, named once, and the one way to apply them."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

PINOCCHIO: Final = 1e-12
"""Numeric answers against Pinocchio called directly; sums of terms against the whole."""

ALGEBRA: Final = 1e-10
"""Generated functions against Pinocchio."""

INVERSE_PAIR: Final = 1e-9
"""Inverse dynamics of forward dynamics against the torque that went in."""

ROUNDING: Final = 1e-13
"""The same on an arm of six joints, where nothing but rounding is lost."""

EXPORT: Final = 1e-14
"""Exported terms against ``Dynamics``."""

EXPORT_FORWARD: Final = 1e-13
"""Exported accelerations against ``Dynamics``, whose rounding the mass matrix amplifies."""

FINITE_DIFF: Final = 1e-5
"""Anything against a finite difference."""

BACKENDS: Final = 1e-12
"""The virtual machine against compiled code, over a few steps."""

CLOSED_FORM: Final = 1e-12
"""Equations of motion written out by hand."""

SPRING: Final = 1e-9
"""Springs against differences of eighth order of their lengths and energies, and motions on them
against an independent integration."""

ORDER: Final = 0.3
"""Measured order of an integrator against the one it states."""

PUMA: Final = 1e-9
"""Published joint torques of the Puma 560."""

TRAJECTORY: Final = 1e-6
"""RK4 at 1 ms against the reference problems: [rad] or [m] over 10 s."""

ENERGY_DRIFT: Final = 1e-6
"""RK4 at 1 ms without losses, relative to the energy that moves, over a second."""

LINEAR_ERROR: Final = 1e-4
"""Error under computed torque at 1 kHz against the linear equation, relative to the step."""

LUGRE: Final = 1e-6
"""LuGre friction at 1 ms with the default tolerance, half a second against Radau: [rad]."""

MULTIPLIER: Final = 1e-8
"""Forces of constraints against those of single bodies [N]."""

CLOSURE: Final = 1e-12
"""What a closed chain may be open by after any time [m, rad]."""

CLOSURE_SPEED: Final = 1e-11
"""The same of speeds [m/s, rad/s]."""

DRY_BALANCE: Final = 5e-3
"""Energy balance of a recording with dry friction at 1 ms: the quadrature does not see at what
instant within a tick a joint stopped or broke away. At 0.1 ms a hundred times less."""

MOTOR: Final = 1e-9
"""Current and speed of a motor at 1 ms, by the method a scene gets without asking, relative."""
CONTACT_EVENTS: Final = 1e-9
"""Motion through many touch-downs against its closed form."""


def assert_close(actual: ArrayLike, desired: ArrayLike, tolerance: float) -> None:
    """Assert agreement to ``tolerance`` relative to the largest desired element, or to one if that
    is larger.

    Args:
        actual: What was computed.
        desired: What it should be, of the same shape.
        tolerance: One of the names above.
    """
    wanted = np.asarray(desired)
    assert np.shape(actual) == wanted.shape, f"shape {np.shape(actual)}, wanted {wanted.shape}"
    scale = max(1.0, float(np.abs(wanted).max(initial=0.0)))
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=tolerance * scale)
