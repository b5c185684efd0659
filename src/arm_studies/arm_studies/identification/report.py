# SPDX-License-Identifier: Apache-2.0
"""Files of an identification: scene, URDF, report and figures."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from arm_dynamics import Scene, load_scene
from arm_dynamics.scene.text import scene_text
from arm_dynamics.writing import replacing
from arm_studies.identification.figures import draw_friction, draw_torques
from arm_studies.identification.regression.friction import JointFit
from arm_studies.identification.result import Identification

_KINDS = {
    "viscous": "viscous", "viscous_skew": "viscous, half the difference by direction",
    "coulomb": "Coulomb",
    "coulomb_skew": "Coulomb, half the difference by direction, or an offset",
    "excess": "static beyond Coulomb", "stribeck_velocity": "Stribeck velocity",
    "load": "fraction of the dry friction that grows with the load",
}  # fmt: skip
_IDENTIFIED = [
    "## Identified parameters", "",
    "In SI units, with 95 % confidence intervals. Values are those of the torques alone; in the "
    "scene, bodies are physically consistent, and near the nominal ones where the torques "
    "determine little.", "",
]  # fmt: skip
_NEAR_NOMINAL = "Near the nominal values where the motion does not determine them."
_SCATTER = [
    "Where an interval is called scatter, errors of the model cause most of its width: it says "
    "how much the value scatters along the recording, and need not contain the truth.", "",
]  # fmt: skip


def write(result: Identification, out: Path, sources: Sequence[str]) -> list[Path]:
    """Write the identified scene with a report and figures.

    Args:
        result: The identification.
        out: The scene file.
        sources: Names of the recordings.

    Returns:
        The files written: the scene, its URDF, the report, and two figures.

    Raises:
        OSError: If one cannot be written.
    """
    report = out.with_suffix(".md")
    torques, friction = (out.with_name(f"{out.stem}_{x}.png") for x in ("torques", "friction"))
    head = f"# Identified from {', '.join(sources)}; intervals and errors: {report.name}.\n"
    scene = write_scene(result.scene, out, head)
    draw_torques(result, torques)
    draw_friction(result, friction)
    report.write_text(text(result, out, sources, (torques, friction)), encoding="utf-8")
    return [*scene, report, torques, friction]


def write_scene(scene: Scene, out: Path, head: str = "") -> list[Path]:
    """Write a scene and, beside it, its URDF; see ``write``."""
    out.parent.mkdir(parents=True, exist_ok=True)
    urdf = out.with_suffix(".urdf")
    for path, content in (
        (urdf, scene.robot.urdf), (out, head + scene_text(scene, urdf.name))
    ):  # fmt: skip
        with replacing(path) as part:
            part.write_text(content, encoding="utf-8")
    load_scene(out)
    return [out, urdf]


def text(
    result: Identification, out: Path, sources: Sequence[str], figures: Sequence[Path]
) -> str:
    """The report, as Markdown."""
    lines = [f"# {out.stem}: identified from {', '.join(sources)}", ""]
    error, nominal_error = (share(each, 2) for each in result.error)
    lines += [
        f"Torque error on held-out data: **{error}**, of the nominal scene {nominal_error}. "
        f"Zero-phase low-pass filter: {result.band:.3g} Hz. Condition number of the motion: "
        f"{result.condition:.3g}.", "",
    ]  # fmt: skip
    if result.effort_band is not None:
        lines += [f"Predictions are low-pass filtered at {result.effort_band:.3g} Hz.", ""]
    columns = ["joint", "nominal error", "error", "residual rms [N m, N]", "friction"]
    lines += _table(columns, joint_rows(result, 2))
    if not np.allclose([joint.scale for joint in result.joints], 1.0):
        scales = ", ".join(f"{joint.name} {joint.scale:.4g}" for joint in result.joints)
        lines += [f"Torque per unit of effort: {scales}", ""]
    lines += [f"![Torques]({figures[0].name})", "", f"![Friction]({figures[1].name})", ""]
    lines += [*_IDENTIFIED, *(_SCATTER if result.scatter else [])]
    rows = []
    for name, parameter in result.details.items():
        estimate = parameter.estimate
        if estimate is not None and not parameter.missing:
            interval = f"{estimate.low:.4g} to {estimate.high:.4g}"
            interval += " (scatter)" if estimate.scatter else ""
            written, nominal = (
                "" if x is None else f"{x:.5g}" for x in (parameter.written, parameter.nominal)
            )
            rows.append([_in_words(name), f"{estimate.value:.5g}", interval, written, nominal])
    lines += _table(["parameter", "value", "interval", "scene", "nominal"], rows)
    rows = [[_in_words(name), reason] for name, reason in result.missing.items()]
    lines += ["## Not identified", "", *_table(["parameter", "reason"], rows)]
    rows = [
        [name, f"{body[0]:.4g}", ", ".join(f"{x:.4g}" for x in body[1:4] / max(body[0], 1e-12))]
        for name, body in zip(result.body_names, result.bodies, strict=True)
    ]
    lines += ["## Bodies", "", _NEAR_NOMINAL, ""]
    lines += _table(["moved by", "mass [kg]", "centre of mass [m]"], rows)
    if result.notes:
        lines += ["## Notes", "", *[f"- {note}" for note in result.notes], ""]
    return "\n".join(lines)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [columns, ["---"] * len(columns), *rows]
    return [*("| " + " | ".join(line) + " |" for line in lines), ""]


def _in_words(name: str) -> str:
    joint, _, kind = name.rpartition(".")
    return f"{joint}: {_KINDS[kind]}" if kind in _KINDS else name


def share(error: float, digits: int) -> str:
    """A relative error on held-out data in per cent."""
    return "unknown" if math.isnan(error) else f"{error:.{digits}%}"


def joint_rows(result: Identification, digits: int) -> list[list[str]]:
    """Of each joint: name, nominal error and error, residual in [N m] or [N], friction."""
    return [
        [joint.name, share(joint.errors.nominal, digits), share(joint.errors.identified, digits),
         "unknown" if math.isnan(joint.residual) else f"{joint.residual:.3g}",
         friction_words(joint.friction)]
        for joint in result.joints
    ]  # fmt: skip


def friction_words(fit: JointFit | None) -> str:
    """The friction of a joint in a few words."""
    if fit is None:
        return "unchanged: the joint did not move"
    if not fit.kinds:
        return "none that opposes the motion was found"
    words = [f"{kind} {fit.coefficients[kind]:.3g}" for kind in fit.kinds]
    if fit.shape.stribeck_velocity is not None:
        words.append(f"stribeck_velocity {fit.shape.stribeck_velocity:.2g}")
    if fit.shape.load is not None:
        words.append(f"load {fit.shape.load:.0%}")
    return ", ".join(words)
