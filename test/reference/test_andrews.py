# SPDX-License-Identifier: Apache-2.0
"""Andrews' squeezing mechanism against its published solution.

Mazzia, Magherini, Test Set for IVP Solvers, release 2.4, 2008, problem andrews; see also Hairer,
Wanner, Solving Ordinary Differential Equations II, 1996, section VII.7. The solution was computed
by PSIDE with tolerances of 1e-14; all of our methods and two of SciPy's agree that its angles are
1.4e-9 rad off, and that its accelerations are off accordingly.
"""

import numpy as np
import pytest
from samples import sampled

from arm_dynamics import Dynamics
from arm_sim import Simulator

END = 0.03  # [s]
JOINTS = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
# fmt: off
ANGLE = np.array([
    0.1581077119629904e2, -0.1575637105984298e2, 0.4082224013073101e-1, -0.5347301163226948,
    0.5244099658805304, 0.5347301163226948, 0.1048080741042263e1,
])  # [rad]
SPEED = np.array([
    0.1139920302151208e4, -0.1424379294994111e4, 0.1103291221937134e2, 0.1929337464421385e2,
    0.5735699284790808, -0.1929337464421385e2, 0.3231791658026955,
])  # [rad/s]
ACCELERATION = np.array([
    -0.2463176316945196e5, 0.5185037701610329e5, 0.3241025686413781e6, 0.5667493645176213e6,
    0.1674362929479361e5, -0.5667493645176222e6, 0.9826520791458422e4,
])  # [rad/s²]
MULTIPLIERS = np.array([
    [0.1991753333731910e3, -0.2975531228015052e2], [0.2306654119098399e2, 0.3145271365475927e2],
    [0.2264249232082739e2, 0.1161740700019673e2],
])  # [N]
PUBLISHED = 2e-9  # error of the published angles [rad]
TORQUE = 0.033  # [N m]
# fmt: on


@pytest.mark.parametrize(
    ("method", "dt", "tolerance", "allowed"),
    sampled(
        [
            ("rk4", 1e-4, None, 5e-7),
            ("nystrom4", 1e-4, None, 2e-6),
            ("dop853", 1e-4, None, 1e-11),
            ("dop853", 1e-3, 1e-12, 1e-11),
            ("implicit", 1e-4, 1e-9, 1e-9),
        ],
        2,
    ),
)
def test_the_simulator(method: str, dt: float, tolerance: float | None, allowed: float) -> None:
    sim = Simulator("andrews", integrator=method, dt=dt, tolerance=tolerance)
    order = [JOINTS.index(name) for name in sim.joint_names]
    run = sim.run(END, TORQUE * np.array([name == "beta" for name in sim.joint_names]))
    np.testing.assert_allclose(run.q[-1], ANGLE[order], rtol=0.0, atol=PUBLISHED + allowed)
    off = np.abs(run.q[-1] - ANGLE[order])
    np.testing.assert_allclose(run.error[-1, :7], off, rtol=0.05, atol=PUBLISHED)
    assert run.trusted == (allowed < 1e-8)


def test_accelerations_and_multipliers() -> None:
    dyn = Dynamics("andrews")
    order = [JOINTS.index(name) for name in dyn.joint_names]
    tau = TORQUE * np.array([name == "beta" for name in dyn.joint_names])
    found, force = dyn.constrained_forward(ANGLE[order], SPEED[order], tau)
    np.testing.assert_allclose(found, ACCELERATION[order], rtol=2e-6)
    sizes = np.linalg.norm(force.reshape(3, 3), axis=1)  # theirs are along fixed axes
    np.testing.assert_allclose(sizes, np.linalg.norm(MULTIPLIERS, axis=1), rtol=1e-5)
