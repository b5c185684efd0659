# SPDX-License-Identifier: Apache-2.0
"""Error control inside a tick: its state, and the loop for CasADi's virtual machine.

Compiled code has its own loop in ``native/motion/flow.h``.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import Call

_NATIVE = Path(__file__).with_name("native")

# A tick that needs more sub-steps than this is stiff or singular: better an error than a program
# that hangs.
MAX_SUBSTEPS = 100_000
# Near the instant at which a sliding contact comes to rest its direction turns ever faster. The
# search for that instant looks beyond it and need not resolve this.
MAX_SUBSTEPS_TOUCHING = 250
# A motion diverges where a number of the state is larger than this: far from overflow, so that its
# squares are finite.
LARGEST = 1e150
# Choice of the next sub-step, as in ``native/motion/step_control.h``
SAFETY, LEAST_FACTOR, MOST_FACTOR, TINY_ERROR, SHORTEST = 0.9, 0.2, 6.0, 1e-10, 1e-12


class SubstepControl(ctypes.Structure):
    """State of the error control between sub-steps: ``control_t`` of ``native/motion/flow.h``.

    The fields are explained there; times are in [s], errors in [rad] or [m].
    """

    _fields_ = Header(_NATIVE / "motion/flow.h", only="control_t").fields("control_t")

    def __init__(self, tolerance: float, order: int) -> None:
        super().__init__(tolerance, 0.0, 0.0, 0)
        self.order = order

    def copy(self) -> SubstepControl:
        """Another control in the same state."""
        other = SubstepControl(self.tolerance, self.order)
        other.step, other.error, other.attempts = self.step, self.error, self.attempts
        return other

    def restart(self) -> None:
        """Start afresh, as after a reset."""
        self.step, self.error, self.attempts = 0.0, 0.0, 0


def copy_of(control: SubstepControl | None) -> SubstepControl | None:
    """The state of an error control, if there is one, for a tick that is only tried."""
    return control and control.copy()


def adaptive_tick(
    attempt: Call,
    x: Array,
    u: Array,
    p: Array,
    h: float,
    control: SubstepControl,
    lengths: list[float] | None = None,
) -> bool:
    """Advance one tick of length ``h`` in place.

    Args:
        attempt: Kernel function (x, u, p, h) -> (x after, scaled error, error of q).
        x: State, overwritten if the tick succeeds.
        u: Torque that acts.
        p: Parameters.
        h: Length of the tick in [s].
        control: Tolerance and step size.
        lengths: Receives the lengths of the sub-steps.

    Returns:
        Whether every number stayed finite and the tolerance was met.
    """
    state, elapsed, step = x.copy(), 0.0, control.step if control.step > 0.0 else h
    for _ in range(MAX_SUBSTEPS):
        left = h - elapsed
        last = step >= left * (1.0 - SHORTEST)
        trial = left if last else step
        after, error, error_q = attempt(state, u, p, trial)
        control.attempts += 1
        size = float(error[0]) / control.tolerance
        reached = within_reach(after)
        factor = _growth(size, control.order) if reached else LEAST_FACTOR
        if size <= 1.0 and reached:
            state[:] = after
            control.error += float(error_q[0])
            elapsed += trial
            if lengths is not None:
                lengths.append(trial)
            if not last or trial * factor > step:
                step = trial * factor
            if last:
                control.step = step
                x[:] = state
                return True
        else:
            step = trial * factor
            if step < SHORTEST * h:
                return False
    return False


def _growth(size: float, order: int) -> float:
    factor = MOST_FACTOR if size < TINY_ERROR else SAFETY * size ** (-1.0 / order)
    return min(MOST_FACTOR, factor) if factor > LEAST_FACTOR else LEAST_FACTOR  # also of NaN


def within_reach(x: Array) -> bool:
    """Whether no number of a state is larger than ``LARGEST`` or NaN."""
    return all(abs(number) <= LARGEST for number in x.tolist())
