# SPDX-License-Identifier: Apache-2.0
"""Write linkages_with_friction.json: closed chains with dry friction in their one coordinate.

See one_coordinate.py. A four-bar with Coulomb friction in every hinge, thrown, until it rests; a
slider-crank whose slider rubs on its rail, turned by a motor with a current. Run:
PYTHONPATH=.. ../../arm python make_linkages_with_friction.py
"""

import json
from pathlib import Path

import numpy as np
from one_coordinate import FourBar, OneCoordinate, SliderCrank

import models

TIMES = np.arange(0.0, 10.01, 0.5)
HINGES = [0.02, 0.03, 0.04]  # [N m]
VOLTAGE = 12.0


def solved(linkage: OneCoordinate, theta: float, rate: float) -> dict[str, object]:
    """The start of all joints, and the first joint's angle, speed and current at all times."""
    q = linkage.pose(theta)
    start = {"q": q.tolist(), "v": (linkage.motion(q, rate)[0] * rate).tolist()}
    found = linkage.solve(theta, rate, TIMES)
    return {**start, "time": TIMES.tolist(), "theta": found[0].tolist(), "x": found.T.tolist()}


def driven() -> SliderCrank:
    """The slider-crank with the motor and the friction of its scene."""
    scene = models.scene("slider_crank_motor")
    pivot, rail, motor = scene.joint("pivot"), scene.joint("rail"), scene.joint("pivot").actuator
    linkage = SliderCrank(
        models.scene("slider_crank"),
        np.array([0.0, 0.0, rail.friction.coulomb]),
        np.array([pivot.friction.viscous, 0.0, 0.0]),
    )
    linkage.armature = motor.rotor_inertia * motor.gear_ratio**2
    linkage.motor = motor.resistance, motor.inductance, motor.torque_constant * motor.gear_ratio
    linkage.voltage = VOLTAGE
    return linkage


def pin(linkage: SliderCrank, x: list[float]) -> float:
    """What the rod does to the slider along the rail: m a and the friction."""
    q = linkage.pose(x[0])
    N, bent = linkage.motion(q, x[1])
    signs = np.sign(N * x[1])
    a = N[2] * linkage.slope(np.array(x), signs)[1] + bent[2]
    return float(1.0 * a + linkage.coulomb[2] * signs[2])


def main() -> None:
    """Solve both and write them."""
    free = solved(FourBar(models.scene("four_bar"), np.array(HINGES)), 0.5, 25.0)
    linkage = driven()
    turned = solved(linkage, 1.0, 8.0)
    turned["pin"] = [pin(linkage, x) for x in turned["x"]]
    data = {"four_bar": free | {"coulomb": HINGES}, "slider_crank": turned | {"voltage": VOLTAGE}}
    for case in data.values():
        del case["x"]
    file = Path(__file__).with_name("linkages_with_friction.json")
    file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
