# SPDX-License-Identifier: Apache-2.0
"""Recordings that nothing can be learnt from: what is missing, in a word, before a scene lies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.identification.data import JointRecord, MeasuredMotion
from arm_dynamics.identification.regression.rows import Rows
from arm_dynamics.model.arm import ArmModel

BEYOND = 0.2
"""How far in [rad] or [m] positions may be beyond the limits of the description."""
MOVED = 1e-3
"""Range in [rad] or [m] in which a joint has not moved."""
UNEXPLAINED = 0.6
"""Part of the torques that a fit leaves at most: beyond it is no model of this robot."""
OUT_OF_SCALE = 5.0
"""Times by which the masses found may differ from the nominal ones, in the median."""
SLOWEST = 0.2
"""Time between samples in [s] beyond which nothing of a motion is told."""
LEAST_ROWS = 50
"""Independent rows in which a joint has to have been measured."""


def check_model(model: ArmModel) -> None:
    """Refuse scenes whose torques are no function of the joints' motion.

    Raises:
        InvalidInput: Naming what it is.
    """
    if model.scene.bilateral:
        raise InvalidInput(
            "the scene has closed loops: forces within them are not measured, so that torques "
            "alone do not tell the bodies; take the constraints out and lock what they drive"
        )
    for name, drive in zip(model.joint_names, model.drives, strict=True):
        if drive is not None and drive.coupling is not None:
            raise InvalidInput(
                f"joint '{name}' has a flexible transmission: the motion of its link does not "
                "tell that of its rotor; take the 'transmission' out, and find it by tests of "
                "the drive"
            )
        if model.scene.joint(name).friction.position is not None:
            raise InvalidInput(
                f"joint '{name}' has friction by position, which is not identified; take "
                "'friction.position' out of the scene"
            )


def check_record(record: JointRecord, model: ArmModel) -> None:
    """Refuse recordings without efforts, or in other units.

    Raises:
        InvalidInput: Naming the joint, the value and what is expected.
    """
    step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else 0.0
    if step > SLOWEST:
        raise InvalidInput(
            f"{record.name}: samples are {step:.3g} s apart, at most {SLOWEST} s is expected: are "
            "the times in milliseconds or nanoseconds?"
        )
    for j, name in enumerate(record.joint_names):
        effort, q = record.effort[:, j], record.q[:, j]
        known = effort[np.isfinite(effort)]
        if not known.size:
            raise InvalidInput(
                f"{record.name}: there is no effort of joint '{name}': without torques there is "
                "nothing to learn masses and friction from"
            )
        if np.ptp(known) == 0.0:
            raise InvalidInput(
                f"{record.name}: the effort of joint '{name}' is {known[0]:g} all the time: it is "
                "not measured, or the drive is off"
            )
        reach = q[np.isfinite(q)]
        lower, upper = model.position_lower[j], model.position_upper[j]
        if reach.size and (reach.min() < lower - BEYOND or reach.max() > upper + BEYOND):
            raise InvalidInput(
                f"{record.name}: positions of joint '{name}' go from {reach.min():.4g} to "
                f"{reach.max():.4g}, its limits from {lower:.4g} to {upper:.4g}: is it another "
                "robot, or are they in degrees?"
            )


def moved(motions: Sequence[MeasuredMotion]) -> Array:
    """Range of each joint's position in [rad] or [m], shape (n,).

    Raises:
        InvalidInput: If no joint moves.
    """
    ranges = np.max([np.ptp(motion.q, axis=0) for motion in motions], axis=0)
    if (ranges < MOVED).all():
        raise InvalidInput(
            f"nothing moves: the largest range of a joint is {ranges.max():.3g} rad or m; a "
            "motion of all joints is expected, fast and slow, over much of their ranges"
        )
    return np.asarray(ranges)


def check_rows(rows: Rows, names: Sequence[str]) -> None:
    """Refuse what is too short, or saturated most of the time.

    Raises:
        InvalidInput: Naming the joint.
    """
    counts = rows.valid[rows.train].sum(axis=0) * rows.independent
    for name, count, share in zip(names, counts, rows.valid.mean(axis=0), strict=True):
        if count < LEAST_ROWS:
            raise InvalidInput(
                f"joint '{name}': only {share:.0%} of the rows can be used, worth {count:.0f} "
                f"independent measurements; at least {LEAST_ROWS} are expected: its effort is "
                "saturated or missing, or the recording is too short"
            )


def check_explained(error: float, nominal: float, names: Sequence[str], scales: Array) -> None:
    """Refuse a fit that predicts next to nothing of what it was not fitted to.

    Args:
        error: What is left of the torques held out, relative.
        nominal: What the nominal scene leaves of them.
        names: Joints.
        scales: Of each joint: efforts over the torques of the nominal scene, 1 where unknown.

    Raises:
        InvalidInput: With what may be the cause.
    """
    if error < UNEXPLAINED:
        return
    odd = [f"{n} {s:.3g}" for n, s in zip(names, scales, strict=True) if not 0.2 < s < 5.0]
    hint = f"; efforts over nominal torques: {known_names(odd)}" if odd else ""
    raise InvalidInput(
        f"the best fit leaves {error:.0%} of the torques held out unexplained (the nominal scene "
        f"{nominal:.0%}), at most {UNEXPLAINED:.0%} is allowed: another robot, joints under wrong "
        f"names, efforts that are no torques, or contact{hint}"
    )


def check_masses(found: Array, nominal: Array, scaled: bool) -> None:
    """Refuse bodies many times heavier or lighter than the nominal ones.

    Args:
        found: Masses in [kg], shape (bodies,).
        nominal: Those of the nominal scene.
        scaled: Whether scales of efforts were found, so that their unit is none.

    Raises:
        InvalidInput: With what may be the cause.
    """
    there = nominal > 0.0
    ratio = float(np.median(found[there] / nominal[there])) if there.any() else 1.0
    if scaled or 1.0 / OUT_OF_SCALE < ratio < OUT_OF_SCALE:
        return
    raise InvalidInput(
        f"the links would have {ratio:.3g} times their nominal mass (in the median), where "
        f"{1.0 / OUT_OF_SCALE:g} to {OUT_OF_SCALE:g} is allowed: efforts are in another unit than "
        "N m, such as amperes or per mille of a rated torque; give the torque per unit of each "
        "joint, or let scales be found (effort scale)"
    )
