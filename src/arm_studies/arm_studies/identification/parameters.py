# SPDX-License-Identifier: Apache-2.0
"""What an identification says of parameters: base parameters, friction, and what is missing."""

from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.checks import LEAST_RANGE
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction import COULOMB, EXCESS, VISCOUS, JointFit
from arm_studies.identification.regression.uncertainty import Estimate, Estimates, estimated
from arm_studies.identification.result import IdentifiedParameter

# Smallest value of a friction term beside viscous and Coulomb, over half its interval.
SIGNIFICANT_RATIO = 1.5
NO_FRICTION = "none that opposes the motion was found"


def details_of(
    estimates: Estimates, fit: Fit, ranges: Array, written: Fit
) -> dict[str, IdentifiedParameter]:
    """Every parameter of an arm, and friction that was not identified.

    Args:
        estimates: Of ``fit``, see ``estimated``.
        fit: The fit of all parameters.
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        written: The fit that is written into the scene.
    """
    reasons = _missing_friction(written, ranges)
    details = {name: IdentifiedParameter(None, missing=reason) for name, reason in reasons.items()}

    def add(name: str, estimate: Estimate, value: float, nominal: float | None = None) -> None:
        reason = reasons.get(name, "")
        if not np.isfinite(estimate.high):
            reason = "the motion does not determine it"
        elif not estimate.significant:
            span = f"{estimate.value:.3g} ± {estimate.high - estimate.value:.2g}"
            reason = f"{span}: not significantly different from zero"
        determined = estimate if np.isfinite(estimate.high) else None
        details[name] = IdentifiedParameter(determined, value, nominal, reason)

    samples, linear = fit.rows.samples, iter(estimates.linear)
    regressor, base = samples.regressor, samples.regressor.base
    values = base.of(np.concatenate([written.armature, written.theta])).tolist()
    nominal = base.of(np.concatenate([regressor.model.armature, regressor.nominal])).tolist()
    for name, value, before in zip(base.names, values, nominal, strict=True):
        add(name, next(linear), value, before)
    for name, fitted, law in zip(samples.names, fit.friction, written.friction, strict=True):
        for kind in fitted.coefficients:
            add(f"{name}.{kind}", next(linear), law.coefficients.get(kind, 0.0))
    for (j, key), estimate in estimates.shapes.items():
        add(f"{samples.names[j]}.{key}", estimate, getattr(written.friction[j].shape, key) or 0.0)
    return details


def without_doubtful(fit: Fit) -> tuple[JointFit, ...]:
    """The friction of a fit without terms that may be zero, or of either sign, after all.

    Selection sees gains in prediction, which errors that are correlated over the recording can
    cause; intervals count these.
    """
    estimates = iter(estimated(fit).linear[len(fit.rows.samples.regressor.base.names) :])
    laws = []
    for law in fit.friction:
        sure = {kind: not abs(each.value) < SIGNIFICANT_RATIO * (each.high - each.value) < np.inf
                for kind, each in zip(law.kinds, estimates, strict=False)}  # fmt: skip
        kinds = tuple(kind for kind in law.kinds if sure[kind] or kind in (VISCOUS, COULOMB))
        fall = law.shape.stribeck_velocity if EXCESS in kinds else None
        laws.append(replace(law, kinds=kinds, shape=replace(law.shape, stribeck_velocity=fall)))
    return tuple(laws)


def _missing_friction(fit: Fit, ranges: Array) -> dict[str, str]:
    """Friction that was not identified, by name, and why."""
    missing = dict[str, str]()
    for joint, law, span in zip(fit.rows.samples.names, fit.friction, ranges, strict=True):
        if span <= LEAST_RANGE:
            missing[f"{joint}.friction"] = (
                f"it moved only {span:.2g} rad or m where it cannot stick"
            )
        elif not law.kinds:
            missing[f"{joint}.friction"] = NO_FRICTION
        else:
            absent = [kind for kind in (VISCOUS, COULOMB) if kind not in law.kinds]
            missing |= {f"{joint}.{kind}": NO_FRICTION for kind in absent}
            if EXCESS not in law.kinds:
                missing[f"{joint}.static"] = "friction does not visibly fall with speed"
    return missing
