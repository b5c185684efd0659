# SPDX-License-Identifier: Apache-2.0
"""Files of an identification: scene, URDF, report and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from arm_dynamics import Scene, load_scene
from arm_dynamics.scene.text import scene_text
from arm_dynamics.writing import replacing
from arm_studies.identification.figures import draw_friction, draw_torques
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
    lines += [
        f"Torque error on held-out data: **{share(result.error[0], 2)}**, of the nominal scene "
        f"{share(result.error[1], 2)}. "
        f"Zero-phase low-pass filter: {result.band:.3g} Hz. Condition number of the motion: "
        f"{result.condition:.3g}.", "",
    ]  # fmt: skip
    if result.effort_band is not None:
        lines += [f"Predictions are low-pass filtered at {result.effort_band:.3g} Hz.", ""]
    columns = ["joint", "nominal error", "error", "residual rms [N m, N]", "friction"]
    lines += _table(columns, joint_rows(result, 2))
    if not np.allclose(result.scales, 1.0):
        pairs = zip(result.joint_names, result.scales, strict=True)
        lines += ["Torque per unit of effort: " + ", ".join(f"{n} {s:.4g}" for n, s in pairs), ""]
    lines += [f"![Torques]({figures[0].name})", "", f"![Friction]({figures[1].name})", ""]
    lines += [*_IDENTIFIED, *(_SCATTER if result.scatter else [])]
    rows = []
    for name, value in result.parameters.items():
        if name not in result.missing:
            low, high = result.intervals[name]
            interval = f"{low:.4g} to {high:.4g}{' (scatter)' if name in result.scatter else ''}"
            nominal = f"{result.nominal[name]:.5g}" if name in result.nominal else ""
            written = f"{result.written[name]:.5g}"
            rows.append([_spoken(name), f"{value:.5g}", interval, written, nominal])
    lines += _table(["parameter", "value", "interval", "scene", "nominal"], rows)
    rows = [[_spoken(name), why] for name, why in result.missing.items()]
    lines += ["## Not identified", "", *_table(["parameter", "reason"], rows)]
    where = "Near the nominal values where the motion does not determine them."
    rows = [
        [name, f"{body[0]:.4g}", ", ".join(f"{x:.4g}" for x in body[1:4] / max(body[0], 1e-12))]
        for name, body in zip(result.body_names, result.bodies, strict=True)
    ]
    lines += ["## Bodies", "", where, ""]
    lines += _table(["moved by", "mass [kg]", "centre of mass [m]"], rows)
    if result.notes:
        lines += ["## Notes", "", *[f"- {note}" for note in result.notes], ""]
    return "\n".join(lines)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [columns, ["---"] * len(columns), *rows]
    return [*("| " + " | ".join(line) + " |" for line in lines), ""]


def _spoken(name: str) -> str:
    joint, _, kind = name.rpartition(".")
    return f"{joint}: {_KINDS[kind]}" if kind in _KINDS else name


def share(error: float, digits: int) -> str:
    """A relative error on held-out data in per cent."""
    return "unknown" if math.isnan(error) else f"{error:.{digits}%}"


def joint_rows(result: Identification, digits: int) -> list[list[str]]:
    """Of each joint: name, nominal error and error, residual in [N m] or [N], friction."""
    return [
        [name, share(result.nominal_error[name], digits), share(result.torque_error[name], digits),
         "unknown" if math.isnan(left) else f"{left:.3g}", friction_words(result, j)]
        for j, (name, left) in enumerate(result.torque_residual.items())
    ]  # fmt: skip


def friction_words(result: Identification, j: int) -> str:
    """The friction of a joint in a few words."""
    fit = result.friction[j]
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
