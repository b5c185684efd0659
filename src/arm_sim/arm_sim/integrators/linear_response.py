# SPDX-License-Identifier: Apache-2.0
"""How fast an arm answers to small disturbances: M q̈ + D q̇ + K q = 0, and the states of its laws.

Forces that act within milliseconds decide which method a scene needs: friction, springs, compliant
stops, drives. Gravity and inertial forces are slower, and left out. The same forces move a light
joint faster, and a joint is lighter in some postures than in others, so several postures are
sampled.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.actuation import StateKind
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import spring
from arm_dynamics.model.arm import postures
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.plant.plant import Plant

FRICTION, SPRINGS, STOPS, LAWS = (
    "friction stops", "a spring moves", "a stop throws back", "its drive moves"
)  # fmt: skip
# Postures besides the initial one, and the number of joints, cubed, that all of them may have: an
# arm of many joints is sampled in fewer.
POSTURES, MAX_WORK = 32, 100_000
# Size of a combination of constraint rows, relative to the largest, that is zero.
DEPENDENCE = 1e-9


type Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class LinearResponse:
    """x' = J x of small disturbances x = (q, v, z) from rest at one place.

    Attributes:
        J: Shape (nx, nx).
        forces: Torques of each part on the joints by x, shape (n, nx).
        initial: Whether it is the place where the arm begins.
    """

    J: Array
    forces: Mapping[str, Array]
    initial: bool

    @cached_property
    def modes(self) -> tuple[Complex, Complex]:
        """Rates λ of the modes exp(λ t) in [1/s], shape (nx,), and their shapes in columns."""
        rates, shapes = np.linalg.eig(self.J)
        return rates.astype(complex), shapes.astype(complex)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(next(iter(self.forces.values())))

    @property
    def fastest_mode(self) -> int:
        """Index of the mode with the largest rate."""
        return int(abs(self.modes[0]).argmax())

    @property
    def fastest_rate(self) -> float:
        """Largest size of a rate in [1/s]."""
        return float(abs(self.modes[0]).max(initial=0.0))

    def cause(self, mode: int) -> tuple[str, int]:
        """The part that pushes most in a mode, and the joint that moves most."""
        shape = self.modes[1][:, mode]
        pushes = {part: np.linalg.norm(force @ shape) for part, force in self.forces.items()}
        joint = int(abs(shape[self.n : 2 * self.n]).argmax())
        return max(pushes, key=pushes.__getitem__), joint


@one_at_a_time
def responses(plant: Plant) -> list[LinearResponse]:
    """Responses of a scene, away from its compliant stops and pressed against them.

    Args:
        plant: The scene's equation of motion.

    Returns:
        One for each posture and, with compliant stops, another one; none if no such force acts, or
        where a joint moves no mass, which is reported by name when the plant is built.
    """
    if not (parts := _Parts(plant)):
        return []
    results = list[LinearResponse]()
    model = plant.model
    count = 0 if model.scene.bilateral else min(POSTURES, MAX_WORK // model.n**3)
    for place, q in enumerate([model.q0, *postures(model, count)]):
        try:
            results += parts.sample(q, initial=place == 0)
        except np.linalg.LinAlgError:
            continue
    return results


def rate_by_state(plant: Plant) -> Callable[[Array], float]:
    """The fastest rate of a scene in [1/s] as function of the state, where springs may stiffen."""
    parts, n = _Parts(plant), plant.model.n
    return lambda x: max(r.fastest_rate for r in parts.sample(x[:n], initial=False, z=x[2 * n :]))


class _Parts:
    """The parts of a scene that push joints when these are displaced, or move."""

    def __init__(self, plant: Plant) -> None:
        self._plant, self._dynamics = plant, Dynamics(plant.model)
        friction, stops = plant.model.friction, plant.model.stops
        self._friction = np.diag(friction.rise)
        self._stops = stops.stiffness.max(axis=0), stops.damping.max(axis=0)
        self._springs = _spring_slopes(plant.model) if plant.model.springs else None
        self._laws = _law_slopes(plant) if plant.laws else None

    def __bool__(self) -> bool:
        pushes = self._friction.any() or self._stops[0].any()
        return bool(pushes or self._springs or self._laws)

    def sample(self, q: Array, initial: bool, z: Array | None = None) -> Iterator[LinearResponse]:
        """Responses at a place, away from compliant stops and pressed against them.

        Without internal states z, those at rest.

        Raises:
            LinAlgError: If a joint moves no mass there.
        """
        n, nx = self._plant.model.n, self._plant.nx
        forces = {FRICTION: _padded(np.zeros((n, n)), -self._friction, nx)}
        rates = np.zeros((0, nx))
        if self._springs:
            K, D = (np.array(part) for part in self._springs(q))
            forces[SPRINGS] = _padded(-K, -D, nx)
        if self._laws:
            forces[LAWS], rates = map(np.array, self._laws(q, self._states(q) if z is None else z))
        yield LinearResponse(self._slopes(q, forces, rates), forces, initial)
        if self._stops[0].any():
            K, D = map(np.diag, self._stops)
            pressed = {**forces, STOPS: _padded(-K, -D, nx)}
            yield LinearResponse(self._slopes(q, pressed, rates), pressed, initial)

    def _slopes(self, q: Array, forces: dict[str, Array], rates: Array) -> Array:
        n, nx = self._plant.model.n, self._plant.nx
        push = self._mobility(q) @ sum(forces.values(), np.zeros((n, nx)))
        J = np.vstack([np.eye(n, nx, n), push, rates])
        if not np.isfinite(J).all():
            raise np.linalg.LinAlgError
        return J

    def _mobility(self, q: Array) -> Array:
        """Accelerations per torque under the constraints that cannot be switched off, (n, n)."""
        M, scene = self._dynamics.mass_matrix(q), self._plant.model.scene
        if not scene.bilateral:
            return np.linalg.inv(M)
        rows = ConstraintRows(self._plant.model)
        pairs = zip(rows.names, rows.constraints, strict=True)
        permanent = {name for name, constraint in pairs if not constraint.switchable}
        _, sizes, basis = np.linalg.svd(rows.stacked(q, 0.0 * q, permanent).jacobian)
        rank = int((sizes > DEPENDENCE * sizes.max(initial=0.0)).sum())
        Z = basis[rank:].T  # velocities that the constraints allow
        return np.asarray(Z @ np.linalg.solve(Z.T @ M @ Z, Z.T))

    def _states(self, q: Array) -> Array:
        """Internal states at rest, with teeth in contact."""
        laws = self._plant.laws
        z = laws.initial(q, 0.0 * q)
        for k, state in enumerate(laws.states):
            drive = self._plant.model.drives[state.joint]
            if state.kind is StateKind.MOTOR_POSITION and drive and drive.coupling:
                z[k] += drive.coupling.backlash
        return z


def _padded(by_q: Array, by_v: Array, nx: int) -> Array:
    """Slopes of torques that internal states do not change, shape (n, nx)."""
    slopes = np.hstack([by_q, by_v])
    return np.pad(slopes, ((0, 0), (0, nx - slopes.shape[1])))


def _spring_slopes(model: ArmModel) -> ca.Function:
    """Function (q) -> K and D of the springs; a cord counts as taut, as it may pull later."""
    points = tuple(s.model_copy(update={"tension_only": False}) for s in model.springs.points)
    q, v = ca.SX.sym("q", model.n), ca.SX.sym("v", model.n)
    S = spring.torque(replace(model.springs, points=points), tree_of(model), q, v)
    slopes = ca.Function("slopes", [q, v], [ca.jacobian(S, q), ca.jacobian(S, v)])
    return ca.Function("springs", [q], slopes(q, 0.0))


def _law_slopes(plant: Plant) -> ca.Function:
    """Function (q, z) -> slopes by x, at rest, of the laws' torques and of the rates of z."""
    n, nz = plant.model.n, plant.nz
    q, v, z = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("z", nz)
    flow, x = plant.laws.equations(q, v, z, ca.SX(n, 1)), ca.vertcat(q, v, z)
    by_x = [ca.jacobian(part, x) for part in (flow.torque, flow.slope)]
    slopes = ca.Function("slopes", [q, v, z], by_x)
    return ca.Function("laws", [q, z], slopes(q, 0.0, z))
