# SPDX-License-Identifier: Apache-2.0
"""Code of a scene is compared with Pinocchio before it is used, whatever acts on the joints."""

from typing import Any

import casadi as ca
import pytest

import models
from arm_dynamics import ArmModel, KernelError, load_scene
from arm_sim.integrators.selection import choose
from arm_sim.plant.plant import Plant
from arm_sim.stepping.stepper import Stepper
from models.touching import contact

BRISTLES = {"viscous": 0.2, "coulomb": 0.3, "lugre": {"sigma0": 1e4, "sigma1": 20.0}}
DRY = {"viscous": 0.2, "coulomb": 0.3}
BY_LOAD = {"coulomb": 0.3, "load": {"at": [0.0, 5.0], "factor": [1.0, 1.4]}}
MOTOR = {
    "command": "voltage",
    "resistance": 0.8,
    "inductance": 1e-3,
    "torque_constant": 0.05,
    "gear_ratio": 50,
}
BELOW = contact("coupler", plane={"point": [0.0, 0.0, -5.0]})
TWO_LINK = {"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}
FLOOR = contact("tip", plane={"point": [0.0, 0.0, -5.0]})
LOOP = load_scene(models.SCENES / "four_bar.yaml").model_dump(exclude_unset=True)


def every(**settings: Any) -> dict[str, Any]:
    return {"joints": {"*": settings}}


SCENES: dict[str, tuple[dict[str, Any], str]] = {
    "plain": (TWO_LINK, "vm"),
    "friction with states": ({**TWO_LINK, **every(friction=BRISTLES)}, "vm"),
    "bilateral constraints": (LOOP, "vm"),
    "friction with states and bilateral constraints": ({**LOOP, **every(friction=BRISTLES)}, "vm"),
    "dry friction": ({**TWO_LINK, **every(friction=DRY)}, "native"),
    "friction by the load of a motor with a current": (
        {**TWO_LINK, **every(friction=BY_LOAD, actuator=MOTOR)},
        "native",
    ),
    "friction with states, bilateral constraints and a contact": (
        {**LOOP, **every(friction=BRISTLES), "constraints": [*LOOP["constraints"], BELOW]},
        "native",
    ),
    "contacts": ({**TWO_LINK, "constraints": [FLOOR]}, "native"),
}


def plant(name: str) -> tuple[Plant, str]:
    scene, backend = SCENES[name]
    return Plant(ArmModel(load_scene(scene))), backend


def stepper(made: Plant, backend: str) -> Stepper:
    return Stepper(made, choose(made, "rk4", None, None), backend)


def falsify(rhs: ca.Function, number: int, factor: float) -> ca.Function:
    """The same function, one number of its last result, x', a little off."""
    inputs = [ca.SX.sym(rhs.name_in(i), rhs.sparsity_in(i)) for i in range(rhs.n_in())]
    *others, slope = rhs.call(inputs)
    slope[number] *= factor
    return ca.Function(rhs.name(), inputs, [*others, slope], rhs.name_in(), rhs.name_out())


@pytest.mark.parametrize("name", SCENES)
def test_right_code_is_taken(name: str) -> None:
    stepper(*plant(name))


@pytest.mark.parametrize("joint", [0, -1])
@pytest.mark.parametrize(
    "name", [name for name, (_, backend) in SCENES.items() if backend == "vm"]
)
def test_code_that_is_a_little_wrong_is_refused(
    name: str, joint: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, backend = plant(name)
    n = made.model.n
    wrong, *events = (
        falsify(each, n + joint % n, 1.001) if each.name() in ("rhs", "loads") else each
        for each in (made.rhs, *made.events.values())
    )
    monkeypatch.setattr(made._state_space, "rhs", wrong)
    monkeypatch.setattr(made._state_space, "events", {event.name(): event for event in events})
    with pytest.raises(KernelError, match="differs from Pinocchio"):
        stepper(made, backend)
