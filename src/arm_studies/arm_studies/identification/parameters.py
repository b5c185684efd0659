# SPDX-License-Identifier: Apache-2.0
"""What an identification says of parameters: base parameters, friction, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.checks import MOVED
from arm_studies.identification.regression.base_parameters import BaseParameters, base_parameters
from arm_studies.identification.regression.estimation import Mask
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    EXCESS,
    VISCOUS,
    JointFit,
)
from arm_studies.identification.regression.intervals import Estimate, estimated
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows import Rows

# Smallest value of a friction term beside viscous and Coulomb, over half its interval.
SURELY = 1.5
NO_FRICTION = "none that opposes the motion was found"


def parameters(
    regressor: RigidRegressor, rows: Rows, fit: Fit, use: Mask, ranges: Array, scene: Fit
) -> dict[str, Any]:
    """Fields of an ``Identification``.

    Args:
        regressor: Of the nominal scene.
        rows: The regression's rows.
        fit: The fit of all parameters.
        use: Rows that it uses, shape (k, n).
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        scene: The fit that is written into the scene.
    """
    names, base = regressor.model.joint_names, _base(regressor)
    order, lead = _leading(base, fit, rows.n)
    estimates = estimated(rows, use, fit, lead)
    at_first = np.concatenate([regressor.model.armature, regressor.nominal])
    values = (base.grouping @ np.stack([at_first, scene.x[order]], axis=1)).T.tolist()
    nominal, written = (dict(zip(base.names, x, strict=True)) for x in values)
    coefficients = {
        f"{name}.{kind}": written_law.coefficients.get(kind, 0.0)
        for name, own, written_law in zip(names, fit.friction, scene.friction, strict=True)
        for kind in own.coefficients
    }
    shapes = {(j, name): f"{names[j]}.{name}" for j, name in estimates.shapes}
    written |= coefficients
    written |= {
        key: getattr(scene.friction[j].shape, name) or 0.0 for (j, name), key in shapes.items()
    }
    by_name = dict(zip([*base.names, *coefficients], estimates.linear, strict=True))
    by_name |= {key: estimates.shapes[place] for place, key in shapes.items()}
    known = {name: each for name, each in by_name.items() if np.isfinite(each.high)}
    return {
        "parameters": {name: each.value for name, each in known.items()},
        "intervals": {name: (each.low, each.high) for name, each in known.items()},
        "scatter": frozenset(name for name, each in known.items() if each.scatter),
        "written": written, "nominal": nominal, "condition": estimates.condition,
        "missing": _unidentified(names, scene.friction, ranges) | _uncertain(by_name),
    }  # fmt: skip


def _leading(base: BaseParameters, fit: Fit, n: int) -> tuple[list[int], list[int]]:
    """Places of armatures and bodies in a fit, and of the leading ones of base parameters."""
    order = [*range(fit.bodies, fit.bodies + n), *range(fit.bodies)]  # bodies lead, if any can
    return order, [order[k] for k in base.independent]


def without_doubtful(
    regressor: RigidRegressor, rows: Rows, fit: Fit, use: Mask
) -> tuple[JointFit, ...]:
    """The friction of a fit without terms that may be zero, or of either sign, after all.

    Selection sees gains in prediction, which errors that are correlated over the recording can
    cause; intervals count these.
    """
    _, lead = _leading(base := _base(regressor), fit, rows.n)
    estimates = iter(estimated(rows, use, fit, lead).linear[len(base.independent) :])
    found = []
    for own in fit.friction:
        sure = {kind: not abs(each.value) < SURELY * (each.high - each.value) < np.inf
                for kind, each in zip(own.kinds, estimates, strict=False)}  # fmt: skip
        kinds = tuple(kind for kind in own.kinds if sure[kind] or kind in (VISCOUS, COULOMB))
        fall = own.shape.stribeck_velocity if EXCESS in kinds else None
        found.append(replace(own, kinds=kinds, shape=replace(own.shape, stribeck_velocity=fall)))
    return tuple(found)


def _base(regressor: RigidRegressor) -> BaseParameters:
    n = regressor.model.n

    def columns(q: Array, v: Array, a: Array) -> Array:
        return np.concatenate([np.eye(n) * a[:, :, None], regressor(q, v, a)], axis=2)

    armatures = [f"{name}.armature" for name in regressor.model.joint_names]
    return base_parameters(columns, n, [*armatures, *regressor.names()])


def _uncertain(estimates: dict[str, Estimate]) -> dict[str, str]:
    """Why estimates are not known, or may be zero, by name."""
    missing = dict[str, str]()
    for name, each in estimates.items():
        if np.isinf(each.high):
            missing[name] = "the motion does not determine it"
        elif not each.significant:
            span = f"{each.value:.3g} ± {each.high - each.value:.2g}"
            missing[name] = f"{span}: not significantly different from zero"
    return missing


def _unidentified(
    names: Sequence[str], friction: Sequence[JointFit], ranges: Array
) -> dict[str, str]:
    """Friction that was not identified, by name, and why."""
    missing = dict[str, str]()
    for joint, own, way in zip(names, friction, ranges, strict=True):
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
