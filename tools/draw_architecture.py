# SPDX-License-Identifier: Apache-2.0
"""Draws docs/figures/architecture.svg: the layers as pyproject.toml enforces them.

``./arm python tools/draw_architecture.py``; ``test/docs`` checks that it is up to date.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
FIGURE = ROOT / "docs/figures/architecture.svg"
WIDTH, LEFT, BETWEEN, ROW, GAP = 1000, 16, 48, 40, 6
COLUMN = (WIDTH - 2 * LEFT - BETWEEN) // 2

ROS, CORE, GROUND = "#fde8c8", "#dce9f9", "#e7e7e7"
SAYS = {
    "arm_studies": {
        "cli": "./arm identify, excite, compare, sweep …; the whole command line",
        "autodiff": "for JAX and PyTorch",
        "identification": "a scene from measured motions",
        "optimization": "iLQR",
        "sweeps": "many closed loops, one table",
    },
    "arm_sim": {
        "cli": "./arm describe, build, call, demo, sim …",
        "ros": "the sim node",
        "replay": "runs a recording again",
        "export": "a scene as a C library",
        "simulation": "step, run, rollout, linearize: for users; arm, plan, closed loop",
        "recording": "states; energy account",
        "derivatives": "of ticks, across events",
        "stepping": "ticks: smooth motion, events (the engine in C)",
        "integrators": "steps, which method to take",
        "servo": "positions as commands",
        "plant": "x' = f(x, u, p) of a scene; states it allows",
        "view": "arms in the browser",
        "inputs": "checks",
        "state": "(q, v, z)",
        "external_wrench": "pushes",
        "imperfections": "sensors, lines",
        "exceptions": "SimulationDiverged",
        "figures": "that look alike",
        "long_runs": "Ctrl-C, memory",
    },
    "arm_dynamics": {
        "terms": "the table of terms, what follows from it",
        "client": "services of running nodes as functions",
        "ros": "dynamics and controller nodes; what all nodes share",
        "control": "torque(state, reference); wrappers; by name",
        "trajectory": "references, timing, Cartesian goals",
        "task_space": "the dynamics at a frame, inverse kinematics",
        "dynamics": "numbers: single points, batches, constraints",
        "actuation": "drives, friction with states",
        "model": "an arm as numbers, by Pinocchio",
        "equations": "the equations as expressions, one file a subject",
        "scene": "keys, checks, URDF",
        "codegen": "C, compiler, cache",
        "arrays": "vectors and their checks",
        "attributes": "what may be set of an object",
        "writing": "files that replace others",
        "cdr": "messages as bytes",
        "exceptions": "ArmError and its kinds", "lazy": "imports at first use",
        "logs": "who hears them", "starting": "Ctrl-C during imports",
    },
}  # fmt: skip
KNOWS_ROS = {"cli", "ros", "client"}


def layers(package: str) -> list[list[str]]:
    """The layers of a package from the top, as its contract in pyproject.toml names them."""
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    contracts = tools["importlinter"]["contracts"]
    (mine,) = (c for c in contracts if c.get("containers") == [package])
    return [layer.split(" | ") for layer in mine["layers"]]


def text(x: float, y: float, words: str, size: int, style: str = "") -> str:
    """A line of text in the middle of x."""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" {style}>{escape(words)}</text>'


def box(x: float, y: float, width: float, height: float, fill: str) -> str:
    """A box with round corners."""
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="5" fill="{fill}" '
        'stroke="#667"/>'
    )


def stack(package: str, x: float, y: float, row: float, width: float = COLUMN) -> list[str]:
    """The layers of a package; each imports from those below it."""
    drawn = []
    for k, names in enumerate(layers(package)):
        wide = (width - GAP * (len(names) - 1)) / len(names)
        for i, name in enumerate(names):
            left, top = x + i * (wide + GAP), y + k * (row + GAP)
            fill = ROS if name in KNOWS_ROS else CORE
            middle, about = left + wide / 2, SAYS[package][name]
            drawn += [
                box(left, top, wide, row, fill),
                text(middle, top + row / 2 - 3, name, 14, 'font-weight="bold"'),
                text(middle, top + row / 2 + 13, about, 12),
            ]
    return drawn


def drawing() -> str:
    """The figure."""
    studies, right = 50, LEFT + COLUMN + BETWEEN
    top = studies + len(layers("arm_studies")) * (ROW + GAP) + 40
    bottom = top + (ROW + GAP) * max(len(layers(name)) for name in ("arm_sim", "arm_dynamics"))
    height = bottom + 2 * ROW + GAP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        'font-family="sans-serif" text-anchor="middle">',
        f'<rect width="{WIDTH}" height="{height}" fill="white"/>',
        text(WIDTH / 2, 32, "arm_studies: what is done with both", 16, 'font-weight="bold"'),
        *stack("arm_studies", LEFT, studies, ROW, WIDTH - 2 * LEFT),
    ]
    titles = ("arm_sim", "simulates the arm"), ("arm_dynamics", "computes the equations of motion")
    for x, (package, about) in zip((LEFT, right), titles, strict=True):
        high = (bottom - top) / len(layers(package)) - GAP
        title = f"{package}: {about}"
        parts.append(text(x + COLUMN / 2, top - 18, title, 16, 'font-weight="bold"'))
        parts += stack(package, x, top, high)
    middle, half = (top + bottom) / 2, LEFT / 2
    parts.append(
        f'<path d="M {LEFT + COLUMN + 6} {middle:g} h {BETWEEN - 12} m -9 -9 l 9 9 l -9 9" '
        'stroke="#333" stroke-width="3" fill="none"/>'
    )
    ground = (
        ("arm_msgs", "messages, services", ROS),
        ("rclpy", "nodes only", ROS),
        ("CasADi", "expressions, derivatives, C", GROUND),
        ("Pinocchio", "parsing, reference", GROUND),
        ("NumPy, pydantic", "arrays; schema of scenes", GROUND),
    )
    wide = (WIDTH - 2 * LEFT - GAP * (len(ground) - 1)) / len(ground)
    for i, (name, about, fill) in enumerate(ground):
        left, y = LEFT + i * (wide + GAP), bottom + half
        parts += [
            box(left, y, wide, ROW, fill),
            text(left + wide / 2, y + 17, name, 14, 'font-weight="bold"'),
            text(left + wide / 2, y + 33, about, 12),
        ]
    legend = "A box may import what stands below it, and arm_sim what stands in arm_dynamics. "
    parts.append(text(WIDTH / 2, height - half - 8, legend + "Orange: knows ROS.", 13))
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    FIGURE.write_text(drawing())
