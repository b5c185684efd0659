# SPDX-License-Identifier: Apache-2.0
"""Draws docs/figures/architecture.svg: the layers as pyproject.toml enforces them.

``./arm python tools/draw_architecture.py``; ``test/docs`` checks that it is up to date.
"""

import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).parents[1]
FIGURE = ROOT / "docs/figures/architecture.svg"
WIDTH, LEFT, BETWEEN, ROW, GAP, TIGHT = 720, 4, 32, 38, 7, 2  # at which text has 8 points
COLUMN = (WIDTH - 2 * LEFT - BETWEEN) // 2

ROS, CORE, GROUND = "#f8e2b3", "#d1e6f2", "#eaeaea"  # tints of arm_sim.figures.COLORS
SAYS = {
    "arm_studies": {
        "cli": "./arm identify, excite, compare, sweep …; the whole command line",
        "autodiff": "for JAX and PyTorch",
        "identification": "scenes from motions",
        "optimization": "iLQR",
        "sweeps": "many closed loops, one table",
    },
    "arm_sim": {
        "cli": "./arm describe, build, call, demo, sim …",
        "ros": "the sim node",
        "replay": "runs a recording again",
        "export": "a scene as a C library",
        "simulation": "step, run, rollout, linearize; closed loop",
        "recording": "states, energy balance",
        "derivatives": "also across events",
        "stepping": "smooth motion and events (engine in C)",
        "integrators": "methods, and their choice",
        "servo": "positions as commands",
        "plant": "x' = f(x, u, p) of a scene; states it allows",
        "view": "arms in the browser",
        "inputs": "checks", "state": "(q, v, z)",
        "external_wrench": "pushes",
        "case_modes": "of drives", "coefficients": "between functions",
        "imperfections": "sensors, lines",
        "exceptions": "SimulationDiverged",
        "figures": "one style",
        "memory": "refuses what does not fit", "progress": "of what takes long",
    },
    "arm_dynamics": {
        "terms": "the table of terms",
        "client": "services of running nodes as functions",
        "ros": "dynamics and controller nodes, common parts",
        "control": "torque(state, reference)",
        "trajectory": "references, timing, Cartesian goals",
        "task_space": "dynamics at a frame, inverse kinematics",
        "dynamics": "numbers: points, batches, constraints",
        "actuation": "drives, friction with states",
        "model": "an arm as numbers, by Pinocchio",
        "equations": "the equations as expressions",
        "scene": "keys, checks, URDF",
        "codegen": "C, compiler, cache",
        "arrays": "vectors and their checks",
        "attributes": "what objects have",
        "writing": "safe files",
        "cdr": "messages as bytes",
        "exceptions": "ArmError and its kinds", "lazy": "imports at first use",
        "logs": "log messages", "starting": "Ctrl-C during imports",
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


def row(names: dict[str, tuple[str, str]], x: float, y: float, width: float) -> list[str]:
    """Boxes side by side, with what they say and their colours, by name."""
    wide, drawn = (width - TIGHT * (len(names) - 1)) / len(names), []
    for i, (name, (about, fill)) in enumerate(names.items()):
        left = x + i * (wide + TIGHT)
        drawn += [
            f'<rect x="{left:g}" y="{y:g}" width="{wide:g}" height="{ROW}" fill="{fill}"/>',
            text(left + wide / 2, y + 16, name, 13, 'font-weight="bold"'),
            text(left + wide / 2, y + 31, about, 11),
        ]
    return drawn


def stack(package: str, about: str, x: float, y: float, width: float, most: int = 2) -> list[str]:
    """The layers of a package from y down, below its title; each imports from those below it.

    Boxes of a layer do not know each other; beyond ``most`` of them they have further rows.
    """
    title = f"{package}: {about}"
    drawn = [text(x, y, title, 14, 'font-weight="bold" text-anchor="start"')]
    y += 10 - GAP
    for names in layers(package):
        y += GAP - TIGHT
        for first in range(0, len(names), most):
            some = names[first : first + most]
            fills = {n: (SAYS[package][n], ROS if n in KNOWS_ROS else CORE) for n in some}
            drawn, y = drawn + row(fills, x, y + TIGHT, width), y + TIGHT + ROW
    return drawn


def drawing() -> str:
    """The figure."""
    right, wide = LEFT + COLUMN + BETWEEN, WIDTH - 2 * LEFT
    parts = stack("arm_studies", "what is done with both", LEFT, 16, wide, 4)
    parts += stack("arm_sim", "simulates the arm", LEFT, 140, COLUMN)
    parts += stack("arm_dynamics", "computes the equations", right, 140, COLUMN)
    bottom = max(float(part.split('"')[3]) for part in parts if part[1] == "r") + ROW
    parts.append(
        f'<path d="M {LEFT + COLUMN + 5} {(150 + bottom) / 2:g} h {BETWEEN - 10} m -8 -8 l 8 8 '
        'l -8 8" stroke="#333" stroke-width="2" fill="none"/>'
    )
    ground = {
        "arm_msgs": ("messages, services", ROS),
        "rclpy": ("nodes only", ROS),
        "CasADi": ("expressions, C", GROUND),
        "Pinocchio": ("parsing, reference", GROUND),
        "NumPy, pydantic": ("arrays, schema", GROUND),
    }
    parts += row(ground, LEFT, bottom + 2 * GAP, wide)
    height = bottom + 2 * GAP + ROW + 26
    legend = "A box may import what is below it or where the arrow points, not what touches it. "
    legend += "Orange: knows ROS. Grey: other projects."
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" '
        'font-family="DejaVu Sans, sans-serif" text-anchor="middle">'
    )
    white = f'<rect width="{WIDTH}" height="{height:g}" fill="white"/>'
    return "\n".join([head, white, *parts, text(WIDTH / 2, height - 8, legend, 11), "</svg>", ""])


if __name__ == "__main__":
    FIGURE.write_text(drawing())
