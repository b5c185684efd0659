# SPDX-License-Identifier: Apache-2.0
"""Names and marks of curves; all else is the house style, ``arm_sim.figures``."""

MARKS = "osD^vPXh*p"
METHODS = {
    "euler": "Euler", "semi_implicit_euler": "semi-implicit Euler", "midpoint": "midpoint",
    "rk4": "RK4", "dopri5": "DOPRI5", "dop853": "DOP853", "implicit": "implicit",
}  # fmt: skip
"""Methods in figures, by their keys; the others are much like one of these."""
