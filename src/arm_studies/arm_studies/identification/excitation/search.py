# SPDX-License-Identifier: Apache-2.0
"""Search for the most exciting motion of an arm."""

from collections.abc import Callable

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array, positive, read_only
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import rigid_body
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.tree_builder import gravity_of, tree_of
from arm_dynamics.trajectory import Trajectory
from arm_sim.inputs import check_whole
from arm_studies._renaming import renamed_argument
from arm_studies.identification.excitation import columns
from arm_studies.identification.excitation.fourier import basis
from arm_studies.identification.excitation.masses import spread
from arm_studies.identification.excitation.room import Room

_INSTANTS = 12  # per harmonic, at which a motion is evaluated while searching
_KNOTS = 24  # knots per harmonic of the motion that is returned
_SOFT = 0.02  # fraction of the velocity limit over which friction changes sign, to have a slope
_INSIDE = 0.98  # of the limits, as a margin for motion between the instants
_SHRINK = 0.97  # of a motion about its start that leaves the room, until it does not
_STATES = 40  # random states for each column of the regressor
_SILENT = {"print_level": 0, "sb": "yes", "hessian_approximation": "limited-memory", "tol": 1e-4}


# Parameters that a motion is optimized for: all of them, or the masses.
ALL, MASSES = "all", "masses"


@frozen
class Excitation:
    """A periodic motion from rest to rest, and how well it determines the arm's parameters.

    Attributes:
        motion: One period.
        joint_names: Order of the joints.
        condition: Largest over smallest singular value of its regressor; see ``columns.distinct``.
        information: log det(WᵀW), likewise.
        parameters: Number of parameters, or combinations of them, that it can identify.
        attempts: Value that each attempt of the search reached, shape (attempts,): the
            information, or the mean standard deviation of masses.
        masses: Relative standard deviations of the masses after one period, for bodies of nominal
            shape and known total mass, if torques have 5 % of white noise at 1 kHz; shape
            (bodies,), None if the aim is all parameters.
    """

    motion: Trajectory
    joint_names: tuple[str, ...]
    condition: float
    information: float
    parameters: int
    attempts: Array
    masses: Array | None = None

    def __repr__(self) -> str:
        """A summary: the motion, and how well it determines parameters."""
        shares = [] if self.masses is None else [f"{x:.2%}" for x in self.masses]
        masses = f"; relative standard deviations of masses {', '.join(shares)}" if shares else ""
        return (
            f"<Excitation of {len(self.joint_names)} joints: {self.motion.duration:g} s, from "
            f"rest to rest; {self.parameters} parameters, condition number {self.condition:.3g}, "
            f"log det {self.information:.4g}{masses}; collisions between links are not checked>"
        )


@renamed_argument("told", "on_progress")
def excite(
    room: Room,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    aim: str = ALL,
    attempts: int = 3,
    iterations: int = 60,
    seed: int = 0,
    on_progress: Callable[[int], None] = lambda attempts_done: None,
) -> Excitation:
    """Compute a periodic motion within limits that is as exciting as possible.

    It is D-optimal for all parameters, A-optimal for masses; see ``masses``. The optimum of the
    determinant of the information matrix does not depend on how parameters are scaled or combined
    (Swevers and others, 1997, section III; Atkinson, Donev, Optimum Experimental Designs, 1992,
    chapter 10). Every attempt starts from a random motion, which an interior-point method (IPOPT)
    improves to a local optimum with exact derivatives. Then it is scaled down about the start
    position until it satisfies every limit at every instant.

    Args:
        room: Constraints of the motion.
        period: In [s].
        harmonics: Number of harmonics, at least 2.
        aim: ``all`` or ``masses``: the parameters to optimize for.
        attempts: Number of random starts.
        iterations: Largest number of iterations of each attempt.
        seed: Of the random starts; the same seed gives the same motion.
        on_progress: Called after each attempt with the number of finished attempts.

    Returns:
        The best motion.

    Raises:
        InvalidInput: If an argument is not allowed, nothing limits a joint, or no motion is found.
    """
    positive("period", period)
    check_whole("harmonics", harmonics, 2)
    check_whole("attempts", attempts, 1)
    check_whole("iterations", iterations, 1)
    if aim not in (ALL, MASSES):
        raise InvalidInput(f"aim is '{aim}'; allowed: {ALL}, {MASSES}")
    search = _Search(room, period, harmonics, aim)
    rng, candidates = np.random.default_rng(seed), list[tuple[float, Array]]()
    for attempt in range(attempts):
        y = search.within(search.improved(search.random(rng), iterations))
        candidates.append((search.gain(y), y))
        on_progress(attempt + 1)
    _, y = max(candidates, key=lambda pair: pair[0])
    sigma = np.linalg.svd(search.rows(y).full(), compute_uv=False)
    rank = int(np.sum(sigma > 1e-9 * sigma[0]))
    if rank < len(sigma):
        raise InvalidInput(
            f"the best motion identifies only {rank} of {len(sigma)} parameters; more harmonics, "
            "a larger workspace or more attempts are expected"
        )
    reached = np.array([value for value, _ in candidates])
    masses = read_only(search.masses(y).full()[:, 0]) if aim == MASSES else None
    return Excitation(
        motion=search.motion(y), joint_names=room.model.joint_names, masses=masses,
        condition=float(sigma[0] / sigma[-1]), information=float(2.0 * np.log(sigma).sum()),
        parameters=len(sigma), attempts=reached if masses is None else -reached,
    )  # fmt: skip


class _Search:
    """The problem in the coefficients y of the Fourier series, shape (n, 2 (N - 1)).

    Attributes:
        rows: The regressor as a function of y, transposed, shape (parameters, rows).
        masses: If they are the aim, their standard deviations as a function of y, see ``spread``.
    """

    @one_at_a_time
    def __init__(self, room: Room, period: float, harmonics: int, aim: str) -> None:
        self.room, self.period, self.harmonics = room, period, harmonics
        model, limits, omega = room.model, room.limits, 2.0 * np.pi / period
        self.half = (limits.upper - limits.lower) / 2.0
        self.speed = np.minimum(limits.velocity, omega * harmonics * self.half)
        acceleration = np.minimum(limits.acceleration, omega * harmonics * self.speed)
        W = columns.regressor(model, _SOFT * self.speed)
        count = _STATES * W.size2_out(0) // model.n
        states = columns.random_states(limits.lower, limits.upper, self.speed, acceleration, count)
        # The scale of each torque: its limit, or its rms over random motions.
        rms = np.sqrt(np.mean(room.torques(*np.moveaxis(states, 1, 0)) ** 2, axis=0))
        effort = room.effort
        typical = np.where(np.isfinite(effort), effort, np.maximum(rms, 1e-9 * rms.max()))
        combinations = columns.distinct(W, states, 1.0 / typical)
        self.shape = model.n, 2 * (harmonics - 1)
        y, times = ca.MX.sym("y", *self.shape), self._times(_INSTANTS)
        part = basis(times, period, harmonics)
        motion = [ca.repmat(ca.DM(room.start), 1, len(times)) + y @ part[0], y @ part[1],
                  y @ part[2]]  # fmt: skip
        Wt = combinations.map(len(times))(*motion)
        self.rows = ca.Function("rows", [y], [Wt])
        if aim == MASSES:
            deviations = spread(model, _SOFT * self.speed, motion, period, typical)
            self.masses = ca.Function("masses", [y], [deviations])
            gain, cost = -ca.sum1(deviations) / deviations.shape[0], ca.log(ca.sumsqr(deviations))
        else:
            gain = columns.information(Wt)
            cost = -gain
        self._gain = ca.Function("gain", [y], [gain])
        g, self._lower, self._upper = self._constraints(motion)
        self._problem = {"x": ca.vec(y), "f": cost, "g": g}

    def gain(self, y: Array) -> float:
        """The objective to maximize; minus infinity if the regressor is singular."""
        value = float(self._gain(y))
        return value if np.isfinite(value) else -np.inf

    def random(self, rng: np.random.Generator) -> Array:
        """Coefficients of a random motion within limits."""
        size = 0.3 * np.minimum(self.half, self.speed * self.period / (2 * np.pi))
        return self.within(size[:, None] * rng.normal(size=self.shape))

    def improved(self, y: Array, iterations: int) -> Array:
        """A local optimum that is reached from ``y``."""
        options = {"ipopt": {**_SILENT, "max_iter": iterations}, "print_time": False}
        solver = ca.nlpsol("search", "ipopt", self._problem, options)
        result = solver(x0=ca.vec(ca.DM(y)), lbg=self._lower, ubg=self._upper)
        solution = ca.reshape(result["x"], *self.shape).full()
        return solution if np.all(np.isfinite(solution)) else y

    def within(self, y: Array) -> Array:
        """The motion scaled down about the start until it satisfies the limits.

        The start itself satisfies them, so this terminates.
        """
        while True:
            try:
                self.room.check(self.motion(y))
            except InvalidInput:
                y = _SHRINK * y
            else:
                return y

    def motion(self, y: Array) -> Trajectory:
        """One period as quintic segments."""
        times = np.append(self._times(_KNOTS), self.period)
        q, v, a = np.moveaxis(y @ basis(times, self.period, self.harmonics), 1, 2)
        v[[0, -1]] = a[[0, -1]] = 0.0  # removes rounding
        return Trajectory.through(times, q + self.room.start, v, a)

    def _times(self, density: int) -> Array:
        count = density * self.harmonics
        return np.asarray(np.arange(count) * (self.period / count), float)

    def _constraints(self, motion: list[ca.MX]) -> tuple[ca.MX, Array, Array]:
        """Constrained values at the instants, as one column, and their bounds."""
        room, model, n = self.room, self.room.model, self.room.model.n
        q, v, a = (ca.SX.sym(name, n) for name in "qva")
        tau = rigid_body.inverse_dynamics(tree_of(model), q, v, a, gravity_of(model))
        friction = model.friction.coulomb.mean * ca.tanh(v / (_SOFT * self.speed))
        tau += model.friction.smooth(v, q) + friction
        gaps, names = room.gaps
        rows = ca.vertcat(q, v, a, tau, gaps(q))
        limits, none = room.limits, np.full(len(names), np.inf)
        off = (1.0 - _INSIDE) * self.half
        most = [_INSIDE * x for x in (limits.velocity, limits.acceleration, room.effort)]
        upper = [limits.upper - off, *most, none]
        lower = [limits.lower + off, *(-x for x in most), np.zeros(len(names))]
        bounded = np.flatnonzero(np.isfinite(np.hstack(lower)))
        g = ca.Function("g", [q, v, a], [rows[bounded.tolist()]], {"cse": True})
        count = motion[0].shape[1]
        bounds = (np.tile(np.hstack(x)[bounded], count) for x in (lower, upper))
        return ca.vec(g.map(count)(*motion)), *bounds
