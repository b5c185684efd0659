# SPDX-License-Identifier: Apache-2.0
"""Every term as a function of an arm's dynamics, q, v, and accelerations or torques."""

from functools import partial
from typing import Any

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.dynamics.dynamics import call_entry
from arm_dynamics.terms import TERMS, Entry

CURVE = {"at": [-1.0, 0.0, 2.0], "factor": [1.0, 2.0, 0.5]}
LAWS = {
    "viscous": {"friction": {"viscous": {"positive": 0.6, "negative": 0.3}}},
    "dry": {"friction": {"coulomb": 0.5, "static": 0.8, "stribeck_velocity": 0.4}},
    "dry by position": {"friction": {"coulomb": 0.5, "position": CURVE}},
    "dry by load": {"friction": {"coulomb": 0.2, "load": {"at": [0, 20], "factor": [1, 2]}}},
    "bristles": {"friction": {"coulomb": 0.5, "static": 0.6, "viscous": 30.0,
                              "stribeck_velocity": 0.1,
                              "lugre": {"sigma0": 1e4, "sigma1": 100}}},
    "spring and armature": {"armature": 0.4, "spring": {"stiffness": 30.0, "damping": 0.5}},
    "geared motor": {"actuator": {"resistance": 1.0, "torque_constant": 0.05, "gear_ratio": 50,
                                  "rotor_inertia": 5e-5, "efficiency": 0.8}},
    "flexible gear": {"actuator": {"resistance": 1.0, "torque_constant": 0.05, "gear_ratio": 50,
                                   "rotor_inertia": 5e-5},
                      "transmission": {"stiffness": 500.0, "damping": 0.3}},
}  # fmt: skip
"""What a joint may have that enters its torque."""


def _answer(entry: Entry, dynamics: Dynamics, q: Any, v: Any, x: Any) -> Any:
    frames = [dynamics.model.frame_names[-1]] if entry.selectors else []
    made = call_entry(dynamics, entry, {"q": q, "v": v, "a": x, "tau": x}, *frames)
    return np.stack(made, axis=-1) if entry.fields else made


CALLS = {entry.method_name: partial(_answer, entry) for entry in TERMS}
