# SPDX-License-Identifier: Apache-2.0
"""Forces and losses of contacts in runs that are changed or held."""

from dataclasses import replace

import numpy as np

from arm_sim import Simulator, State, contact_history
from arm_sim.recording.contents import BRAKES
from models.touching import contact, rails
from tolerances import CLOSED_FORM, assert_close

G, MASS, LOAD, ADDED = 9.81, 2.0, 0.5, 1.5


def test_forces_are_those_of_the_load_at_each_time() -> None:
    load = {"frame": "body", "mass": LOAD, "inertia": [0.0] * 6}
    scene = rails("z", MASS) | {"payloads": [load], "tunable": ["payload"]}
    sim = Simulator(scene | {"constraints": [contact("body")]})

    def control(state: State) -> list[float]:
        if state.step == 5:
            sim.set_parameter("payload", [LOAD + ADDED, *[0.0] * 9])
        return [0.0]

    force = contact_history(sim, sim.run(0.01, control)).force[:, 0, 2]
    assert_close(force[:5], np.full(5, (MASS + LOAD) * G), CLOSED_FORM)
    assert_close(force[5:], np.full(6, (MASS + LOAD + ADDED) * G), CLOSED_FORM)


def test_nothing_is_lost_where_brakes_hold() -> None:
    sim = Simulator(rails("xz", MASS) | {"constraints": [contact("body", friction=0.4)]})
    sim.reset(v=[1.0, 0.0])
    run = sim.run(0.01)
    slid = contact_history(sim, run).friction_loss
    held = replace(run, hold=np.array([0] * 5 + [BRAKES] * 6, np.uint8))
    loss = contact_history(sim, held).friction_loss
    assert_close(loss[:6], slid[:6], CLOSED_FORM)
    assert slid[-1] > slid[5] and (loss[6:] == loss[5]).all()
