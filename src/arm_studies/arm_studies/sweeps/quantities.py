# SPDX-License-Identifier: Apache-2.0
"""Varied quantities in words, with their units, for headings."""

import re

from arm_dynamics.scene import Scene

# Names of quantities by their unit, of revolute joints; with the part before where it matters.
_NAMES = {
    "": "counts damping_ratio direction efficiency factor load loss normal order period ratio "
        "restitution sharpness static_friction tolerance accuracy",
    "kg": "mass", "kg m²": "armature inertia rotor_inertia",
    "m": "com distance height point points radius rest_length",
    "m/s²": "gravity",
    "N": "force", "N/m": "springs.stiffness", "N s/m": "springs.damping",
    "N m": "coulomb effort static torque cogging.amplitude load.at effort.noise effort.offset",
    "N m/rad": "sigma0 stiffness", "N m/rad³": "stiffening",
    "N m s/rad": "damping rotor_damping sigma1 viscous",
    "rad": "amplitude at backlash deflection lower offset phase position rest rpy upper "
           "position.noise position.offset resolution",
    "rad/rad": "gear_ratio",
    "rad/s": "bandwidth sigma1_velocity speed stribeck_velocity velocity "
             "velocity.noise velocity.offset",
    "N m/A": "torque_constant", "V s/rad": "back_emf_constant", "Ω": "resistance",
    "A": "current_limit", "V": "voltage_limit", "H": "inductance",
    "s": "delay dt jitter", "Hz": "cutoff",
}  # fmt: skip
_UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}


def unit(key: str) -> str:
    """The unit of a key of a scene; empty if it has none."""
    parts = re.sub(r"\.\d+(?=\.|$)", "", key).split(".")
    ends = range(len(parts), 0, -1) if parts[0] in Scene.model_fields else ()
    for end in ends:  # the last part may be a joint, or a side
        for name in (".".join(parts[end - 2 : end]), parts[end - 1]):
            if name in _UNITS:
                return _UNITS[name]
    return ""


def heading(key: str) -> str:
    """A key of a study in words, with its unit."""
    words = re.sub(r"^joints\.(\*\.)?|s\.\d+(?=\.)", "", key)  # payloads.0.mass is that of one
    words = re.sub(r"friction\.(\w+)$", r"\1 friction", words)
    label = re.sub(r"[._]", " ", words)
    return f"{label}\n[{unit(key)}]" if unit(key) else label
