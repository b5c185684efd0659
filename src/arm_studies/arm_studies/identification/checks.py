# SPDX-License-Identifier: Apache-2.0
"""Checks that refuse recordings from which no trustworthy scene can be identified."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.scene.friction import STATEFUL
from arm_studies.identification.data import JointRecord, MeasuredMotion
from arm_studies.identification.identified_scene import SCENE_KEYS
from arm_studies.identification.names import joint_records
from arm_studies.identification.regression import effort_faults
from arm_studies.identification.regression.estimation import Problem
from arm_studies.identification.regression.rows.samples import Samples

SLACK = 0.2  # Tolerance of positions beyond the limits of the URDF in [rad] or [m].
LEAST_RANGE = 1e-3  # Range in [rad] or [m] below which a joint has not moved.
# Largest residual of a fit relative to the torques; above it the model is of another robot.
LARGEST_RESIDUAL = 0.6
OUT_OF_SCALE = 5.0  # Largest factor between identified and nominal masses, in the median.
# Factor between efforts and the torques of nominal bodies that only another unit explains.
OTHER_UNIT = 20.0
LONGEST_STEP = 0.2  # Largest sampling interval in [s] from which a motion can be identified.
# Standard errors by which a scene must predict worse than the nominal one to be refused; chance
# alone makes more once in 160 recordings.
STANDARD_ERRORS = 2.5
ROUNDING = 1e-6  # Relative residual below which a prediction is exact.
LEAST_ROWS = 50  # Smallest number of independent measurements of each joint.


def usable_inputs(
    scene: Any, recordings: Any, names: Mapping[str, str] | None = None
) -> tuple[ArmModel, list[JointRecord]]:
    """The arm of a scene, and its joints from recordings of them, if both can be used.

    Args:
        scene: Anything ``load_scene`` accepts.
        recordings: One or several of any kind.
        names: Joint names of the recordings by those of the scene, where they cannot be matched.

    Raises:
        SceneError: If the scene cannot be used.
        InvalidInput: If joint torques do not follow from the joints' motion, or a recording is of
            another arm, without efforts, or in other units; with the joint, the value and what is
            expected.
    """
    model = ArmModel(load_scene(scene))
    check_model(model)
    records = joint_records(recordings, model, names)
    for record in records:
        check_record(record, model)
    return model, records


def check_model(model: ArmModel) -> None:
    """Refuse scenes whose joint torques do not follow from the joints' motion."""
    if model.scene.bilateral:
        raise InvalidInput(
            "the scene has closed loops: forces within them are not measured, so torques do not "
            "determine the inertias; remove the constraints and lock the joints that they drive"
        )
    for name, drive in zip(model.joint_names, model.drives, strict=True):
        if drive is not None and drive.coupling is not None:
            raise InvalidInput(
                f"joint '{name}' has a flexible transmission: the motion of its link does not "
                "determine that of its rotor; remove 'transmission' from the scene and identify "
                "it by tests of the drive"
            )
        friction = model.scene.joint(name).friction.model_dump(exclude_defaults=True)
        if odd := [key for key in friction if key not in (*SCENE_KEYS, *STATEFUL)]:
            raise InvalidInput(
                f"joint '{name}' has 'friction.{odd[0]}', which cannot be identified; remove it "
                f"from the scene (identified are {known_names(SCENE_KEYS)}; kept: "
                f"{known_names(STATEFUL)})"
            )


def check_record(record: JointRecord, model: ArmModel) -> None:
    """Refuse recordings without efforts, or in other units."""
    step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else 0.0
    if step > LONGEST_STEP:
        raise InvalidInput(
            f"{record.name}: samples are {step:.3g} s apart; allowed: at most {LONGEST_STEP} s "
            "(are the times in milliseconds or nanoseconds?)"
        )
    limits = zip(model.position_lower, model.position_upper, strict=True)
    for j, (name, (lower, upper)) in enumerate(zip(record.joint_names, limits, strict=True)):
        efforts = record.effort[np.isfinite(record.effort[:, j]), j]
        if not efforts.size:
            raise InvalidInput(
                f"{record.name}: no effort of joint '{name}'; masses and friction cannot be "
                "identified without torques"
            )
        if np.ptp(efforts) == 0.0:
            raise InvalidInput(
                f"{record.name}: the effort of joint '{name}' is constantly {efforts[0]:g}: it is "
                "not measured, or the drive is off"
            )
        reach = record.q[np.isfinite(record.q[:, j]), j]
        if reach.size and (reach.min() < lower - SLACK or reach.max() > upper + SLACK):
            raise InvalidInput(
                f"{record.name}: positions of joint '{name}' range from {reach.min():.4g} to "
                f"{reach.max():.4g}, but its limits are {lower:.4g} to {upper:.4g} (another "
                "robot, or degrees?)"
            )


def check_rows(problem: Problem, notes: Sequence[str]) -> tuple[Array, list[str]]:
    """Refuse motions that are too small or too short, and efforts that they do not explain.

    Args:
        problem: The regression's rows, those in which joints move, and how far the bodies may be
            from the nominal ones.
        notes: Irregularities of the recordings, of which those of a joint that is refused are
            told.

    Returns:
        Range of each joint's position in [rad] or [m], shape (n,); and notes of delays of efforts
        that matter little.

    Raises:
        InvalidInput: With the joints, and how to correct their efforts.
    """
    ranges = moved(problem.rows.samples.whole)
    check_count(problem.rows.samples, notes)
    return ranges, check_columns(problem)


def moved(motions: Sequence[MeasuredMotion]) -> Array:
    """Range of each joint's position in [rad] or [m], shape (n,), of which one is enough."""
    ranges = np.max([np.ptp(motion.q, axis=0) for motion in motions], axis=0)
    if (ranges < LEAST_RANGE).all():
        raise InvalidInput(
            f"no joint moves: the largest range of a joint is {ranges.max():.3g} rad or m; a "
            "motion of all joints is expected, fast and slow, over much of their ranges"
        )
    return np.asarray(ranges)


def check_count(samples: Samples, notes: Sequence[str]) -> None:
    """Refuse recordings that are too short, or saturated most of the time."""
    counts = samples.valid[samples.train].sum(axis=0) * samples.independent
    shares = samples.valid.mean(axis=0)
    for name, count, share in zip(samples.names, counts, shares, strict=True):
        if count < LEAST_ROWS:
            remarks = "".join(f"; {note}" for note in notes if note.startswith(f"'{name}'"))
            raise InvalidInput(
                f"joint '{name}': {share:.0%} of the samples can be used, which is {count:.0f} "
                f"independent measurements; at least {LEAST_ROWS} are expected (its effort is "
                f"saturated, missing or frozen, or the recording is too short){remarks}"
            )


def check_columns(problem: Problem) -> list[str]:
    """Refuse efforts that another sign, another joint's motion or a delay explains far better."""
    messages, names = [], problem.rows.samples.names
    for match in effort_faults.swaps(problem):
        sign, own = ("-1 times " if match.sign < 0 else ""), match.column == match.joint
        whose = "the torque of its motion" if own else f"that of '{names[match.joint]}'"
        messages.append(f"the effort of '{names[match.column]}' is {sign}{whose}")
    if messages:
        raise InvalidInput(
            f"{'; '.join(messages)}: exchange the columns of joints that are swapped, and give "
            "the torque per unit of effort, negative for a joint whose sign is reversed (per unit)"
        )
    gross, notes = [], []
    for x in effort_faults.delays(problem):
        more = " or more" if abs(x.lag) > effort_faults.BEYOND_GRID else ""
        delay = "late by" if x.lag > 0.0 else "ahead of the motion by"
        text = (
            f"'{names[x.joint]}': its efforts are {delay} {1e3 * abs(x.lag):.3g} ms{more}, which "
            "causes most of what bodies and friction do not explain (residual "
            f"{x.residual:.1%}, without the delay {x.remainder:.1%}); shift the column of its "
            "efforts by that time"
        )
        if x.is_gross:
            gross.append(text)
        notes.append(
            f"{text}, if that is so: friction of another shape, such as a Stribeck peak, can look "
            "like it"
        )
    if gross:
        raise InvalidInput("; ".join(gross))
    return notes


def check_scales(problem: Problem) -> list[str]:
    """Refuse efforts that are so many times the torque, or so few, that no bodies explain it.

    Torques alone do not tell a scale from a density: less of it is noted, with both explanations.

    Args:
        problem: Its prior says how far bodies may be from the nominal ones.

    Returns:
        Notes of the joints.

    Raises:
        InvalidInput: With the joints, and how to correct their efforts.
    """
    gross, notes, names = [], [], problem.rows.samples.names
    for x in effort_faults.scales(problem):
        name, span = names[x.joint], f"{x.factor:.2g} ({x.low:.2g} to {x.high:.2g})"
        if x.low > OTHER_UNIT or x.high < 1.0 / OTHER_UNIT:
            gross.append(f"{name} {span}")
        verb = "may be" if x.low < 1.0 < x.high else "are"
        notes.append(
            f"'{name}': its efforts {verb} scaled by about {span} against the torques of the "
            "nominal bodies: either their gain or unit is another (then give the torque per unit "
            f"of effort, about {1.0 / x.factor:.2g}, or let scales be identified: per unit, "
            "effort scale), or the nominal scene lacks a payload or has other masses"
        )
    if gross:
        raise InvalidInput(
            f"efforts over nominal torques: {known_names(gross)}; allowed: "
            f"{1.0 / OTHER_UNIT:g} to {OTHER_UNIT:g}: they are not in N m, but for example in "
            "N mm or per mille of a rated torque; give the torque per unit of effort (per unit), "
            "or let scales be identified (effort scale)"
        )
    return notes


def check_explained(error: float, nominal: float, names: Sequence[str], scales: Array) -> None:
    """Refuse a fit that hardly predicts the data it was not fitted to.

    Args:
        error: Relative residual of the held-out torques.
        nominal: That of the nominal scene.
        names: Joint names.
        scales: Efforts over the torques of the nominal scene, by joint; 1 where unknown.

    Raises:
        InvalidInput: With possible causes.
    """
    if not error < LARGEST_RESIDUAL:  # nor NaN
        raise InvalidInput(
            f"the best fit leaves {error:.0%} of the torques held out unexplained (the nominal "
            f"scene {nominal:.0%}); allowed: at most {LARGEST_RESIDUAL:.0%} (another robot, wrong "
            f"joint names, efforts that are not torques, or contact?){_odd_scales(names, scales)}"
        )


def _odd_scales(names: Sequence[str], scales: Array) -> str:
    """Joints whose efforts are far from the torques of the nominal scene, for messages."""
    pairs = zip(names, scales, strict=True)
    odd = [f"{name} {x:.3g}" for name, x in pairs if not 1.0 / OUT_OF_SCALE < x < OUT_OF_SCALE]
    return f"; efforts over nominal torques: {known_names(odd)}" if odd else ""


def check_better(error: float, nominal: float, excess: float) -> None:
    """Refuse a scene that predicts the part held out worse than the one it comes from.

    Args:
        error: Relative residual of the held-out torques; NaN if it is unknown.
        nominal: That of the nominal scene.
        excess: By how many standard errors it is worse, see ``validation.excess``.

    Raises:
        InvalidInput: With both.
    """
    if error > max(nominal, ROUNDING) and excess > STANDARD_ERRORS:
        raise InvalidInput(
            f"the identified scene leaves {error:.3%} of the torques held out, more than the "
            f"nominal scene, {nominal:.3%}, and more than noise explains ({excess:.1f} standard "
            f"errors; allowed: up to {STANDARD_ERRORS:g}): use the nominal scene, record a longer "
            "motion of all joints, or accept the identified scene nevertheless (accept worse)"
        )


def check_masses(masses: Array, nominal: Array, names: Sequence[str], scales: Array) -> None:
    """Refuse bodies many times heavier or lighter than the nominal ones.

    Args:
        masses: Masses in [kg], shape (bodies,).
        nominal: Those of the nominal scene.
        names: Joint names.
        scales: Efforts over the torques of the nominal scene, by joint; 1 where unknown.

    Raises:
        InvalidInput: With possible causes.
    """
    present = nominal > 0.0
    ratio = float(np.median(masses[present] / nominal[present])) if present.any() else 1.0
    if 1.0 / OUT_OF_SCALE < ratio < OUT_OF_SCALE:
        return
    raise InvalidInput(
        f"the links would have {ratio:.3g} times their nominal mass (median); allowed: "
        f"{1.0 / OUT_OF_SCALE:g} to {OUT_OF_SCALE:g}: the efforts are not in N m, but for example "
        "in amperes or per mille of a rated torque; give the torque per unit of each joint, or "
        f"let scales be identified (effort scale){_odd_scales(names, scales)}"
    )
