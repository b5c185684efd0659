# SPDX-License-Identifier: Apache-2.0
"""Which method integrates a scene, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arm_dynamics import InvalidInput, Scene
from arm_sim.integrators import METHODS, Method

DT_RANGE = (1e-9, 10.0)
TOLERANCE_RANGE = (1e-14, 1e-1)


@dataclass(frozen=True)
class Choice:
    """How a scene is integrated.

    Attributes:
        method: The method.
        dt: Length of a tick in [s].
        tolerance: Scaled error per sub-step, None for one step of fixed length per tick.
        reason: Why this method, for people.
    """

    method: Method
    dt: float
    tolerance: float | None
    reason: str

    @property
    def remark(self) -> str:
        """What to try when a tick cannot be computed."""
        if self.tolerance is None:
            return f" at dt = {self.dt:g} s (a smaller dt or a tolerance may help)"
        return f" to a tolerance of {self.tolerance:g} (a larger one may help)"


def choose(
    scene: Scene, integrator: str | None, dt: float | None, tolerance: float | None
) -> Choice:
    """Settle method, tick and tolerance: the caller's word, else the scene's, else the default.

    Args:
        scene: The scene.
        integrator: Name of a method, ``auto`` or None.
        dt: Length of a tick in [s] or None.
        tolerance: Scaled error per sub-step or None.

    Returns:
        The choice.

    Raises:
        InvalidInput: If one of them is not allowed or they do not go together.
    """
    name = integrator or scene.sim.integrator or "auto"
    if tolerance is None and integrator is None:
        tolerance = scene.sim.tolerance
    dt = _within("dt", scene.sim.dt if dt is None else dt, DT_RANGE, " s")
    tolerance = None if tolerance is None else _within("tolerance", tolerance, TOLERANCE_RANGE, "")
    if name == "auto":
        if tolerance is None:
            return Choice(
                METHODS["rk4"], dt, None, "smooth scene, fixed step: least error for the time"
            )
        return Choice(
            METHODS["dop853"], dt, tolerance, "smooth scene, error control: highest order"
        )
    if name not in METHODS:
        raise InvalidInput(f"integrator = {name!r}; allowed: auto, {', '.join(METHODS)}")
    method = METHODS[name]
    if tolerance is not None and not method.adaptive:
        able = ", ".join(m.name for m in METHODS.values() if m.adaptive)
        raise InvalidInput(
            f"integrator = {name!r} has no error estimate; with a tolerance: auto, {able}"
        )
    return Choice(method, dt, tolerance, "asked for")


def _within(name: str, value: float, allowed: tuple[float, float], unit: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not allowed[0] <= number <= allowed[1]:
        raise InvalidInput(f"{name} = {value!r}; allowed: {allowed[0]:g} to {allowed[1]:g}{unit}")
    return number
