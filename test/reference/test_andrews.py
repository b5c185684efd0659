# SPDX-License-Identifier: Apache-2.0
"""Andrews' squeezing mechanism against its own equations and against its published solution.

The equations, in the angles of the scene's joints and six multipliers, and the solution are those
of Mazzia, Magherini, Test Set for IVP Solvers, release 2.4, 2008, problem andrews; see also
Hairer, Wanner, Solving Ordinary Differential Equations II, 1996, section VII.7. The solution was
computed by PSIDE with tolerances of 1e-14. Two methods of SciPy's and all of ours agree that its
angles are 1.4e-9 rad off, and that its accelerations are off accordingly.
"""

from functools import cache

import numpy as np
import pytest
from samples import sampled
from scipy.integrate import solve_ivp

from arm_dynamics import Dynamics
from arm_sim import Simulator

END = 0.03  # [s]
JOINTS = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
# fmt: off
START = np.array([
    -0.06171389001427645, 0.0, 0.4552798191630704, 0.22266839016588588, 0.48736497954384255,
    -0.22266839016588588, 1.2305474445498212,
])  # [rad]
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

M = np.array([0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498])  # [kg]
I = np.array([2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5])  # noqa: E741
XB, YB, XC, YC = -0.03635, 0.03273, 0.014, 0.072  # [m]
C0, L0, TORQUE = 4530.0, 0.07785, 0.033  # [N/m], [m], [N m]
D, DA, E, EA, RR, RA, U, ZF, ZT, FA = (
    0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092, 0.04, 0.02, 0.04, 0.01421
)  # [m]
SS, SA, SB, SC, SD, TA, TB, UA, UB = (
    0.035, 0.01874, 0.01043, 0.018, 0.02, 0.02308, 0.00916, 0.01228, 0.00449
)  # [m]
# fmt: on


def mass_matrix(q: np.ndarray) -> np.ndarray:
    """M(q) of the open chains."""
    _, th, _, ph, _, om, _ = q
    rod, arm = E - EA, ZF - FA
    m = np.zeros((7, 7))
    m[0, 0] = M[0] * RA**2 + M[1] * (RR**2 - 2 * DA * RR * np.cos(th) + DA**2) + I[0] + I[1]
    m[0, 1] = m[1, 0] = M[1] * (DA**2 - DA * RR * np.cos(th)) + I[1]
    m[1, 1] = M[1] * DA**2 + I[1]
    m[2, 2] = M[2] * (SA**2 + SB**2) + I[2]
    m[3, 3] = M[3] * rod**2 + I[3]
    m[3, 4] = m[4, 3] = M[3] * (rod**2 + ZT * rod * np.sin(ph)) + I[3]
    m[4, 4] = M[3] * (ZT**2 + 2 * ZT * rod * np.sin(ph) + rod**2) + I[3] + I[4]
    m[4, 4] += M[4] * (TA**2 + TB**2)
    m[5, 5] = M[5] * arm**2 + I[5]
    m[5, 6] = m[6, 5] = M[5] * (arm**2 - U * arm * np.sin(om)) + I[5]
    m[6, 6] = M[5] * (arm**2 - 2 * U * arm * np.sin(om) + U**2) + I[5] + I[6]
    m[6, 6] += M[6] * (UA**2 + UB**2)
    return m


def torques(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Of the motor, the spring and the velocities."""
    _, th, ga, ph, _, om, _ = q
    be_v, th_v, _, ph_v, de_v, om_v, ep_v = v
    rod, arm = E - EA, ZF - FA
    x = SD * np.cos(ga) + SC * np.sin(ga) + XB - XC
    y = SD * np.sin(ga) - SC * np.cos(ga) + YB - YC
    pull = -C0 * (1.0 - L0 / np.hypot(x, y))
    return np.array(
        [
            TORQUE - M[1] * DA * RR * th_v * (th_v + 2 * be_v) * np.sin(th),
            M[1] * DA * RR * be_v**2 * np.sin(th),
            pull * (x * (SC * np.cos(ga) - SD * np.sin(ga)))
            + pull * (y * (SD * np.cos(ga) + SC * np.sin(ga))),
            M[3] * ZT * rod * de_v**2 * np.cos(ph),
            -M[3] * ZT * rod * ph_v * (ph_v + 2 * de_v) * np.cos(ph),
            -M[5] * U * arm * ep_v**2 * np.cos(om),
            M[5] * U * arm * om_v * (om_v + 2 * ep_v) * np.cos(om),
        ]
    )


def rows(q: np.ndarray) -> np.ndarray:
    """Derivative of the six equations of the loops, also of complex angles."""
    be, th, ga, ph, de, om, ep = q
    g = np.zeros((6, 7), dtype=q.dtype)
    for k in (0, 2, 4):
        g[k : k + 2, 1] = D * np.sin(be + th), -D * np.cos(be + th)
        g[k : k + 2, 0] = g[k : k + 2, 1] + [-RR * np.sin(be), RR * np.cos(be)]
    g[:2, 2] = -SS * np.cos(ga), -SS * np.sin(ga)
    g[2:4, 3] = -E * np.cos(ph + de), -E * np.sin(ph + de)
    g[2:4, 4] = g[2:4, 3] + [ZT * np.sin(de), -ZT * np.cos(de)]
    g[4:, 5] = ZF * np.sin(om + ep), -ZF * np.cos(om + ep)
    g[4:, 6] = g[4:, 5] + [-U * np.cos(ep), -U * np.sin(ep)]
    return g


def acceleration(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the angles, and the multipliers: M a + Gᵀ λ = torques, G a = -Ġ v."""
    g, change = rows(q), rows(q + 1e-100j * v).imag / 1e-100
    whole = np.block([[mass_matrix(q), g.T], [g, np.zeros((6, 6))]])
    found = np.linalg.solve(whole, np.concatenate([torques(q, v), -change @ v]))
    return found[:7], found[7:].reshape(3, 2)


@cache
def end() -> np.ndarray:
    """Angles and speeds at the end, by SciPy; the loops drift apart by 4e-16 m."""

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[7:], acceleration(x[:7], x[7:])[0]])

    start = np.concatenate([START, np.zeros(7)])
    return solve_ivp(slope, (0.0, END), start, method="DOP853", rtol=3e-14, atol=1e-13).y[:, -1]


def test_the_published_solution() -> None:
    """Its equations are understood: motion, accelerations and multipliers are those published."""
    np.testing.assert_allclose(end()[:7], ANGLE, rtol=0.0, atol=PUBLISHED)
    np.testing.assert_allclose(end()[7:], SPEED, rtol=1e-7)
    found, force = acceleration(ANGLE, SPEED)
    np.testing.assert_allclose(found, ACCELERATION, rtol=2e-6)
    np.testing.assert_allclose(force, MULTIPLIERS, rtol=1e-5)


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
    np.testing.assert_allclose(run.q[-1], end()[:7][order], rtol=0.0, atol=allowed)
    np.testing.assert_allclose(run.q[-1], ANGLE[order], rtol=0.0, atol=PUBLISHED + allowed)
    off = np.abs(run.q[-1] - end()[:7][order])
    np.testing.assert_allclose(run.error[-1, :7], off, rtol=0.05, atol=1e-10)
    assert run.trusted == (allowed < 1e-8)


def test_accelerations_and_multipliers() -> None:
    dyn = Dynamics("andrews")
    order = [JOINTS.index(name) for name in dyn.joint_names]
    q, v = end()[:7], end()[7:]
    tau = TORQUE * np.array([name == "beta" for name in dyn.joint_names])
    found, force = dyn.constrained_forward(q[order], v[order], tau)
    expected, multipliers = acceleration(q, v)
    np.testing.assert_allclose(found, expected[order], rtol=1e-10)
    sizes = np.linalg.norm(force.reshape(3, 3), axis=1)  # theirs are along fixed axes
    np.testing.assert_allclose(sizes, np.linalg.norm(multipliers, axis=1), rtol=1e-10)
