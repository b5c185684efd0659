# SPDX-License-Identifier: Apache-2.0
"""The springs of a robot: as data for the equations, and as numerical terms."""

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.codegen.kernel import Call, Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations.interpolation import Curve, chords
from arm_dynamics.equations.spring import Springs, energy, torque
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot, velocity_index
from arm_dynamics.model.tree_builder import frame_of, tree_of
from arm_dynamics.scene.spring import spring_name


def springs_of(robot: Robot) -> Springs:
    """Describe the scene's springs; that of a mimic joint acts on its leader.

    Raises:
        SceneError: If a stiffness is missing, or a spring connects frames that cannot move
            relative to each other.
    """
    scene, names = robot.scene, list(velocity_index(robot.pin))
    numbers, tables = np.zeros((3, len(names))), list[Curve | None]()
    for column, name in zip(numbers.T, names, strict=True):
        tables.append(None)
        if (own := scene.joint(name).spring) is None:
            continue
        if own.stiffness is None and own.table is None:
            raise SceneError(
                f"scene: 'joints.{name}.spring.stiffness' is missing: a number of at least zero "
                "is expected"
            )
        column[:] = own.stiffness or 0.0, own.rest, own.damping
        if own.table is not None:
            at, torques = np.array(own.table.deflection), np.array(own.table.torque)
            steep = chords(at, torques)
            tables[-1] = Curve.through(at, torques, ends=(steep[0], steep[-1]))
    frames = {name: frame_of(robot, name) for spring in scene.springs for name in spring.frames}
    for i, spring in enumerate(scene.springs):
        first, second = spring.frames
        if frames[first].link == frames[second].link:
            raise SceneError(
                f"scene: spring '{spring_name(spring, i)}' is between '{first}' and '{second}', "
                "which cannot move relative to each other: no joint is between them, or all of "
                "them are locked"
            )
    stiffness, rest, damping = map(read_only, numbers)
    return Springs(stiffness, rest, damping, tuple(tables), scene.springs, frames)


class SpringTerms:
    """S(q, v) and the springs' energy, for single states of shape (n,).

    They are the expressions of ``equations.spring`` on CasADi's virtual machine.

    Args:
        robot: The robot; used from one thread only.

    Attributes:
        springs: Its springs.
    """

    def __init__(self, robot: Robot) -> None:
        self.springs, self._n = springs_of(robot), robot.n
        self._call = _evaluated(self.springs, robot) if self.springs else None

    def torque(self, q: Array, v: Array) -> Array:
        """S in [N m] or [N], shape (n,)."""
        return np.zeros(self._n) if self._call is None else self._call(q, v)[0].copy()

    def energy(self, q: Array) -> float:
        """Energy stored in the springs in [J]."""
        return 0.0 if self._call is None else float(self._call(q, 0.0 * q)[1][0])


@one_at_a_time
def _evaluated(springs: Springs, robot: Robot) -> Call:
    q, v = (ca.SX.sym(name, robot.n) for name in "qv")
    tree = tree_of(robot)
    results = ca.densify(torque(springs, tree, q, v)), energy(springs, tree, q)
    return Kernel([ca.Function("springs", [q, v], results, {"cse": True})], "vm").call("springs")
