# SPDX-License-Identifier: Apache-2.0
"""Tables of the parameters of the nodes, from the dataclasses that declare them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from arm_dynamics.ros.common.params import listed

TYPES = {bool: "bool", int: "int", float: "double", str: "string"}


def kinds() -> dict[str, type]:
    """The dataclass of each node's parameters."""
    from arm_dynamics.ros.controller.controller_params import ControllerParams
    from arm_dynamics.ros.dynamics_node.node import DynamicsParams
    from arm_sim.ros.sim_params import SimParams

    return {"dynamics": DynamicsParams, "sim": SimParams, "controller": ControllerParams}


def markdown(node: str) -> str:
    """The parameters of a node as a Markdown table."""
    rows = [
        "| parameter | type | default | may change | meaning |",
        "|---|---|---|---|---|",
    ]
    for name, default, about in listed(kinds()[node]):
        changes = "no" if about.get("read_only") else "yes"
        words = about["description"].replace("|", "\\|").replace("<", "\\<")
        rows.append(
            f"| `{name}` | {_type(default, about)} | {_shown(default)} | {changes} | "
            f"{words}{_allowed(about)} |"
        )
    return "\n".join(rows)


def _type(default: Any, about: Mapping[str, Any]) -> str:
    if about.get("each_joint"):
        return f"{TYPES[type(default)]}[]"
    if isinstance(default, list | tuple):
        return f"{TYPES[type(default[0])] if default else 'string'}[]"
    return TYPES[type(default)]


def _shown(default: Any) -> str:
    if default in ("", [], ()):
        return ""
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    if isinstance(default, float):
        return f"`{default:g}`"
    if isinstance(default, list | tuple):
        return f"`[{', '.join(map(str, default))}]`"
    return f"`{default}`"


def _allowed(about: Mapping[str, Any]) -> str:
    if about.get("choices"):
        return "; one of " + ", ".join(f"`{word}`" for word in about["choices"])
    if "low" in about:
        return f"; {about['low']:g} to {about['high']:g}"
    return ""
