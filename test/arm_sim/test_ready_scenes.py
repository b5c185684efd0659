# SPDX-License-Identifier: Apache-2.0
"""Bundled scenes that combine features, each against a closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

import models
from arm_sim import Simulator, contact_history
from tolerances import assert_close

G = 9.81

# --- lifting_gripper: a grip by the current limit, a load held by friction --------------------

SQUEEZE = 1000 * 0.02 * 0.5 - 0.5  # N K_t I less the finger's Coulomb friction [N], ...
LARGEST = 1000 * 0.02 * 0.5 + 0.5  # ... and with it: at rest it may act either way
MU, BOX, PALM = 0.5, 0.3, 0.66  # of each tip; [kg], the fingers with the palm


@pytest.mark.parametrize("slips", [False, True])
def test_a_box_is_lifted_as_fast_as_friction_allows(slips: bool) -> None:
    """m (g + a) of what two tips hold: 2 µ times what presses them, in which the friction of the
    fingers at rest may take part; beyond it they slide on the box.
    """
    sim = models.simulator("lifting_gripper")
    names = sim.joint_names
    box, lift, left, right = map(names.index, ("box_height", "lift", "left", "right"))
    u = np.zeros(sim.n)
    u[[left, right]] = -0.5
    sim.run(0.5, u)
    a = (1.02 if slips else 0.98) * (2.0 * MU * (LARGEST if slips else SQUEEZE) / BOX - G)
    rail = 20.0 * np.eye(sim.n)[lift]  # its viscous friction [N s/m]
    u[lift] = (PALM + BOX) * (G + a)
    run = sim.run(0.01, lambda state: u + rail * state.v)
    force = contact_history(sim, run).force[5]
    normal = np.abs(force[:, 1])
    assert (normal >= SQUEEZE * (1.0 - 1e-9)).all() and (normal <= LARGEST * (1.0 + 1e-9)).all()
    assert_close(-force[:, 2].sum(), min(BOX * (G + a), MU * normal.sum()), 1e-3)
    apart = run.q[-1, lift] - run.q[-1, box]
    assert apart > 5e-6 if slips else abs(apart) < 1e-12


# --- flexible_arm_wall: an impact that only the links feel ------------------------------------


def mass_matrix(elbow: float) -> np.ndarray:
    """Of the two rods alone; M of the textbooks, [kg m²]."""
    m1, m2, l1, c1, c2, i1, i2 = 2.0, 1.5, 0.5, 0.25, 0.2, 2.0 * 0.25 / 12, 1.5 * 0.16 / 12
    h = m2 * l1 * c2 * np.cos(elbow)
    inner = i2 + m2 * c2 * c2
    whole = i1 + m1 * c1 * c1 + m2 * l1 * l1 + inner + 2.0 * h
    return np.array([[whole, inner + h], [inner + h, inner]])


def test_only_the_links_of_a_flexible_arm_rebound() -> None:
    """v⁺ = v − M⁻¹ Jᵀ (1 + e) γ / (J M⁻¹ Jᵀ) with M of the links; rotors keep their speed."""
    scene = models.scene("flexible_arm_wall").model_dump(exclude_unset=True)
    scene["constraints"][0]["friction"] = 0.0
    sim = Simulator(scene, dt=1e-5)
    shoulder, near = -0.9, 1e-6
    elbow = brentq(lambda e: 0.5 * np.cos(-0.9) + 0.4 * np.cos(e - 0.9) - 0.7 + near, 0.9, 2.5)
    q, v = np.array([shoulder, elbow]), np.array([2.0, -1.0])
    tip = -0.4 * np.sin(shoulder + elbow)
    J = np.array([tip - 0.5 * np.sin(shoulder), tip])
    assert J @ v > 0.1
    W = np.linalg.inv(mass_matrix(elbow))
    after = v - W @ J * 1.5 * (J @ v) / (J @ W @ J)
    sim.reset(q, v)
    run = sim.run(2e-5, np.zeros(2))
    assert_close(run.v[-1], after, 1e-3)
    assert_close(run.z[-1, [1, 3]], v, 1e-3)
    lost = 0.5 * (1.0 - 0.5**2) * (J @ v) ** 2 / (J @ W @ J)
    assert_close(contact_history(sim, run).impact_loss[-1], lost, 1e-4)
