# SPDX-License-Identifier: Apache-2.0
"""The identified scene: inertias written into the URDF, friction into the joints."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from arm_dynamics import ArmModel, InvalidInput, SceneError
from arm_dynamics.actuation.joint_laws import friction_laws
from arm_dynamics.arrays import Array
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.model.friction.joint_friction import STEEPEST
from arm_dynamics.model.friction.table import steepest
from arm_dynamics.scene.inertia import six_of
from arm_dynamics.scene.schema import Scene, validated
from arm_dynamics.scene.urdf.inertial import set_inertial
from arm_dynamics.scene.urdf.xml import xml_root
from arm_studies.identification.regression import friction as terms
from arm_studies.identification.regression.regressor import MASSLESS_BELOW, PER_BODY

# Keys of a joint's friction whose values are identified; the others stay as they are.
SCENE_KEYS = ("viscous", "coulomb", "static", "stribeck_velocity", "load", "table")
# Smallest static friction relative to Coulomb friction: a joint has to be able to rest.
LEAST_STATIC = 1e-3
# Growth of friction with load over the allowed one where it is limited, for rounding.
BELOW_LIMIT = 0.999


def urdf_with(model: ArmModel, theta: Array) -> str:
    """The URDF with other inertias.

    Links that are fixed to the link of a joint, or that a locked joint holds, belong to its body:
    that link gets the inertia of all of them, the others get none.

    Args:
        model: The arm.
        theta: Ten inertial parameters of each moving body in its joint's frame, shape
            (10 bodies,).
    """
    root = xml_root(model.scene.description)
    links = {link.get("name"): link for link in root.findall("link")}
    ends: dict[str | None, tuple[str | None, str | None]] = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        assert parent is not None and child is not None  # as checked when the scene was loaded
        ends[joint.get("name")] = parent.get("link"), child.get("link")
    moving = list(model.pin.names)[1:]
    for name, numbers in zip(moving, theta.reshape(-1, PER_BODY), strict=True):
        if numbers[0] <= MASSLESS_BELOW:
            continue
        body = [ends[name][1]]  # and what moves rigidly with it
        for link in body:
            body += [b for joint, (a, b) in ends.items() if a == link and joint not in moving]
        for link in body[1:]:
            for inertial in links[link].findall("inertial"):
                links[link].remove(inertial)
        mass, com, central = central_inertia(numbers)
        set_inertial(links[body[0]], mass, com, six_of(central))
    return ElementTree.tostring(root, encoding="unicode")


def central_inertia(numbers: Array) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it, from ten inertial parameters."""
    mass = float(numbers[0])
    com = numbers[1:4] / mass
    about_origin = numbers[4:][[[0, 1, 3], [1, 2, 4], [3, 4, 5]]]
    return mass, com, about_origin - mass * (com @ com * np.eye(3) - np.outer(com, com))


def scene_with(
    model: ArmModel, theta: Array, armature: Array, friction: Sequence[terms.JointFit | None],
    notes: list[str],
) -> Scene:  # fmt: skip
    """The nominal scene with the identified parameters.

    Args:
        model: Of the nominal scene.
        theta: Ten inertial parameters of each moving body, without payloads.
        armature: Of each joint in [kg m²] or [kg], nan to leave it unchanged, shape (n,).
        friction: Of each joint; None to leave it unchanged.
        notes: Receives a line for each result that a scene cannot express.

    Raises:
        InvalidInput: If the friction contradicts a law with states that a joint has.
    """
    scene = model.scene
    content = scene.model_dump(exclude_unset=True, mode="json")
    content["robot"]["urdf"] = urdf_with(model, theta)
    content.pop("links", None)  # which are identified, too
    every = content.setdefault("joints", {}).pop("*", None)
    if every is not None:
        kept = {key: value for key, value in every.items() if key not in ("friction", "armature")}
        content["joints"] |= {"*": kept} if kept else {}
    for j, name in enumerate(model.joint_names):
        content["joints"][name] = _joint(model, j, float(armature[j]), friction[j], notes)
    for name in list(model.pin.names)[1:]:
        if name not in model.joint_names:  # a mimic joint: its leader has all of it
            plain = {"friction": {"viscous": 0.0, "coulomb": 0.0}, "armature": 0.0}
            content["joints"][name] = {**content["joints"].get(name, {}), **plain}
    written = validated(content)
    try:
        friction_laws(ArmModel(written))
    except SceneError as error:
        raise InvalidInput(
            f"the identified friction contradicts a law of the nominal scene: {error}; change "
            "the law, or remove it and identify it by tests of the joint"
        ) from None
    return written


def _joint(
    model: ArmModel, j: int, armature: float, fit: terms.JointFit | None, notes: list[str]
) -> dict[str, Any]:
    """A joint's entry of the scene with what was identified of it."""
    name = model.joint_names[j]
    entry = model.scene.joint(name).model_dump(exclude_unset=True, exclude_none=True, mode="json")
    if fit is not None:
        before = entry.get("friction", {})
        kept = {key: value for key, value in before.items() if key not in SCENE_KEYS}
        entry["friction"] = kept | _friction(name, model, j, fit, notes)
        if "table" in before:
            notes.append(f"'{name}': its table of friction is replaced by coefficients")
    if np.isfinite(armature):
        drive = model.drives[j]
        entry["armature"] = max(armature - (drive.armature if drive else 0.0), 0.0)
    gear = entry.get("actuator", {})
    if fit is not None and gear.get("efficiency", 1.0) != 1.0:
        entry["actuator"] = {**gear, "efficiency": 1.0}
        notes.append(f"'{name}': the identified friction includes the losses of the gear")
    return entry


def _friction(
    name: str, model: ArmModel, j: int, fit: terms.JointFit, notes: list[str]
) -> dict[str, Any]:
    """A joint's identified friction by the keys of a scene, which are among ``SCENE_KEYS``."""
    viscous, coulomb, offset, viscous_skew, excess = (
        fit.coefficients.get(kind, 0.0) if kind in fit.kinds else 0.0 for kind in terms.LINEAR
    )
    drive = model.drives[j]
    viscous = max(viscous - (drive.viscous if drive else 0.0), 0.0)
    if abs(offset) > coulomb:
        notes.append(
            f"'{name}': a constant torque of {offset:.3g} exceeds its Coulomb friction of "
            f"{coulomb:.3g} (an offset of the sensor, or gravity?); the scene limits it to that"
        )
        offset = float(np.clip(offset, -coulomb, coulomb))
    highest = coulomb + abs(offset)
    friction: dict[str, Any] = {
        "viscous": _sides(viscous, float(np.clip(viscous_skew, -viscous, viscous))),
        "coulomb": _sides(coulomb, offset),
    }
    law = model.scene.joint(name).friction.stateful
    if excess < 0.0 and law is not None:
        notes.append(
            f"'{name}': dry friction rises with speed, from {coulomb + excess:.3g} to "
            f"{coulomb:.3g}, which a scene cannot express together with '{law}'"
        )
    elif terms.EXCESS in fit.kinds and fit.shape.stribeck_velocity is not None:
        level = max(coulomb + excess, LEAST_STATIC * coulomb)
        most = level if excess > 0.0 else (1.0 - LEAST_STATIC) * level
        skew = float(np.clip(offset, -most, most))
        highest = max(highest, level + abs(skew))
        friction["static"] = _sides(level, skew)
        friction["stribeck_velocity"] = fit.shape.stribeck_velocity
    if fit.shape.load is not None and coulomb > 0.0:
        friction["load"] = _growth(name, fit.shape, highest, notes)
    elif fit.steepness and fit.shape.load is None:
        notes.append(
            f"'{name}': friction seems to grow by up to {fit.steepness:.3g} of the load that "
            f"causes it; at most {terms.LARGEST_GROWTH} is identified, so its growth is left out"
        )
    return friction


def _growth(
    name: str, shape: terms.Shape, highest: float, notes: list[str]
) -> dict[str, list[float]]:
    """The table of friction over load, where the highest friction grows no faster than allowed."""
    steep = highest * steepest(Curve.through(*shape.table))
    if steep > STEEPEST:
        notes.append(
            f"'{name}': friction grows by up to {steep:.3g} of the load that causes it; the "
            f"scene limits that to {STEEPEST}"
        )
        shape = replace(shape, load=(shape.load or 0.0) * BELOW_LIMIT * STEEPEST / steep)
    at, factor = shape.table
    return {"at": at.tolist(), "factor": factor.tolist()}


def _sides(mean: float, skew: float) -> float | dict[str, float]:
    if skew == 0.0:
        return mean
    return {"positive": max(mean + skew, 0.0), "negative": max(mean - skew, 0.0)}
