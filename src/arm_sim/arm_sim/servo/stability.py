# SPDX-License-Identifier: Apache-2.0
"""Whether servos with a given stiffness are stable: their torque is held for a tick.

Between two ticks, M a = τ takes the errors (e, ė) to e + h ė + ½ h² a, ė + h a. Gains that follow
from a bandwidth allow for that, see ``control.pole_placement.held_gains``; those in N m/rad need
not.
"""

import numpy as np

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import postures
from arm_sim.servo.law import Gains, flexibility, rigid_model

POSTURES = 16  # besides the initial one
ROUNDING = 1e-6  # growth of the errors in a tick that is none


def instability(model: ArmModel, dt: float) -> str:
    """Which servo is unstable in ticks of ``dt`` in [s], and what would do; empty if none is."""
    if not any(joint.servo.stiffness for joint in map(model.scene.joint, model.joint_names)):
        return ""
    rigid = rigid_model(model)
    gains, dynamics = Gains.of(rigid, flexibility(model), dt), Dynamics(rigid)
    worst, joint = 1.0 + ROUNDING, -1
    for q in np.vstack([model.q0, postures(model, POSTURES)]):
        try:
            mobility = _mobility(model, dynamics.mass_matrix(q))
        except np.linalg.LinAlgError:
            continue  # a joint without mass is reported by name when it is simulated
        factors, shapes = np.linalg.eig(_error_transition(gains, mobility, dt))
        if float(abs(factors).max()) > worst:
            worst, mode = float(abs(factors).max()), int(abs(factors).argmax())
            joint = int(abs(shapes[model.n :, mode]).argmax())
    if joint < 0:
        return ""
    servo = model.scene.joint(model.joint_names[joint]).servo
    return (
        f"the servo of joint '{model.joint_names[joint]}' (stiffness {servo.stiffness}, damping "
        f"{gains.damping[joint]:.3g}) is unstable at dt = {dt:g} s, for which its torque is held: "
        "a smaller dt, other gains or a bandwidth would do"
    )


def _mobility(model: ArmModel, M: Array) -> Array:
    """Accelerations per torque of what servos move: behind a flexible transmission, the rotor."""
    flexible = flexibility(model) > 0.0
    mobility = np.linalg.inv(M)
    mobility[flexible], mobility[:, flexible] = 0.0, 0.0
    for i in np.flatnonzero(flexible).tolist():
        drive = model.drives[i]
        assert drive is not None
        mobility[i, i] = 1.0 / drive.rotor_inertia
    return mobility


def _error_transition(gains: Gains, mobility: Array, h: float) -> Array:
    """How errors of positions and velocities change in a tick, shape (2 n, 2 n)."""
    n = len(mobility)
    unit, push = np.eye(n), np.diag(gains.velocity) + mobility * gains.damping
    a = -np.hstack([push * gains.position, push])
    drift = np.block([[unit, h * unit], [0.0 * unit, unit]])
    return np.asarray(drift + np.vstack([0.5 * h**2 * a, h * a]))
