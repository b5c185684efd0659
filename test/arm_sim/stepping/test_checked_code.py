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

BRISTLES = {"viscous": 0.2, "coulomb": 0.3, "lugre": {"sigma0": 1e4, "sigma1": 20.0}}
EVERY: dict[str, Any] = {"joints": {"*": {"friction": BRISTLES}}}
TWO_LINK = {"robot": {"urdf": str(models.SCENES / "two_link.urdf")}}
LOOP = load_scene(models.SCENES / "four_bar.yaml").model_dump(exclude_unset=True)
SCENES: dict[str, dict[str, Any]] = {
    "plain": TWO_LINK,
    "friction with states and bilateral constraints": {**LOOP, **EVERY},
}


def falsify(rhs: ca.Function, number: int, factor: float) -> ca.Function:
    """The same function, one number of its last result, x', a little off."""
    inputs = [ca.SX.sym(rhs.name_in(i), rhs.sparsity_in(i)) for i in range(rhs.n_in())]
    *others, slope = rhs.call(inputs)
    slope[number] *= factor
    return ca.Function(rhs.name(), inputs, [*others, slope], rhs.name_in(), rhs.name_out())


@pytest.mark.parametrize("joint", [0, -1])
@pytest.mark.parametrize("name", SCENES)
def test_code_that_is_a_little_wrong_is_refused(
    name: str, joint: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Plant(ArmModel(load_scene(SCENES[name])))
    n = made.model.n
    wrong, *events = (
        falsify(each, n + joint % n, 1.001) if each.name() in ("rhs", "loads") else each
        for each in (made.rhs, *made.events.values())
    )
    monkeypatch.setattr(made._state_space, "rhs", wrong)
    monkeypatch.setattr(made._state_space, "events", {event.name(): event for event in events})
    with pytest.raises(KernelError, match="differs from Pinocchio"):
        Stepper(made, choose(made, "rk4", None, None), "vm")
