# SPDX-License-Identifier: Apache-2.0
"""Write panda.json: the Panda let go without friction, by the reference of the benchmarks.

Masses and places of the links are those that Pinocchio reads from the URDF; the equations of
motion are written apart from the suite, in 64-bit mantissas, and integrated by extrapolation of
order 14 with two step lengths that must agree. Run, here:
PYTHONPATH=../..:.. ../../arm python make_panda.py (some minutes)
"""

import json
from pathlib import Path

import numpy as np

import models
from benchmarks.reference.extended_precision import REAL, torque_free
from benchmarks.reference.extrapolation import integrate

TIMES = (0.25, 0.5, 1.0)  # [s]
DIGITS, STEPS, COLUMNS = 13, 400, 7


def states(steps: int) -> list[np.ndarray]:
    """Positions [rad] and rates [rad/s] at the times, with so many steps a second."""
    model = models.dynamics("panda_free").model
    f, x, now, reached = torque_free(model.pin), np.zeros(2 * model.n, REAL), 0.0, []
    x[: model.n] = model.q0
    for time in TIMES:
        x = integrate(f, x, time - now, round(steps * (time - now)), COLUMNS)
        now = time
        reached.append(x)
    return reached


def main() -> None:
    """Solve with both step lengths and compare."""
    rough, fine = states(STEPS), states(2 * STEPS)
    worst = max(abs(a - b).max() for a, b in zip(rough, fine, strict=True))
    assert worst < 10.0**-DIGITS, f"the two runs differ by {worst:.1e}"
    content = {
        "about": "q [rad] and q' [rad/s] of the seven joints; no torque, no friction, "
        "g 9.81 m/s^2; from the scene's start",
        "motion": {
            f"{t:g}": {
                key: [np.format_float_positional(y, 16, False) for y in part]
                for key, part in zip("qv", np.split(x, 2), strict=True)
            }
            for t, x in zip(TIMES, fine, strict=True)
        },
    }
    Path(__file__).with_name("panda.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
