# SPDX-License-Identifier: Apache-2.0
"""Smooth pieces of a motion with contacts: how long one lasts, and what is set right at its ends.

The same lines stand in C in ``native/contact.c``, for scenes that are compiled.
"""

from __future__ import annotations

import numpy as np

from arm_dynamics.codegen.kernel import Call
from arm_dynamics.equations.contact import AT_REST
from arm_dynamics.model.arm import Array
from arm_sim.stepping.contact_modes import GAP_ROUNDING, Modes
from arm_sim.stepping.dry_friction import AT_REST as SUDDEN_STOP
from arm_sim.stepping.dry_friction import ROUNDING
from arm_sim.stepping.events import Flow, first_positive

# Speed in [m/s] by which a contact that is apart may sink without being called an approach.
SINKING = 1e-12
# Speed of an arm, in [rad/s] or [m/s], all of whose joints are held, that is rounding.
HELD = 1e-9
# Parts into which slow sliding may divide a tick, and turn in [rad] a tick that is much.
MOST_PARTS, MUCH_TURN = 32, 0.05
# Part of the trace that a row of the rank's matrix must exceed to count.
INDEPENDENT = 1e-10


class Pieces:
    """Motion between events.

    Args:
        modes: What contacts and joints do.
        flow: Smooth motion over a piece.
        close: Kernel function that brings a state back to its closed contacts.
    """

    def __init__(self, modes: Modes, flow: Flow, close: Call) -> None:
        self._modes, self._flow, self._close = modes, flow, close
        self._n, self._sticky = modes.n, modes.static > 0.0

    def length(self, x: Array, u: Array, p: Array, left: float) -> tuple[float, bool]:
        """How long the modes in p stay right, at most ``left``, and whether that is to the end."""
        ground = np.minimum(self._modes.geometry(x)[0][::3], 0.0)

        def wrong(t: float) -> float:
            after = self._flow.tried(x, u, p, t)
            return np.inf if after is None else self._wrong(after, u, p, ground, t)

        calm = wrong(left) <= 0.0
        length = left if calm else first_positive(wrong, left)
        dip = self._dip(x, u, p, ground, length)
        if dip is None:
            return length, calm
        return first_positive(wrong, dip), False

    def slow(self, x: Array, u: Array, p: Array, tick: float) -> frozenset[int]:
        """Contacts that slide so slowly that an explicit method cannot follow their direction.

        Friction turns a contact into its direction at the rate µ λ w / s, with w the acceleration
        per force across it and s its speed. One that gets faster, or turns, is better given the
        direction in which it would start from rest; one that stops straight on is found exactly.
        """
        rates, modes = self._rates(x, u, p), self._modes.modes(p)
        a, found = self._modes.look(x, u, p)[1], set()
        for k in np.flatnonzero(rates > MOST_PARTS / tick):
            s, w = self._modes.geometry(x)[1][3 * k + 1 : 3 * k + 3], a[3 * k + 1 : 3 * k + 3]
            d0, d1 = modes[k, 2:4]
            turn = abs(d0 * w[1] - d1 * w[0]) * tick
            if d0 * w[0] + d1 * w[1] >= 0.0 or turn > MUCH_TURN * float(np.hypot(s[0], s[1])):
                found.add(int(k))
        return frozenset(found)

    def reach(self, x: Array, u: Array, p: Array, tick: float) -> float:
        """How long a piece may be in [s] for slow sliding to be followed."""
        return float(max(1.0 / max(1.0 / tick, *self._rates(x, u, p)), tick / MOST_PARTS))

    def aligned(self, x: Array, p: Array, slow: frozenset[int]) -> Array:
        """Stop slow contacts that move against the direction in which they are to start."""
        place, speed = (row.copy() for row in self._modes.geometry(x)[:2])
        halted, modes = p.copy(), self._modes.modes(p)
        for k in slow:
            s = speed[3 * k + 1 : 3 * k + 3]
            if modes[k, 0] > 0.0 and modes[k, 2] * s[0] + modes[k, 3] * s[1] <= 0.0:
                self._modes.modes(halted)[k, 1] = 1.0
        if (halted == p).all():
            return x
        return self.closed(x, halted, place.reshape(-1, 3)[:, 1:].ravel())

    def _rates(self, x: Array, u: Array, p: Array) -> Array:
        """Rate in [1/s] at which friction turns each contact that slides, shape (nc,)."""
        modes, mu = self._modes.modes(p), self._modes.mu
        slides, rates = (modes[:, 0] > 0.0) & (modes[:, 1] == 0.0), np.zeros(len(mu))
        if not (slides & (mu > 0.0)).any():
            return rates
        W = self._modes.inertia(x, u, p)[0].copy()
        force, speed = self._modes.look(x, u, p)[0], self._modes.geometry(x)[1]
        for k in np.flatnonzero(slides & (mu > 0.0)):
            n = 3 * k
            a, b = -modes[k, 3], modes[k, 2]
            across = a * a * W[n + 1, n + 1] + b * b * W[n + 2, n + 2]
            across += 2.0 * a * b * W[n + 1, n + 2]
            size = float(np.hypot(speed[n + 1], speed[n + 2]))
            rates[k] = mu[k] * force[n] * across / max(size, AT_REST)
        return rates

    def friction_work(self, x: Array, u: Array, p: Array, h: float) -> float:
        """Work that sliding contacts take out over a piece in [J], by Simpson's rule."""
        work = 0.0
        for part, weight in ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0)):
            there = self._flow.tried(x, u, p, part * h)
            if there is None:
                return work
            speed = self._modes.geometry(there)[1].reshape(-1, 3)[:, 1:].copy()
            force = self._modes.look(there, u, p)[0].reshape(-1, 3)[:, 1:]
            work -= weight * h / 6.0 * float(np.sum(force * speed))
        return work

    def is_off(self, x: Array, p: Array) -> bool:
        """Whether a closed contact is not quite closed, or does not quite rest."""
        place, speed, size = self._modes.geometry(x)
        limit = self._modes.calm(x) / 10.0
        for k, (closed, sticks, *_) in enumerate(self._modes.modes(p)):
            moves = abs(speed[3 * k : 3 * k + 3]) * [closed, sticks, sticks]
            if closed and (abs(place[3 * k]) > GAP_ROUNDING * size[k] or moves.max() > limit):
                return True
        return False

    def closed(self, x: Array, p: Array, anchor: Array) -> Array:
        """Bring positions and velocities back to the closed contacts.

        Args:
            x: State.
            p: Parameters with the modes.
            anchor: Where each point sticks in its plane's tangents in [m], shape (2 nc,).
        """
        if (self._modes.modes(p)[:, 0] == 0.0).all():
            return x
        x, whole = x.copy(), 2 * self._n
        for _ in range(2):
            x[:whole] = self._close(x[:whole], p, anchor)[0]
        return x

    def is_held(self, x: Array, u: Array, p: Array) -> bool:
        """Whether the contacts leave no joint any motion."""
        if abs(self._modes.velocity(x)).max() > HELD:
            return False
        modes, direction = self._modes.modes(p), self._modes.directions(p)
        held = modes[:, 0] * modes[:, 1]
        rows = np.column_stack([modes[:, 0], held, held]).ravel()
        free = self._n - int(np.sum(direction == 0.0))
        return rank(self._modes.inertia(x, u, p)[0] * np.outer(rows, rows)) == free

    def rest(self, x: Array, p: Array) -> Array | None:
        """Put joints that have just reached zero speed at rest; see ``DryStepper``."""
        direction = self._modes.directions(p)
        if not len(direction):
            return x
        v = self._modes.velocity(x)
        stopped = self._sticky & (v * direction <= 0.0)
        if np.any(abs(v[stopped]) > SUDDEN_STOP * (1.0 + abs(v).max())):
            return None
        v[stopped] = 0.0
        return x

    def _dip(self, x: Array, u: Array, p: Array, ground: Array, length: float) -> float | None:
        """A time before ``length`` at which a contact is below its plane, on its way up again."""
        before = self._modes.geometry(x)[1][::3].copy()
        after = self._flow.tried(x, u, p, length)
        if after is None:
            return None
        back = self._modes.geometry(after)[1][::3].copy()
        apart = self._modes.modes(p)[:, 0] == 0.0
        for k in np.flatnonzero(apart & (before < 0.0) & (back > 0.0)):

            def rises(t: float, k: int = int(k)) -> float:
                there = self._flow.tried(x, u, p, t)
                return np.inf if there is None else float(self._modes.geometry(there)[1][3 * k])

            turn = first_positive(rises, length)
            lowest = self._flow.tried(x, u, p, turn)
            if lowest is not None and self._wrong(lowest, u, p, ground, turn) > 0.0:
                return turn
        return None

    def _wrong(self, x: Array, u: Array, p: Array, ground: Array, t: float) -> float:
        """Positive if a contact or joint does not obey its mode after a motion of ``t``."""
        place, speed, size = (value.copy() for value in self._modes.geometry(x))
        force, _, load, _ = self._modes.look(x, u, p)
        v, mu = self._modes.velocity(x), self._modes.mu
        rounding = ROUNDING * (1.0 + float(abs(v).max()))
        worst = -np.inf
        for k, (closed, sticks, d0, d1, _) in enumerate(self._modes.modes(p)):
            r, s = force[3 * k : 3 * k + 3], speed[3 * k + 1 : 3 * k + 3]
            if not closed:
                below = ground[k] - place[3 * k] - SINKING * t - GAP_ROUNDING * size[k]
                worst = max(worst, float(below))
                continue
            worst = max(worst, -float(r[0]))
            if sticks:
                worst = max(worst, float(np.hypot(r[1], r[2])) - mu[k] * float(r[0]))
            elif mu[k] > 0.0:
                worst = max(worst, -float(d0 * s[0] + d1 * s[1]) - rounding)
        return max(worst, self._wrong_joint(v, load, p, rounding))

    def _wrong_joint(self, v: Array, load: Array, p: Array, rounding: float) -> float:
        direction, worst = self._modes.directions(p), -np.inf
        for i in np.flatnonzero(self._sticky):
            if direction[i] != 0.0:
                worst = max(worst, -float(v[i] * direction[i]) - rounding)
            else:
                worst = max(worst, float(abs(load[i]) - self._modes.static[i]))
        return worst


def rank(W: Array) -> int:
    """Rank of a symmetric matrix that is not negative, by elimination with diagonal pivots."""
    W, count, limit = W.copy(), 0, INDEPENDENT * float(np.trace(W))
    for _ in range(len(W)):
        k = int(np.argmax(np.diag(W)))
        if not W[k, k] > limit:
            break
        W = W - np.outer(W[:, k], W[k]) / W[k, k]
        count += 1
    return count
