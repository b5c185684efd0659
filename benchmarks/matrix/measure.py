# SPDX-License-Identifier: Apache-2.0
"""One set of features: what the suite computes against the independent solution."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim import Recording, Simulator
from arm_sim.simulation.runtime_changes import payload_change

ROOT = Path(__file__).parents[2]
sys.path[:0] = [path for path in (str(ROOT / "test"),) if path not in sys.path]

from models import features  # noqa: E402  the scenes are the tests' own
from reference import make_features_together as solutions  # noqa: E402

TOLERANCE = 1e-11  # of error control
POSITION = 1e-7  # [rad] that a position may be off
ACCOUNT = 1e-8  # part of the energy that moved that may be missing
DT = 1e-3  # [s]


def reference() -> dict[str, Any]:
    """The independent solutions: ``time``, and by arm and set what the file has of it."""
    found: dict[str, Any] = json.loads(solutions.FILE.read_text())
    return found


def solved(arm: str, known: dict[str, Any]) -> list[tuple[str, ...]]:
    """The sets of an arm that have a solution, and one of the very scene that they are now."""
    return [
        chosen
        for _, chosen in solutions.jobs([arm])
        if known.get(arm, {}).get(solutions.label(chosen), {}).get("scene")
        == solutions.given(arm, chosen)[2]
    ]


def run(arm: str, chosen: tuple[str, ...]) -> tuple[Simulator, Recording]:
    """A second of a set under its command, under error control."""
    scene = features.scene(arm, chosen)
    sim = Simulator(scene, dt=DT, integrator="dop853", tolerance=TOLERANCE)
    if "payload" in chosen:
        load = features.LOAD
        payload_change(sim, 0, load["mass"], load["com"], load["inertia"])()
    command = features.command(arm, scene)
    return sim, sim.run(1.0, [command.get(name, 0.0) for name in sim.joint_names])


def measured(arm: str, chosen: tuple[str, ...], known: dict[str, Any]) -> dict[str, Any]:
    """How far a run is from what is known of it.

    Args:
        arm: A key of ``features.ARMS``.
        chosen: The features.
        known: ``reference()``.

    Returns:
        Largest error of a position in [rad], the part of the energy that is missing in the
        account, how much energy moved in [J], what happened, and which scene it was.
    """
    motion = known[arm][solutions.label(chosen)]
    sim, recording = run(arm, chosen)
    ticks = np.rint(np.array(known["time"]) / DT).astype(int)
    moved = max(np.ptp(recording.kinetic), np.ptp(recording.potential), recording.lost[-1])
    return {
        "position": float(abs(recording.q[ticks] - np.array(motion["q"])).max()),
        "account": float(abs(recording.balance).max() / moved),
        "moved": float(moved),
        "events": motion["events"],
        "scene": motion["scene"],
    }


def effect(arm: str, chosen: tuple[str, ...], known: dict[str, Any]) -> dict[str, float]:
    """How much each feature of a pair matters: what it changes in positions, in [rad]."""
    q = np.array(known[arm][solutions.label(chosen)]["q"])
    without = {f: tuple(other for other in chosen if other != f) for f in chosen}
    return {
        f: float(abs(q - np.array(known[arm][solutions.label(rest)]["q"])).max())
        for f, rest in without.items()
        if solutions.label(rest) in known[arm]
    }
