# SPDX-License-Identifier: Apache-2.0
"""Scenes with closed chains for tests."""

from typing import Any

import numpy as np

import models
from arm_dynamics import load_scene
from arm_sim import Recording, Simulator

TIP = {"frames": ["tip", "world"]}


def scene(name: str, **more: Any) -> Any:
    return load_scene(
        load_scene(models.SCENES / f"{name}.yaml").model_dump(exclude_unset=True) | more
    )


def inline(links: str, *constraints: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"robot": {"urdf": f'<robot name="r"><link name="ground"/>{links}</robot>'},
            "constraints": list(constraints), **more}  # fmt: skip


def body(name: str, parent: str, kind: str, axis: str, mass: float, inertia: float) -> str:
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{inertia}" ixy="0" '
        f'ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>'
        f'<joint name="{name}_joint" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
        f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="0" velocity="0"/></joint>'
    )


def interpreted(given: Any, **options: Any) -> Simulator:
    """Without compiler: short motions are over before a compiler is."""
    return Simulator(given, backend="vm", **options)


def worst_gaps(sim: Simulator, run: Recording, every: int) -> tuple[float, float]:
    """Largest residual of positions and speeds along a motion."""
    rows = sim.dynamics.constrained.closure.rows
    gaps = np.zeros(2)
    for q, v in zip(run.q[::every], run.v[::every], strict=True):
        row = rows.stacked(q, v, sim.held_constraints)
        speed = abs(row.jacobian @ v).max()
        gaps = np.maximum(gaps, [abs(row.residual).max(), speed])
    return float(gaps[0]), float(gaps[1])
