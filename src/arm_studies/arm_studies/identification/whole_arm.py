# SPDX-License-Identifier: Apache-2.0
"""Identification of a whole arm from its motion and torques: inertias, armatures and friction.

A pipeline: recordings are read and checked, filtered, fitted with simple friction, with selected
friction laws, and with possible bodies; then the fit is judged on what was held out, and written
into a scene.
"""

from collections.abc import Callable, Container, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from arm_dynamics import ArmModel, Scene
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_studies._renaming import renamed_argument
from arm_studies.identification import checks, parameters
from arm_studies.identification.data import JointRecord
from arm_studies.identification.identified_scene import scene_with
from arm_studies.identification.regression import bandwidth, irregularities, uncertainty
from arm_studies.identification.regression.consistent_fit import consistent_fit
from arm_studies.identification.regression.efforts import NOMINAL_ERRORS, scales_of, with_age
from arm_studies.identification.regression.estimation import NOISELESS, Prior, Problem
from arm_studies.identification.regression.evidence import most_evident_prior
from arm_studies.identification.regression.fit import Fit, fitted
from arm_studies.identification.regression.friction import COULOMB, SIMPLE_LAW, JointFit
from arm_studies.identification.regression.regressor import PER_BODY, RigidRegressor
from arm_studies.identification.regression.rows.rows import ArmRecordings, Rows
from arm_studies.identification.regression.rows.samples import HELD_OUT
from arm_studies.identification.regression.selection import select_laws
from arm_studies.identification.regression.tables import with_tables
from arm_studies.identification.result import Identification, IdentifiedJoint, Torques
from arm_studies.identification.validation import validate

PRIOR = 0.3, 0.2  # prior deviations of bodies in the first fit, see ``evidence``
# Largest number of selections of friction laws until the bandwidth of the efforts is stable.
ROUNDS = 3
LEAN_RATIO = 1.03  # Ratio of residuals up to which friction terms that may be zero are left out.


@renamed_argument("told", "on_progress")
def identify(
    scene: Any,
    recordings: Any,
    *,
    band: float | None = None,
    effort: str | Mapping[str, float] = "torque",
    names: Mapping[str, str] | None = None,
    total_mass: float | None = None,
    masses: Mapping[str, float] | None = None,
    held_out: float = HELD_OUT,
    accept_worse: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> Identification:
    """Identify inertias, armatures and friction of an arm from its motion and its torques.

    Args:
        scene: Nominal scene, anything ``load_scene`` accepts: its geometry is taken as exact, its
            inertias as a first guess.
        recordings: One or several: a ``JointRecord`` or a recording with ``time``, ``q``, ``v``,
            ``tau`` and ``joint_names``.
        band: Cut-off frequency of the low-pass filter in [Hz]; None: chosen from the noise.
        effort: Meaning of efforts: ``torque`` in [N m] or [N]; ``scale``: proportional to torque
            with an unknown scale per joint, which is identified where the motion determines it;
            or the torque per unit of effort by joint, for example per ampere.
        names: Joint names of the recordings by those of the scene, where they cannot be matched.
        total_mass: Known mass of all moving bodies in [kg], without payloads.
        masses: Known masses of bodies in [kg], by the joint that moves them.
        held_out: Fraction of each recording, at its end, that is held out to measure errors.
        accept_worse: Whether to return a scene that predicts the part held out worse than the
            nominal scene does.
        on_progress: Called with the name of each step as it begins.

    Returns:
        The scene, its parameters and their intervals.

    Raises:
        SceneError: If the nominal scene cannot be used.
        InvalidInput: If the recordings do not determine the parameters, or the nominal scene
            predicts the part held out better; says what is missing.
    """
    report = on_progress or (lambda step: None)
    model, records = checks.usable_inputs(scene, recordings, names)
    report("filtering")
    data = ArmRecordings.of(model, [_in_torques(each, effort) for each in records], band, held_out)
    rows, notes = data.rows(), data.notes
    train, near = rows.samples.train[:, None], Prior.near(data.regressor.nominal, *NOMINAL_ERRORS)
    moving = Problem(rows, rows.samples.valid & ~rows.samples.rests & train, near)
    ranges, delay_notes = checks.check_rows(moving, notes)
    notes += delay_notes
    if effort != "scale":
        notes += checks.check_scales(Problem(rows, rows.samples.use & train, near))
    known_masses = _known_masses(data.regressor, total_mass, masses or {})
    prior = partial(Prior.near, data.regressor.nominal, known_masses=known_masses)

    report("fitting bodies with simple friction")
    if effort == "scale":
        scales, remarks = scales_of(rows, [SIMPLE_LAW] * model.n, prior)
        data, rows = replace(data, scales=scales), replace(rows, scales=scales)
        notes += remarks
    has_age = len(delay_notes) in (0, model.n)  # of all efforts, not of some joints' only
    fit, remarks = _first_fit(data, rows, prior(*PRIOR), can_narrow=band is None, has_age=has_age)
    notes += remarks
    report("selecting friction laws by cross-validation")
    fit, remarks = _with_selected_laws(fit.unfitted(prior=most_evident_prior(fit, prior)))
    notes += remarks
    fit = with_tables(fit)
    report("fitting all parameters")
    fits = _consistent_fits(fit.unfitted(prior=most_evident_prior(fit, prior)))
    return _identification(
        fits, ranges, held_out, notes, check_units=effort != "scale" and not known_masses,
        accept_worse=accept_worse,
    )  # fmt: skip


def _in_torques(record: JointRecord, effort: str | Mapping[str, float]) -> JointRecord:
    if isinstance(effort, str):
        if effort not in ("torque", "scale"):
            raise InvalidInput(
                f"effort is '{effort}'; allowed: torque, scale, or a number for each joint"
            )
        return record
    if missing := [name for name in record.joint_names if name not in effort]:
        raise InvalidInput(
            f"effort has no torque per unit for joint {known_names(missing)}; one for each joint "
            "is expected"
        )
    factors = np.array([effort[name] for name in record.joint_names])
    return replace(record, effort=record.effort * factors)


def _known_masses(
    regressor: RigidRegressor, total: float | None, masses: Mapping[str, float]
) -> list[tuple[list[int], float]]:
    """Places of masses, and their sums in [kg]."""
    bodies, sums = regressor.bodies, []
    if total is not None:
        sums.append(([PER_BODY * i for i in range(len(bodies))], float(total)))
    for name, mass in masses.items():
        if name not in bodies:
            raise InvalidInput(f"masses: unknown '{name}'; allowed: {known_names(bodies)}")
        sums.append(([PER_BODY * bodies.index(name)], float(mass)))
    return sums


def _first_fit(
    data: ArmRecordings, rows: Rows, prior: Prior, *, can_narrow: bool, has_age: bool
) -> tuple[Fit, list[str]]:
    """The fit of simple friction, within the bandwidth of the efforts, and of their age.

    Args:
        data: The recordings.
        rows: Those of the data as they are.
        prior: Of the bodies.
        can_narrow: Whether the band may be narrowed.
        has_age: Whether the efforts of all joints may have one and the same age.
    """
    fit = bandwidth.with_bandwidth(_simple_fit(rows, prior))
    if can_narrow:
        limit = bandwidth.noise_frequency(fit.rows, fit.problem.use, fit.residual)
        if limit is not None:
            data = replace(data, band=limit)
            fit = bandwidth.with_bandwidth(_simple_fit(data.rows(fit.rows.effort_band), prior))
    fit = _without_sticking(fit)
    if not has_age or all(motion.aged for motion in fit.rows.samples.motions):
        return fit, []
    return _with_best_age(fit, data)


def _simple_fit(rows: Rows, prior: Prior) -> Fit:
    """A fit of simple friction of every joint."""
    problem = Problem(rows, rows.samples.use & rows.samples.train[:, None], prior)
    return fitted(problem, [SIMPLE_LAW] * rows.samples.n)


def _without_sticking(fit: Fit) -> Fit:
    """Clear rows of what joints that stick can cause, and fit them again."""
    sizes = np.array([
        1.4826 * np.median(abs(residual[use])) if use.any() else np.inf
        for residual, use in zip(fit.residual.T, fit.problem.use.T, strict=True)
    ])  # fmt: skip
    levels = np.array([law.coefficients.get(COULOMB, 0.0) for law in fit.friction])
    exact = NOISELESS * np.sqrt((fit.rows.effort**2).mean(axis=0))
    rows = fit.rows.whitened(levels, np.maximum(sizes, exact))
    return _simple_fit(rows, fit.problem.prior)


def _with_best_age(fit: Fit, data: ArmRecordings) -> tuple[Fit, list[str]]:
    """The fit to efforts of the age that suits them, with a note."""

    def fit_at(age: float) -> tuple[Fit, float, float]:
        trial = fit
        if age != 0.0:
            rows = replace(data, age=age).rows(fit.rows.effort_band)
            trial = _without_sticking(_simple_fit(rows, fit.problem.prior))
        ageing = trial.rows.ageing(trial.predicted(trial.rows.unwhitened))
        change, deviation = uncertainty.added_coefficients(trial, ageing[:, :, None])
        return trial, float(change[0]), float(deviation[0])

    return with_age(fit_at, fit.rows.samples.band)


def _with_selected_laws(fit: Fit) -> tuple[Fit, list[str]]:
    """Select friction laws, leave out outliers, and adapt the bandwidth of the efforts."""
    notes = list[str]()
    for attempt in range(ROUNDS):
        use = kept = fit.problem.use
        fit = fitted(fit.problem, select_laws(fit))
        if attempt == 0:
            kept, notes = irregularities.without_outliers(fit, use)
        before, fit = fit.rows, bandwidth.with_bandwidth(fit)
        if np.array_equal(kept, use) and fit.rows is before:
            break
        fit = fit.unfitted(use=kept)
    return fit, notes


class _Fits(NamedTuple):
    """Fits of the same laws with possible bodies, without friction terms that may be zero.

    Attributes:
        trial: Of the rows that are not held out.
        final: Of all rows.
        strict: Of all rows, with nothing assumed of friction while joints may stick. Predictions
            gain by the assumption that it is then of the size of dry friction, but intervals have
            to do without it.
    """

    trial: Fit
    final: Fit
    strict: Fit


def _consistent_fits(fit: Fit) -> _Fits:
    """Fit possible bodies to the rows that are not held out, and to all rows."""
    rows = fit.rows
    trial = consistent_fit(fit.refitted())
    whole = fit.problem.use | (rows.samples.use & ~rows.samples.train[:, None])
    use, _ = irregularities.without_outliers(trial, whole)
    final = consistent_fit(trial.refitted(use=use))
    strict = final.refitted(rows=rows.with_larger_torques(uncertainty.UNKNOWN_FRICTION))
    laws = parameters.without_doubtful(strict)
    if any(a.kinds != b.kinds for a, b in zip(laws, final.friction, strict=True)):
        lean_fit = consistent_fit(fitted(final.problem, laws))
        before, after = (bandwidth.mean_residual(fit.residual, use) for fit in (final, lean_fit))
        if after < LEAN_RATIO * before:
            trial, final = consistent_fit(fitted(trial.problem, laws)), lean_fit
            strict = final.refitted(rows=rows.with_larger_torques(uncertainty.UNKNOWN_FRICTION))
    return _Fits(trial, final, strict)


def _identification(
    fits: _Fits, ranges: Array, held_out: float, notes: list[str], *, check_units: bool,
    accept_worse: bool,
) -> Identification:  # fmt: skip
    """The result of fits, unless what was held out, or the masses, speak against it.

    Args:
        fits: The fits.
        ranges: How far each joint moved in [rad] or [m], shape (n,).
        held_out: Fraction of each recording that is held out.
        notes: Irregularities so far; receives those of the result.
        check_units: Whether masses far from the nominal ones show a wrong unit of efforts.
        accept_worse: Whether the scene may be worse than the nominal one.
    """
    trial, final, strict = fits
    samples = final.rows.samples
    regressor = samples.regressor
    ranges = ranges * samples.use.any(axis=0)
    validation = validate(trial, ranges, held_out)
    notes += validation.notes
    estimates = uncertainty.estimated(strict)
    details = parameters.details_of(estimates, strict, ranges, final)
    notes += irregularities.notes_of(trial, final)
    if check_units:
        masses = final.theta[::PER_BODY], regressor.nominal[::PER_BODY]
        checks.check_masses(*masses, samples.names, validation.ratios)
    missing = {name for name, parameter in details.items() if parameter.missing}
    scene, laws = _scene(final, ranges, missing, notes)
    if not accept_worse:
        checks.check_better(*validation.error, validation.excess)
    scales = np.broadcast_to(final.rows.scales, samples.n).tolist()
    columns = samples.names, laws, scales, validation.joints, validation.residuals
    return Identification(
        scene=scene, joints=tuple(map(IdentifiedJoint, *columns)), details=details,
        bodies=final.theta.reshape(-1, PER_BODY), body_names=regressor.bodies,
        error=validation.error, band=samples.band, effort_band=final.rows.effort_band,
        condition=estimates.condition, notes=tuple(notes),
        torques=_torques(trial, final, validation.nominal),
    )  # fmt: skip


def _scene(
    fit: Fit, ranges: Array, missing: Container[str], notes: list[str]
) -> tuple[Scene, tuple[JointFit | None, ...]]:
    """The identified scene, and its friction, None of a joint that did not move.

    Args:
        fit: Of all parameters.
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        missing: Names of parameters that were not identified.
        notes: Receives a line for each result that a scene cannot express.
    """
    rests = ranges <= checks.LEAST_RANGE
    laws = tuple(None if still else law for still, law in zip(rests, fit.friction, strict=True))
    unknown = [f"{name}.armature" in missing for name in fit.rows.samples.names]
    armature = np.where(unknown & (ranges < checks.LEAST_RANGE), np.nan, fit.armature)
    scene = scene_with(fit.rows.samples.regressor.model, fit.theta, armature, laws, notes)
    written = RigidRegressor(ArmModel(scene)).nominal  # it has the bodies that were identified
    if not np.allclose(written, fit.theta, rtol=1e-6, atol=1e-9 * abs(fit.theta).max()):
        raise InvalidInput("the identified inertias could not be written into the URDF")
    if fit.is_corrected:
        notes.append(
            "the unconstrained fit is physically inconsistent; the best consistent one is used"
        )
    return scene, laws


def _torques(trial: Fit, final: Fit, nominal: Array) -> Torques:
    """Measured and other torques, shapes (k, n), NaN where samples are not valid."""
    rows = trial.rows.unwhitened
    after = final.predicted(rows)
    predicted = np.where(rows.samples.train[:, None], after, trial.predicted(rows))

    def valid(values: Array) -> Array:
        return np.where(rows.samples.valid, values, np.nan)

    return Torques(
        time=np.concatenate([m.time for m in rows.samples.motions]), measured=valid(rows.effort),
        predicted=np.where(rows.samples.use, predicted, np.nan), nominal=valid(nominal),
        v=rows.samples.v, held_out=~rows.samples.train,
        friction=valid(rows.effort - after + final.predicted_friction(rows)),
    )  # fmt: skip
