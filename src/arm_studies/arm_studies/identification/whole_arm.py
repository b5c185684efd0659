# SPDX-License-Identifier: Apache-2.0
"""Identification of a whole arm from its motion and torques: inertias, armatures and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.load import load_scene
from arm_dynamics.scene.schema import Scene
from arm_studies.identification import checks
from arm_studies.identification.data import JointRecord, records_of
from arm_studies.identification.described import scene_with
from arm_studies.identification.names import mapped, unwrapped
from arm_studies.identification.parameters import parameters, without_doubtful
from arm_studies.identification.preparation import EvenRecord, common_band, resampled
from arm_studies.identification.regression import irregularities
from arm_studies.identification.regression.age import age_of
from arm_studies.identification.regression.bandwidth import (
    mean_residual,
    noise_above,
    with_bandwidth,
)
from arm_studies.identification.regression.estimation import (
    NOISELESS,
    Belief,
    Mask,
    belief_of,
    common_columns,
    deviations,
)
from arm_studies.identification.regression.fit import Fit, fitted
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    COULOMB_SKEW,
    VISCOUS,
    JointFit,
)
from arm_studies.identification.regression.held_out import excess
from arm_studies.identification.regression.intervals import CERTAIN, STRICT, besides
from arm_studies.identification.regression.regressor import EACH, RigidRegressor
from arm_studies.identification.regression.rows import HELD_OUT, Rows, steady_friction
from arm_studies.identification.regression.selection import Choice
from arm_studies.identification.regression.tables import tabled
from arm_studies.identification.result import Identification, Torques

# Prior deviations of bodies from nominal: of density, of all else; selected by the evidence.
MASSES, SHAPES = (0.03, 0.06, 0.12, 0.3, 1.0), (1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0)
# Largest number of selections of friction laws until the bandwidth of the efforts is stable.
ROUNDS = 3
# Fraction of a joint's frictionless efforts that bodies must explain to identify its scale.
SHOWN = 0.7
# Fraction of the deviation of a joint's efforts that bodies must cause to identify its scale: if
# friction dominates, an error of its law or of the nominal bodies would be taken for the scale.
HEAVY = 0.5
# Prior deviations of bodies while scales are identified: of density, of all else. If bodies were
# fixed, an error of the last bodies would be taken for a scale of their joints.
NEAR = 0.03, 0.05
# Assumed errors of the nominal bodies, likewise, which limit the accuracy of scales, and by which
# columns of efforts are matched with joints.
DOUBT = 0.12, 0.2
WORSE = 1.03  # Ratio of residuals up to which friction terms that may be zero are left out.
# Fraction of the part held out in which a joint has to move for its prediction to be judged.
MOVING = 0.2


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
    told: Callable[[str], None] | None = None,
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
        told: Called with the name of each step as it begins.

    Returns:
        The scene, its parameters and their intervals.

    Raises:
        SceneError: If the nominal scene cannot be used.
        InvalidInput: If the recordings do not determine the parameters, or the nominal scene
            predicts the part held out better; says what is missing.
    """
    say = told or (lambda text: None)
    model = ArmModel(load_scene(scene))
    checks.check_model(model)
    turning = [kind != "prismatic" for kind in model.joint_types]
    records = [
        unwrapped(mapped(r, model.joint_names, names), turning) for r in records_of(recordings)
    ]
    for record in records:
        checks.check_record(record, model)
    say("filtering")
    sampled = [resampled(_in_torques(record, effort)) for record in records]
    run = _Run(model, sampled, band, effort == "scale", total_mass, masses or {}, held_out, say)
    found = run.done()
    if not accept_worse:
        checks.check_better(*found.error, run.excess)
    return found


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


class _Run:
    """One identification, step by step."""

    def __init__(
        self, model: ArmModel, recordings: list[EvenRecord], band: float | None, scaled: bool,
        total_mass: float | None, masses: Mapping[str, float], held_out: float,
        say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self.model, self.recordings, self.say = model, recordings, say
        self.regressor = RigidRegressor(model)
        self.names, self.held_out, self.band = model.joint_names, held_out, band
        self.scaled, self.scales, self.age = scaled, np.ones(model.n), 0.0
        self.notes = list(dict.fromkeys(n for each in recordings for n in each.notes))
        self._filter(common_band(recordings) if band is None else band)
        self.ranges = checks.moved(self.motions)
        checks.check_rows(self.rows, self.names, self.notes)
        nominal = self.regressor.nominal
        near = belief_of(nominal, len(nominal), *DOUBT)
        moving = self.rows.valid & ~self.rows.rests & self.rows.train[:, None]
        late = checks.check_columns(self.rows, moving, near, self.names)
        self.notes += late
        self.together = not 0 < len(late) < model.n
        if not scaled:
            self.notes += checks.check_scales(self.rows, self._train(), near, self.names)
        self.known_masses = self._mass_rows(total_mass, masses)
        self.sigmas = (MASSES[3], SHAPES[4])
        self.excess = 0.0

    def _filter(self, band: float, effort_band: float | None = None) -> None:
        """Filter all recordings at a band."""
        self.motions = [each.filtered(band, self.age) for each in self.recordings]
        self.rows = Rows(self.regressor, self.motions, effort_band, self.held_out)
        self.measured = self.rows.effort.copy()
        self.rows.effort = self.measured * self.scales

    # --- prior ---------------------------------------------------------------------------------

    def _mass_rows(
        self, total: float | None, masses: Mapping[str, float]
    ) -> list[tuple[dict[int, float], float]]:
        found = []
        if total is not None:
            every = {EACH * i: 1.0 for i in range(len(self.regressor.bodies))}
            found.append((every, float(total)))
        for name, mass in masses.items():
            if name not in self.regressor.bodies:
                raise InvalidInput(
                    f"masses: unknown '{name}'; allowed: {known_names(self.regressor.bodies)}"
                )
            found.append(({EACH * self.regressor.bodies.index(name): 1.0}, float(mass)))
        return found

    def belief(self, size: int) -> Belief:
        """The prior of ``size`` unknowns."""
        plain = belief_of(self.regressor.nominal, size, *self.sigmas)
        x0, rows = plain.x0.copy(), [plain.rows]
        for places, mass in self.known_masses:
            row = np.zeros((1, size))
            row[0, list(places)] = 1e5 / mass
            rows.append(row)
            mine = list(places)
            now = x0[mine].sum()
            for place in mine:  # the nominal bodies, of another density
                body = slice(place, place + EACH)
                x0[body] = x0[body] * mass / now
        return Belief(x0, np.vstack(rows))

    # --- steps ---------------------------------------------------------------------------------

    def done(self) -> Identification:
        """Run all steps."""
        simple = [JointFit((VISCOUS, COULOMB, COULOMB_SKEW)) for _ in self.names]
        self.say("fitting bodies with simple friction")
        if self.scaled:
            self._find_scales(self._train(), simple)
        first = self._without_sticking(self._within_bandwidth(simple), simple)
        if self.together and not all(motion.aged for motion in self.motions):
            first = self._matched(first, simple)
        self._believe(first)
        self.say("selecting friction laws by cross-validation")
        train, trial = self._with_laws(first)
        trial = tabled(self.rows, train, self.belief, trial)
        self._believe(trial)
        self.say("fitting all parameters")
        rows = self.rows
        trial = fitted(rows, train, self.belief, list(trial.friction), possible=True)
        whole = train | (rows.use & ~rows.train[:, None])
        whole = irregularities.without_outliers(self.names, rows, whole, trial)[0]
        final = fitted(rows, whole, self.belief, list(trial.friction), possible=True)
        laws = without_doubtful(self.regressor, *self._strictly(final, whole), whole)
        if any(a.kinds != b.kinds for a, b in zip(laws, final.friction, strict=True)):
            lean = fitted(rows, whole, self.belief, laws, possible=True)
            if mean_residual(lean.residual, whole) < WORSE * mean_residual(final.residual, whole):
                final, trial = lean, fitted(rows, train, self.belief, laws, possible=True)
        return self._result(trial, final, whole)

    def _strictly(self, final: Fit, used: Mask) -> tuple[Rows, Fit]:
        """Rows and a fit for which nothing is assumed of friction while joints may stick.

        Predictions gain by the assumption that it is then of the size of dry friction, but
        intervals have to do without it.
        """
        rows = self.rows.stricter(STRICT)
        return rows, fitted(rows, used, self.belief, list(final.friction))

    def _train(self) -> Mask:
        return np.asarray(self.rows.use & self.rows.train[:, None])

    def _within_bandwidth(self, laws: list[JointFit]) -> Fit:
        """Fit laws within the bandwidth of the efforts, and filter these above it."""
        fit = fitted(self.rows, self._train(), self.belief, laws)
        self.rows, fit = with_bandwidth(self.rows, self._train(), self.belief, fit)
        limit = noise_above(self.rows, self._train(), fit.residual) if self.band is None else None
        if limit is None:
            return fit
        self._filter(limit, self.rows.effort_band)
        fit = fitted(self.rows, self._train(), self.belief, laws)
        self.rows, fit = with_bandwidth(self.rows, self._train(), self.belief, fit)
        return fit

    def _without_sticking(self, fit: Fit, laws: list[JointFit]) -> Fit:
        """Clear rows of what joints that stick can cause, and fit them again."""
        sizes = [
            1.4826 * np.median(abs(left[mine])) if mine.any() else np.inf
            for left, mine in zip(fit.residual.T, self._train().T, strict=True)
        ]
        levels = [own.coefficients.get(COULOMB, 0.0) for own in fit.friction]
        exact = NOISELESS * np.sqrt((self.rows.effort**2).mean(axis=0))
        self.rows = self.rows.cleared(np.array(levels), np.maximum(np.array(sizes), exact))
        return fitted(self.rows, self._train(), self.belief, laws)

    def _matched(self, fit: Fit, laws: list[JointFit]) -> Fit:
        """Estimate the age of efforts, and fit them to the motion of their times."""
        now = fit

        def measured(age: float) -> tuple[float, float]:
            nonlocal now
            if age != self.age:
                self.age = age
                self._filter(self.motions[0].band, self.rows.effort_band)
                plain = fitted(self.rows, self._train(), self.belief, laws)
                now = self._without_sticking(plain, laws)
            ageing = self.rows.ageing(now.predicted(self.rows.plain))
            by, sd = besides(self.rows, now, ageing[:, :, None], self.belief)
            return float(by[0]), float(sd[0])

        self.notes += age_of(measured, self.motions[0].band)[1]
        return now

    def _with_laws(self, first: Fit) -> tuple[Mask, Fit]:
        """Select friction laws, leave out outliers, and adapt the bandwidth of the efforts."""
        train, fit = self._train(), first
        for again in range(ROUNDS):
            laws = self._chosen(train, fit)
            fit = fitted(self.rows, train, self.belief, laws)
            kept = train
            if not again:
                kept, notes = irregularities.without_outliers(self.names, self.rows, train, fit)
                self.notes += notes
            rows, fit = with_bandwidth(self.rows, train, self.belief, fit)
            if np.array_equal(kept, train) and rows is self.rows:
                break
            self.rows, train = rows, kept
        return train, fit

    def _chosen(self, train: Mask, fit: Fit) -> list[JointFit]:
        rows = self.rows
        load = fit.columns.predicted(fit.x) + rows.known
        size = len(self.regressor.nominal) + rows.n
        return Choice(rows, train, common_columns(rows, train), self.belief(size), load).run()

    def _believe(self, fit: Fit) -> None:
        """Select the prior deviations of bodies from nominal by the evidence of the data.

        The logarithm of the marginal likelihood of a linear model with a normal prior (MacKay,
        "Bayesian interpolation", Neural Computation 4(3), 1992).
        """
        R, z = fit.columns.whitened(
            self.rows.effort - self.rows.known, fit.weights, self.rows.independent
        )
        best = np.inf
        for sigmas in ((m, s) for m in MASSES for s in SHAPES):
            self.sigmas, before = sigmas, self.sigmas
            belief = self.belief(fit.columns.size)
            T, t = belief.combined(R, z)
            scale = np.maximum(abs(np.diag(T)), 1e-300)
            x = np.linalg.lstsq(T, t, rcond=1e-14)[0]
            misfit = np.sum((R @ x - z) ** 2) + np.sum((belief.rows @ (x - belief.x0)) ** 2)
            bodies = sum(
                2.0 * float(np.linalg.slogdet(belief.rows[i : i + EACH, i : i + EACH])[1])
                for i in range(0, len(self.regressor.nominal), EACH)
            )
            evidence = float(misfit + 2.0 * np.log(scale).sum() - bodies)
            if evidence < best:
                best, chosen = evidence, sigmas
            self.sigmas = before
        self.sigmas = chosen

    # --- scales of efforts ---------------------------------------------------------------------

    def _find_scales(self, train: Mask, laws: list[JointFit]) -> None:
        """Identify the torque per unit of effort, alternating with friction, until it converges.

        Bodies stay near nominal meanwhile: otherwise scales and bodies would shrink together,
        which reduces the residual of friction and noise.
        """
        rows, sigmas = self.rows, self.sigmas
        self.sigmas = NEAR
        shown = self._guess_scales(train, laws)
        for _ in range(30):
            rows.effort = self.measured * self.scales
            fit = fitted(rows, train, self.belief, laws)
            change = np.where(shown, self._rescaled(fit)[0], 0.0)
            self.scales *= np.exp(np.clip(change, -0.5, 0.5))
            if abs(change).max() < 1e-5:
                break
        rows.effort, self.sigmas = self.measured * self.scales, DOUBT
        _, doubt = self._rescaled(fitted(rows, train, self.belief, laws))
        self.sigmas = sigmas
        self._tell_scales(shown, doubt)

    def _guess_scales(self, train: Mask, laws: list[JointFit]) -> Mask:
        """Scales by the nominal bodies; returns which ones can be identified, shape (n,)."""
        rows = self.rows
        nominal = rows.rigid @ self.regressor.nominal + rows.known
        shown = np.zeros(rows.n, bool)
        for j, name in enumerate(self.names):
            mine = train[:, j]
            own = [rows.inertia[mine, j : j + 1], rows.friction(laws[j], j, nominal[:, j])[mine]]
            share, slope = _explained(self.measured[mine, j], np.hstack(own), nominal[mine, j])
            heavy = slope * nominal[mine, j].std() / self.measured[mine, j].std()
            shown[j] = share > SHOWN and heavy > HEAVY
            if shown[j]:
                self.scales[j] = 1.0 / slope
            else:
                self.notes.append(
                    f"'{name}': the scale of its efforts cannot be identified, because friction "
                    "dominates them; they are taken as torques"
                )
        return shown

    def _tell_scales(self, shown: Mask, doubt: Array) -> None:
        """Note intervals of scales.

        Args:
            shown: Which ones were identified, shape (n,).
            doubt: Their relative standard deviations, shape (n,).
        """
        lines = [
            f"{name} {k:.3g} ({k * np.exp(-CERTAIN * sd):.3g} to {k * np.exp(CERTAIN * sd):.3g})"
            for name, k, sd, there in zip(self.names, self.scales, doubt, shown, strict=True)
            if there
        ]
        if lines:
            self.notes.append(
                f"scales of efforts assume that densities of the nominal bodies are accurate to "
                f"{DOUBT[0]:.0%} and their shapes to {DOUBT[1]:.0%}: " + ", ".join(lines)
            )

    def _rescaled(self, fit: Fit) -> tuple[Array, Array]:
        """Relative corrections of scales, with all unknowns free, and their deviations.

        The residual is that of the measured efforts, so that small scales do not reduce it:
        e - A x / k is linear in x and in the change of k.
        """
        predicted = fit.columns.predicted(fit.x) + self.rows.known
        more = -predicted[:, :, None] * np.eye(self.rows.n)
        return besides(self.rows, fit, more, self.belief)

    # --- result --------------------------------------------------------------------------------

    def _result(self, trial: Fit, final: Fit, used: Mask) -> Identification:
        """The result of a fit of the rows that are not held out, and of one of all rows."""
        rows = self.rows.plain
        self.ranges = self.ranges * rows.use.any(axis=0)
        predicted, after = trial.predicted(rows), final.predicted(rows)
        nominal, test = self._nominal(rows), self._judging()
        ratios = self._ratios(nominal)
        shown = test if test.any() else self._train()
        checks.check_explained(
            _relative(rows.effort, predicted, shown)[0], _relative(rows.effort, nominal, shown)[0],
            self.names, ratios,
        )  # fmt: skip
        self.excess = excess(self.rows, test, trial, self.rows.clear(nominal), self.belief)
        errors = self._errors(predicted, nominal, test)
        self._tell_no_better(*errors["error"])
        strict = self._strictly(final, used)
        known = parameters(self.regressor, *strict, used, self.ranges, final)
        self._tell_irregularities(trial, final, used)
        scene, friction = self._scene(final, known["missing"], ratios)
        torques = self._torques(
            predicted=np.where(rows.train[:, None], after, predicted), nominal=nominal,
            friction=rows.effort - after + final.own_predicted(rows),
        )  # fmt: skip
        return Identification(
            scene=scene, joint_names=self.names, friction=friction,
            bodies=final.x[: final.bodies].reshape(-1, EACH), body_names=self.regressor.bodies,
            scales=self.scales.copy(), band=self.motions[0].band, effort_band=rows.effort_band,
            notes=tuple(self.notes), torques=torques, **errors, **known,
        )  # fmt: skip

    def _errors(self, predicted: Array, nominal: Array, test: Mask) -> dict[str, Any]:
        """What an ``Identification`` says of its errors on the part held out."""
        measured = self.rows.plain.effort
        error, each = _relative(measured, predicted, test)
        before, each_before = _relative(measured, nominal, test)
        left = np.where(test.any(axis=0), deviations(measured, predicted, test), np.nan).tolist()
        torque_error, nominal_error, residual = (
            dict(zip(self.names, values, strict=True)) for values in (each, each_before, left)
        )
        return {
            "torque_error": torque_error, "nominal_error": nominal_error,
            "error": (error, before), "torque_residual": residual,
        }  # fmt: skip

    def _scene(
        self, fit: Fit, missing: Mapping[str, str], ratios: Array
    ) -> tuple[Scene, tuple[JointFit | None, ...]]:
        """The identified scene, and its friction, None of a joint that did not move."""
        still = self.ranges <= checks.MOVED
        friction = tuple(
            None if rests else own for rests, own in zip(still, fit.friction, strict=True)
        )
        unknown = [f"{name}.armature" in missing for name in self.names]
        armature = fit.x[fit.bodies : fit.bodies + self.rows.n]
        armature = np.where(unknown & (self.ranges < checks.MOVED), np.nan, armature)
        theta = fit.x[: fit.bodies]
        if not (self.scaled or self.known_masses):  # else the unit of efforts is not the cause
            masses = self.regressor.nominal[::EACH]
            checks.check_masses(theta[::EACH], masses, self.names, ratios)
        scene = scene_with(self.model, theta, armature, friction, self.notes)
        self._check(scene, theta)
        if fit.changed:
            self.notes.append(
                "the unconstrained fit is physically inconsistent; the best consistent one is used"
            )
        return scene, friction

    def _judging(self) -> Mask:
        """Rows by which the prediction of each joint is judged: none if it rests in most of them.

        Those that are held out, or all of them if none is.

        The torque of a joint at rest may be anything that static friction holds, so that its
        prediction tells nothing.
        """
        rows, train = self.rows, self.rows.train[:, None]
        test = train if train.all() else ~train
        known = np.count_nonzero(rows.valid & test, axis=0)
        moving = np.count_nonzero(rows.use & test, axis=0) * (self.ranges > checks.MOVED)
        resting = (moving < MOVING * known) & (known > 0)
        part = f"the part held out (the last {self.held_out:.0%} of each recording)"
        for found, why in (
            (resting, f"at rest in most of {part}; let the motion go on to the end, or cut off "
                      "what follows it"),
            (known == 0, f"without an effort in {part}"),
        ):  # fmt: skip
            names = [f"'{name}'" for name, there in zip(self.names, found, strict=True) if there]
            if names:
                self.notes.append(f"no error is known of {known_names(names)}: {why}")
        return np.asarray(rows.valid & test & ~resting)

    def _torques(self, predicted: Array, nominal: Array, friction: Array) -> Torques:
        """Measured and other torques, shapes (k, n), NaN where samples are not valid."""
        rows = self.rows.plain

        def valid(values: Array) -> Array:
            return np.where(rows.valid, values, np.nan)

        return Torques(
            time=np.concatenate([m.time for m in rows.motions]), measured=valid(rows.effort),
            predicted=valid(predicted), nominal=valid(nominal), v=rows.v,
            friction=valid(friction), held_out=~rows.train,
        )  # fmt: skip

    def _nominal(self, rows: Rows) -> Array:
        """Torques of the nominal scene, low-pass filtered, shape (k, n)."""
        model = self.model
        load = rows.rigid @ self.regressor.nominal + rows.known + rows.inertia * model.armature
        return np.asarray(load + steady_friction(rows, load))

    def _ratios(self, nominal: Array) -> Array:
        rows = self.rows
        sums = [
            (rows.effort[u, j] @ nominal[u, j], nominal[u, j] @ nominal[u, j])
            for j, u in enumerate((rows.use & rows.train[:, None]).T)
        ]
        return np.array([a / b if b > 0.0 else 1.0 for a, b in sums])

    def _tell_no_better(self, error: float, nominal: float) -> None:
        """Note a nominal scene that predicts better."""
        if error > max(nominal, checks.ROUNDING):
            self.notes.append(
                f"the nominal scene leaves less of the part held out, {nominal:.3%} against "
                f"{error:.3%}; beyond what noise in the estimates explains, that is "
                f"{self.excess:.1f} standard errors"
            )

    def _tell_irregularities(self, trial: Fit, final: Fit, used: Mask) -> None:
        if self.rows.effort_band is not None:
            self.notes.append(
                f"efforts do not follow the motion above about {self.rows.effort_band:.3g} Hz: "
                "they were filtered before, or predictions are only position noise there; "
                "predictions are filtered likewise"
            )
        self.notes += irregularities.sticking(self.names, self.rows)
        self.notes += irregularities.drifts(self.names, self.rows, final, used)
        turning = [kind != "prismatic" for kind in self.model.joint_types]
        self.notes += irregularities.ripples(self.names, turning, self.rows, trial, self.belief)
        self.notes += irregularities.tilts(self.regressor, self.rows, trial, self.belief)

    def _check(self, scene: Any, theta: Array) -> None:
        """Check that the scene that is returned has the identified bodies."""
        again = RigidRegressor(ArmModel(scene)).nominal
        if not np.allclose(again, theta, rtol=1e-6, atol=1e-9 * abs(theta).max()):
            raise InvalidInput("the identified inertias could not be written into the URDF")


def _explained(y: Array, columns: Array, more: Array) -> tuple[float, float]:
    """Fraction of the residual of y that one more column explains, and its coefficient."""
    both = np.column_stack([columns, more])
    alone = y - columns @ np.linalg.lstsq(columns, y, rcond=1e-10)[0]
    x = np.linalg.lstsq(both, y, rcond=1e-10)[0]
    left = y - both @ x
    return 1.0 - float(left @ left) / max(float(alone @ alone), 1e-300), float(x[-1])


def _relative(measured: Array, predicted: Array, use: Mask) -> tuple[float, list[float]]:
    """Relative residual of all joints together, and of each; NaN without a row."""
    left = np.where(use, (measured - predicted) ** 2, 0.0).sum(axis=0)
    size = np.where(use, measured**2, 0.0).sum(axis=0)
    each = np.where(use.any(axis=0), np.sqrt(left / np.maximum(size, 1e-300)), np.nan)
    whole = np.sqrt(left.sum() / max(size.sum(), 1e-300)) if use.any() else np.nan
    return float(whole), each.tolist()
