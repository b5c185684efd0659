# SPDX-License-Identifier: Apache-2.0
"""Asks what a node knows about its arm and shows it."""

from __future__ import annotations

import numpy as np

from arm_sim.cli.call.asking import asking, print_json
from arm_sim.cli.call.options import DYNAMICS
from arm_sim.cli.output import console, limit, show, table


def model_info(node: str, timeout: float, as_json: bool) -> None:
    """Ask what the node knows about its arm and print it."""
    with asking(node, DYNAMICS.start, timeout, as_json) as client:
        info = client.model_info()
    limits = ("position_lower", "position_upper", "velocity_limits", "effort_limits")
    if as_json:
        print_json(
            joint_names=list(info.joint_names), joint_types=list(info.joint_types),
            **{name: [_or_none(x) for x in getattr(info, name)] for name in limits},
            frame_names=list(info.frame_names), total_mass=info.total_mass,
            gravity=list(map(float, info.gravity)), summary=info.summary,
        )  # fmt: skip
        return
    rows = zip(
        info.joint_names, info.joint_types, *(getattr(info, x) for x in limits), strict=True
    )
    heads = ("joint", "type", "lower", "upper", "speed limit", "effort limit")
    out = console()
    gravity = ", ".join(f"{g:g}" for g in info.gravity)
    out.print(f"\n{info.summary}, gravity ({gravity}) m/s²", markup=False)
    show(out, table(heads, [(name, kind, *map(limit, x)) for name, kind, *x in rows], (0, 1)))
    out.print(f"frames: {', '.join(info.frame_names)}", style="dim", markup=False)


def _or_none(value: float) -> float | None:
    """JSON knows no infinity."""
    return float(value) if np.isfinite(value) else None
