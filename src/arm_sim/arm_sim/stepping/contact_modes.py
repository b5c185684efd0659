# SPDX-License-Identifier: Apache-2.0
"""What contacts and joints with dry friction do next.

A contact counts as touching where its gap is zero to rounding. Whether it carries, sticks, slides
or lifts off is the solution of a complementarity problem, found by pivoting: the entry that
disobeys most is solved for by itself, the others held, until none disobeys (as for joints alone,
``dry_friction.py``); should that go in circles, all contacts are solved by sweeps.

The same lines stand in C in ``native/contact.c``, for scenes that are compiled.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.equations.contact import AT_REST, MODE
from arm_dynamics.model.arm import Array
from arm_sim.plant.plant import Plant
from arm_sim.stepping.contact_cone import several, single
from arm_sim.stepping.contact_newton import AHEAD, Answer, Does

PIVOTS = 40
EPSILON = 2.220446049250313e-16
# Rounding of a gap, as a multiple of the lengths that make it up: what a closed gap may be, and
# what one that opens must exceed.
GAP_ROUNDING, HOP = 4 * EPSILON, 64 * EPSILON
# Speeds, relative to the fastest joint's where they are rounding errors.
SPEED_ROUNDING = 1e-13
# Speed in [m/s] of a rebound that is taken for rest.
LEAST_REBOUND = 1e-9
# Acceleration, relative to the largest, by which one that is about to move may go wrong.
SLACK = 1e-9
# Part of its cone that a force may lack and still be on the edge.
EDGE = 1e-9


class Trouble(IntEnum):
    """Why a tick could not be computed."""

    NONE = 0
    NUMBERS = 1
    EVENTS = 2
    UNDETERMINED = 3
    INSIDE = 4


class Modes:
    """Finds the modes at a state; all methods take x of shape (2n,) and torques u of (n,).

    Attributes:
        n: Degrees of freedom.
        nc: Number of contacts.
        mu: Coefficients of friction, shape (nc,).
        restitution: Coefficients of restitution, shape (nc,).
        static: Levels of dry friction of the joints at rest, shape (n,).
        length: How many entries of p belong to joints and contacts.
    """

    def __init__(self, plant: Plant, kernel: Kernel) -> None:
        assert plant.contact is not None
        model, points = plant.model, plant.contact.points
        self.n, self.nc = model.n, len(points)
        self.mu = np.array([point.friction for point in points])
        self.restitution = np.array([point.restitution for point in points])
        self.static = model.friction.level if model.has_dry_friction else np.zeros(model.n)
        self.length = MODE * self.nc + (model.n if model.has_dry_friction else 0)
        self._geometry, self._look = kernel.call("contact_geometry"), kernel.call("contact_look")
        self._inertia, self._rhs = kernel.call("contact_inertia"), kernel.call("rhs")
        self._np = len(plant.parameters.nominal)

    def geometry(self, x: Array) -> tuple[Array, ...]:
        """Places and speeds of the points, shape (3 nc,) each, and sizes, shape (nc,)."""
        return self._geometry(x[: 2 * self.n])

    def look(self, x: Array, u: Array, p: Array) -> tuple[Array, ...]:
        """Forces, accelerations of the points, loads of the joints, grips; see the plant."""
        return self._look(x[: 2 * self.n], u, p)

    def inertia(self, x: Array, u: Array, p: Array) -> tuple[Array, ...]:
        """Motion of the points and of the joints per force, and without; see the plant."""
        return self._inertia(x[: 2 * self.n], u, p)

    def velocity(self, x: Array) -> Array:
        """View of the joint velocities in x."""
        return x[self.n : 2 * self.n]

    def directions(self, p: Array) -> Array:
        """View of the joints' directions in p; empty without dry friction."""
        return p[self._np : len(p) - MODE * self.nc]

    def modes(self, p: Array) -> Array:
        """View of the contacts' entries in p: closed, sticks, direction, fixed; shape (nc, 5)."""
        return p[len(p) - MODE * self.nc :].reshape(self.nc, MODE)

    def touching(self, x: Array, u: Array, p: Array) -> Array:
        """Contacts whose gap is closed to rounding and does not open, shape (nc,)."""
        place, speed, size = (row.copy() for row in self.geometry(x))
        shut = place[::3] <= 4 * GAP_ROUNDING * size
        if not (shut & (speed[::3] > self.calm(x))).any():
            return np.asarray(shut)
        return np.asarray(np.logical_and(shut, speed[::3] <= self.hop(x, u, p)))

    def still(self, x: Array) -> None:
        """Put joints with dry friction at rest that a closed contact keeps there, to rounding."""
        v = self.velocity(x)
        v[(self.static > 0.0) & (abs(v) <= self.calm(x))] = 0.0

    def hop(self, x: Array, u: Array, p: Array) -> Array:
        """Speeds of hops that would not rise above the rounding of the gap, shape (nc,)."""
        fall = float(abs(self.inertia(x, u, p)[2][::3]).max())
        return np.asarray(LEAST_REBOUND + np.sqrt(2.0 * fall * HOP * self.geometry(x)[2]))

    def calm(self, x: Array) -> float:
        """Speed of a contact that is rounding."""
        return float(SPEED_ROUNDING * (1.0 + abs(self.velocity(x)).max()))

    def settle(
        self,
        x: Array,
        u: Array,
        p: Array,
        slow: frozenset[int] = frozenset(),
        ended: dict[int, Answer] | None = None,
    ) -> bool:
        """Find what every contact and joint does, and put it into p; False if there is nothing.

        Contacts in ``slow`` count as at rest; ``ended`` says with what to begin, see ``ended``.
        """
        directions = self.directions(p)
        if len(directions):
            directions[:] = np.where(self.static > 0.0, np.sign(self.velocity(x)), 1.0)
        touching = self.touching(x, u, p)
        given = self._guess(x, p, touching, slow)
        for k, answer in (ended or {}).items():
            if touching[k] and (answer.does == Does.APART or given[k] is None):
                self._put(self.modes(p)[k], answer)
        for attempt in range(3):
            for _ in range(PIVOTS * (self.nc + self.n)):
                worst = self._worst(x, u, p, touching, given)
                if worst is None:
                    return self._determined(x, u, p)
                if not self._pivot(x, u, p, worst, given):
                    break
            if attempt == 0:
                self._sweep(x, u, p, touching, given)
        return False

    def ended(self, x: Array, u: Array, p: Array) -> dict[int, Answer]:
        """What contacts will do whose mode has just come to its end: lift off, or slip."""
        force, found = self.look(x, u, p)[0].copy(), {}
        for k, (closed, sticks, *_) in enumerate(self.modes(p)):
            r = force[3 * k : 3 * k + 3]
            size = float(np.hypot(r[1], r[2]))
            if closed and r[0] <= 0.0:
                found[k] = Answer(Does.APART, np.zeros(3), AHEAD)
            elif closed and sticks and size >= self.mu[k] * r[0] > 0.0:
                found[k] = Answer(Does.SLIDES, r, -r[1:] / size)
        return found

    def _guess(
        self, x: Array, p: Array, touching: Array, slow: frozenset[int]
    ) -> list[Array | None]:
        """Take it that all that touch carry, and those at rest stick."""
        modes, given = self.modes(p), list[Array | None]()
        speed = self.geometry(x)[1].copy()
        for k in range(self.nc):
            s = speed[3 * k + 1 : 3 * k + 3]
            size = float(np.hypot(s[0], s[1]))
            rests = self.mu[k] > 0.0 and (size <= AT_REST or k in slow)
            d = s / size if self.mu[k] > 0.0 and not rests else np.array([1.0, 0.0])
            given.append(None if rests else d)
            modes[k] = [touching[k], touching[k] and rests, d[0], d[1], rests]
        return given

    def _worst(
        self, x: Array, u: Array, p: Array, touching: Array, given: list[Array | None]
    ) -> int | None:
        """The entry that disobeys most: a contact, or nc plus a joint; None if all obey."""
        force, rate, load, _ = self.look(x, u, p)
        heaviest, fastest = 1.0 + abs(force).max(), 1.0 + abs(rate).max()
        most, worst = 0.0, None
        for k, (closed, sticks, d0, d1, _) in enumerate(self.modes(p)):
            r, w = force[3 * k : 3 * k + 3], rate[3 * k : 3 * k + 3]
            if not closed:
                excess = -w[0] / fastest - SLACK if touching[k] else 0.0
            elif r[0] < 0.0:
                excess = -r[0] / heaviest
            elif sticks:
                excess = (float(np.hypot(r[1], r[2])) - self.mu[k] * r[0]) / heaviest
            elif given[k] is None:
                astray = max(-(d0 * w[1] + d1 * w[2]), abs(d0 * w[2] - d1 * w[1]))
                excess = astray / fastest - SLACK
            else:
                excess = 0.0
            if excess > most:
                most, worst = excess, k
        return self._worst_joint(x, u, p, load, most, worst)

    def _worst_joint(
        self, x: Array, u: Array, p: Array, load: Array, most: float, worst: int | None
    ) -> int | None:
        directions = self.directions(p)
        if not len(directions):
            return worst
        resting = (self.static > 0.0) & (self.velocity(x) == 0.0)
        if not resting.any():
            return worst
        load = load.copy()
        a = self.velocity(self._rhs(x, u, p)[0])
        for i in np.flatnonzero(resting):
            if directions[i] == 0.0:
                excess = (abs(load[i]) - self.static[i]) / self.static.max()
            else:
                excess = -directions[i] * a[i] / (1.0 + abs(a).max()) - SLACK
            if excess > most:
                most, worst = excess, self.nc + int(i)
        return worst

    def _pivot(self, x: Array, u: Array, p: Array, entry: int, given: list[Array | None]) -> bool:
        """Let the entry do what obeys while the others stay as they are."""
        force, rate, load, _ = (value.copy() for value in self.look(x, u, p))
        if entry >= self.nc:
            i = entry - self.nc
            directions = self.directions(p)
            directions[i] = np.sign(load[i]) if directions[i] == 0.0 else 0.0
            return True
        own = slice(3 * entry, 3 * entry + 3)
        W = self.inertia(x, u, p)[0][own, own]
        answer = single(W, rate[own] - W @ force[own], self.mu[entry], given[entry])
        if answer.does == Does.UNSOLVABLE:
            return False
        mode = self.modes(p)[entry]
        does = Does.APART if not mode[0] else Does.STICKS if mode[1] else Does.SLIDES
        if answer.does == does == Does.STICKS:  # at the very edge
            t = force[own][1:]
            answer = Answer(Does.SLIDES, force[own], -t / float(np.hypot(t[0], t[1])))
        elif answer.does == does == Does.APART:
            answer = Answer(Does.STICKS, force[own], mode[2:4].copy())
            if given[entry] is not None:
                answer.does = Does.SLIDES
        self._put(mode, answer)
        return True

    def _sweep(
        self, x: Array, u: Array, p: Array, touching: Array, given: list[Array | None]
    ) -> None:
        W, _, free = (value.copy() for value in self.inertia(x, u, p))
        answers = several(W, free, self.mu, given, touching)
        for mode, answer, mu in zip(self.modes(p), answers, self.mu, strict=True):
            normal, *t = answer.force
            size = float(np.hypot(*t))
            # On the very edge of its cone: where contacts are redundant, the forces of least norm
            # would leave it.
            if answer.does == Does.STICKS and size >= (1.0 - EDGE) * mu * normal and size > 0.0:
                answer = Answer(Does.SLIDES, answer.force, -np.array(t) / size)
            self._put(mode, answer)

    def _put(self, mode: Array, answer: Answer) -> None:
        mode[0] = answer.does in (Does.SLIDES, Does.STICKS)
        mode[1] = answer.does == Does.STICKS
        mode[2:4] = answer.direction

    def _determined(self, x: Array, u: Array, p: Array) -> bool:
        """Whether every contact that slides opens when its normal force grows."""
        grip, modes = self.look(x, u, p)[3], self.modes(p)
        slides = (modes[:, 0] > 0.0) & (modes[:, 1] == 0.0)
        return bool((grip[slides] > 0.0).all())
