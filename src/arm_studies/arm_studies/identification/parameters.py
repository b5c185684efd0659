# SPDX-License-Identifier: Apache-2.0
"""What an identification says of parameters: base parameters, friction, and what is missing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.checks import MOVED
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction import COULOMB, EXCESS, VISCOUS, JointFit
from arm_studies.identification.regression.uncertainty import Estimates, estimated

# Smallest value of a friction term beside viscous and Coulomb, over half its interval.
SURELY = 1.5
NO_FRICTION = "none that opposes the motion was found"


def parameters(fit: Fit, ranges: Array, scene: Fit) -> dict[str, Any]:
    """Fields of an ``Identification``.

    Args:
        fit: The fit of all parameters.
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        scene: The fit that is written into the scene.
    """
    regressor, names = fit.rows.regressor, fit.rows.names
    base, estimates = regressor.base, _estimated(fit)
    written = base.of(np.concatenate([scene.armature, scene.theta]))
    nominal = base.of(np.concatenate([regressor.model.armature, regressor.nominal]))
    values = dict(zip(base.names, written.tolist(), strict=True))
    linear = list(base.names)
    for name, own, law in zip(names, fit.friction, scene.friction, strict=True):
        linear += [f"{name}.{kind}" for kind in own.coefficients]
        values |= {f"{name}.{kind}": law.coefficients.get(kind, 0.0) for kind in own.coefficients}
    by_name = dict(zip(linear, estimates.linear, strict=True))
    for (j, name), each in estimates.shapes.items():
        by_name[f"{names[j]}.{name}"] = each
        values[f"{names[j]}.{name}"] = getattr(scene.friction[j].shape, name) or 0.0
    known = {name: each for name, each in by_name.items() if np.isfinite(each.high)}
    missing = _without_friction(scene, ranges)
    for name, each in by_name.items():
        if name not in known:
            missing[name] = "the motion does not determine it"
        elif not each.significant:
            span = f"{each.value:.3g} ± {each.high - each.value:.2g}"
            missing[name] = f"{span}: not significantly different from zero"
    return {
        "parameters": {name: each.value for name, each in known.items()},
        "intervals": {name: (each.low, each.high) for name, each in known.items()},
        "scatter": frozenset(name for name, each in known.items() if each.scatter),
        "written": values, "nominal": dict(zip(base.names, nominal.tolist(), strict=True)),
        "condition": estimates.condition, "missing": missing,
    }  # fmt: skip


def _estimated(fit: Fit) -> Estimates:
    """Estimates of base parameters, by their leading unknowns, and of friction."""
    numbers, n = len(fit.theta), fit.rows.n
    order = [*range(numbers, numbers + n), *range(numbers)]  # bodies lead, if any can
    return estimated(fit, [order[k] for k in fit.rows.regressor.base.independent])


def without_doubtful(fit: Fit) -> tuple[JointFit, ...]:
    """The friction of a fit without terms that may be zero, or of either sign, after all.

    Selection sees gains in prediction, which errors that are correlated over the recording can
    cause; intervals count these.
    """
    estimates = iter(_estimated(fit).linear[fit.rows.regressor.base.count :])
    laws = []
    for own in fit.friction:
        sure = {kind: not abs(each.value) < SURELY * (each.high - each.value) < np.inf
                for kind, each in zip(own.kinds, estimates, strict=False)}  # fmt: skip
        kinds = tuple(kind for kind in own.kinds if sure[kind] or kind in (VISCOUS, COULOMB))
        fall = own.shape.stribeck_velocity if EXCESS in kinds else None
        laws.append(replace(own, kinds=kinds, shape=replace(own.shape, stribeck_velocity=fall)))
    return tuple(laws)


def _without_friction(fit: Fit, ranges: Array) -> dict[str, str]:
    """Friction that was not identified, by name, and why."""
    missing = dict[str, str]()
    for joint, own, way in zip(fit.rows.names, fit.friction, ranges, strict=True):
        if way <= MOVED:
            missing[f"{joint}.friction"] = (
                f"it moved only {way:.2g} rad or m where it cannot stick"
            )
        elif not own.kinds:
            missing[f"{joint}.friction"] = NO_FRICTION
        else:
            left = [kind for kind in (VISCOUS, COULOMB) if kind not in own.kinds]
            missing |= {f"{joint}.{kind}": NO_FRICTION for kind in left}
            if EXCESS not in own.kinds:
                missing[f"{joint}.static"] = "friction does not visibly fall with speed"
    return missing
