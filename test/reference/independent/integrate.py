# SPDX-License-Identifier: Apache-2.0
"""From event to event with SciPy's DOP853."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from .modes import CLOSED, REST, decide, impact
from .system import APART, SLIDES, STICKS, Mode, System, solve

Array = np.ndarray
RTOL, ATOL = 1e-12, 1e-13
LOOKS = np.linspace(0.0, 1.0, 5)[1:]  # parts of a step at which events are looked for
MOST_EVENTS = 5000


@dataclass
class Motion:
    """What a simulation leaves."""

    names: list[str]  # of the independent joints, in the order of the columns
    time: Array  # shape (k,)
    q: Array  # positions, shape (k, n)
    v: Array  # velocities, shape (k, n)
    z: Array  # states of the laws, shape (k, nz), in an order of its own
    energy: Array  # kinetic, potential and stored, shape (k,)
    supplied: Array  # shape (k,)
    lost: Array  # shape (k,)
    # What happened: time, kind, and who
    log: list[tuple[float, str, int]] = field(default_factory=list)

    @property
    def balance(self) -> Array:
        """Energy from nowhere, [J]."""
        return self.energy - self.energy[0] - self.supplied + self.lost


def simulate(
    scene: Mapping[str, Any],
    command: Mapping[str, float] | Array,
    times: Array,
    payloads: list[dict[str, Any]] | None = None,
    most_looks: float = np.inf,
) -> Motion:
    """The motion of a scene under a command that is constant, or so between two times."""
    given = dict(scene) | ({"payloads": payloads} if payloads is not None else {})
    with np.errstate(over="ignore", invalid="ignore"):  # of steps that SciPy tries and rejects
        at = np.asarray(times, dtype=float)
        if isinstance(command, Mapping):
            return _Run(System(given, command), at, at[[0, -1]], most_looks).motion()
        return _Run(System(given, {}), at, at, most_looks, np.asarray(command)).motion()


class _Run:
    def __init__(
        self, system: System, times: Array, held: Array, most_looks: float,
        commands: Array | None = None,
    ) -> None:  # fmt: skip
        self.system, self.times, self.held, self.looks_left = system, times, held, most_looks
        self.commands = system.u[None] if commands is None else commands
        self.log: list[tuple[float, str, int]] = []
        self.found = np.full((len(times), len(system.start())), np.nan)

    def motion(self) -> Motion:
        s, t, y = self.system, 0.0, self._closed(self.system.start())
        self.found[0], s.u = y, self.commands[0]
        signs = self._signs(y, None)
        y = self._after_impact(t, y, signs)
        mode = decide(s, y, signs)
        self._note(t, None, mode)
        ends = iter(self.held[1:])
        commands, end = iter(self.commands[1:]), next(ends)
        while True:
            t, y, cause = self._segment(t, end, y, mode, signs)
            if cause is None:
                if t >= self.times[-1]:
                    break
                s.u, end = next(commands), next(ends)
                signs = self._signs(y, None)
                before, mode = mode, decide(s, y, signs)
                self._note(t, before, mode)
                continue
            if len(self.log) > MOST_EVENTS:
                raise RuntimeError(f"too many events until {t}: {self.log[-8:]}")
            kind, k = cause
            y = self._snapped(y, mode, signs, cause)
            if kind == "kink":
                signs = signs.copy()
                signs[k] = -signs[k]
                self.log.append((t, "kink", k))
                continue
            before = mode
            if kind == "gap":
                y = self._after_impact(t, y, signs)
            signs = self._signs(y, signs)
            mode = decide(s, y, signs, None if kind in ("gap", "begun") else before)
            self._note(t, before, mode)
        q, v, z = (np.array(part) for part in zip(*map(s.split, self.found), strict=True))
        stored = [s.look(y, self._signs(y, None)).stored for y in self.found]
        energy = np.array([s.tree.energy(a, b) for a, b in zip(q, v, strict=True)]) + stored
        return Motion(
            s.names, self.times, q, v, z, energy, self.found[:, -2], self.found[:, -1],
            self.log,
        )  # fmt: skip

    def _closed(self, y: Array) -> Array:
        """The start with its loops closed, the nearest way in the metric of M."""
        s, made = self.system, y.copy()
        signs = np.ones(len(s.kinks(y)))
        for _ in range(20 if s.loops else 0):
            now = s.look(made, signs)
            if abs(now.loops[0]).max() < 1e-16:
                break
            A = now.loops[1]
            made[: s.n] += solve(now.M, np.zeros(s.n), A, A, -now.loops[0])[0]
        again = s.at_rest(made[: s.n], s.v0)
        if s.loops:
            A = s.look(again, signs).loops[1]
            v = solve(now.M, now.M @ s.v0, A, A, np.zeros(len(A)))[0]
            again = s.at_rest(again[: s.n], v)
        return again

    def _segment(
        self, t: float, end: float, y: Array, mode: Mode, signs: Array
    ) -> tuple[float, Array, tuple[str, int] | None]:
        """Up to the next event: when, the state, and what it is."""
        rate = self._rate(mode, signs)
        watch = self._watch(mode, signs)
        hop = self._hop(t, y, mode, signs)
        solver = DOP853(
            rate, t, y, end, rtol=RTOL, atol=ATOL, max_step=0.02,
            first_step=min(hop, end - t) if hop else None,
        )  # fmt: skip
        before = watch(t, y)
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":
                raise RuntimeError(f"SciPy gives up at {solver.t}")
            sol, a, b = solver.dense_output(), solver.t_old, solver.t
            event = self._first(watch, sol, a, b, before, t)
            if event is not None:
                at, cause = event
                y_at = self._land(rate, a, sol(a) if a == t else self._old, at)
                self._fill(sol, a, at)
                return at, y_at, cause
            self._fill(sol, a, b)
            self._old = solver.y.copy()
            before = watch(b, solver.y)
        return end, solver.y, None

    def _first(
        self, watch: Callable[[float, Array], dict], sol: Callable[[float], Array],
        a: float, b: float, before: dict, begin: float,
    ) -> tuple[float, tuple[str, int]] | None:  # fmt: skip
        """The earliest event in a step, located on the polynomial through it."""
        last, at = before, a
        for part in LOOKS:
            t = a + part * (b - a)
            here = watch(t, sol(t))
            gone = [who for who, value in here.items() if value < -1e-14]
            roots = []
            for who in gone:
                if at == begin and last[who] < 1e-11:
                    roots.append((self._late(watch, sol, at, t, who), who))
                elif last[who] <= 0.0:
                    roots.append((at, who))
                else:

                    def value(x: float, who: tuple[str, int] = who) -> float:
                        return watch(x, sol(x))[who]

                    roots.append((brentq(value, at, t, xtol=1e-15, rtol=1e-15), who))
            if roots:
                return min(roots, key=lambda root: root[0])
            last, at = here, t
        return None

    def _late(
        self, watch: Callable[[float, Array], dict], sol: Callable[[float], Array],
        a: float, b: float, who: tuple[str, int],
    ) -> float:  # fmt: skip
        """A root of something that begins at zero: after its last positive value."""
        x = b
        for _ in range(60):
            x = a + 0.5 * (x - a)
            if watch(x, sol(x))[who] > 0.0:
                return brentq(lambda s: watch(s, sol(s))[who], x, b, xtol=1e-15, rtol=1e-15)
        return a

    def _land(self, rate: Callable, a: float, y: Array, at: float) -> Array:
        """The state at an instant within a step, by an integration of its own."""
        if at <= a:
            return y
        solver = DOP853(rate, a, y, at, rtol=RTOL, atol=ATOL)
        while solver.status == "running":
            solver.step()
        return solver.y

    def _fill(self, sol: Callable[[float], Array], a: float, b: float) -> None:
        for k in np.flatnonzero((self.times > a) & (self.times <= b)):
            self.found[k] = sol(self.times[k])

    def _rate(self, mode: Mode, signs: Array) -> Callable[[float, Array], Array]:
        s = self.system

        def rate(_: float, y: Array) -> Array:
            self._spend()
            try:
                now = s.look(y, signs)
                answer = s.answer(y, signs, mode, now)
            except (OverflowError, ValueError, np.linalg.LinAlgError):
                return np.full_like(y, np.nan)  # a step that is too long by far: SciPy halves it
            v = s.split(y)[1]
            heat = now.lost + answer.rubbing
            for dry, way, size in zip(s.dry, mode.dry, answer.friction, strict=True):
                heat += way * size * v[dry.joint]
            return np.concatenate([v, answer.a, now.slopes, [now.supplied, heat]])

        return rate

    def _watch(self, mode: Mode, signs: Array) -> Callable[[float, Array], dict]:
        """All that must not become negative in a mode."""
        s = self.system

        def watch(_: float, y: Array) -> dict[tuple[str, int], float]:
            self._spend()
            v = s.split(y)[1]
            now = s.look(y, signs)
            answer = s.answer(y, signs, mode, now)
            values = dict(answer.slack)
            for k, (dry, way) in enumerate(zip(s.dry, mode.dry, strict=True)):
                if way:
                    values["speed", k] = way * v[dry.joint]
            for k, (touch, how) in enumerate(zip(now.touches, mode.touch, strict=True)):
                if how == APART:
                    values["gap", k] = touch.gap
                if how == SLIDES and len(touch.T):
                    slide, way = touch.T @ v, mode.ways[k]
                    if len(slide) == 1:
                        values["slide", k] = float(way @ slide)
                    elif way is None:
                        values["slide", k] = float(np.linalg.norm(slide)) - 0.5 * REST
                    else:
                        values["begun", k] = 1e-4 - float(np.linalg.norm(slide))
            kinks = signs * s.kinks(y)
            return values | {("kink", k): float(x) for k, x in enumerate(kinks)}

        return watch

    def _spend(self) -> None:
        self.looks_left -= 1
        if self.looks_left < 0:
            raise RuntimeError("it takes too long")

    def _hop(self, t: float, y: Array, mode: Mode, signs: Array) -> float | None:
        """A first step short enough to see a point off the plane that it has just left."""
        s, v = self.system, self.system.split(y)[1]
        now = s.look(y, signs)
        answer = s.answer(y, signs, mode, now)
        hops = [
            (touch.N @ v) / -opening
            for touch, how, opening in zip(now.touches, mode.touch, answer.opening, strict=True)
            if how == APART and abs(touch.gap) < 1e-9 and opening < 0.0 and touch.N @ v > 0.0
        ]
        return min(hops) if hops else None

    def _signs(self, y: Array, old: Array | None) -> Array:
        """Signs of what the laws take absolute values of; at zero, those a moment later."""
        s, values = self.system, self.system.kinks(y)
        signs = np.sign(values)
        if old is not None:
            return np.where(abs(values) > 1e-12, signs, old)
        if len(signs) and not signs.all():
            ahead = y.copy()
            guess = np.where(signs == 0.0, 1.0, signs)
            mode = decide(s, y, guess)
            for _ in range(4):
                ahead = ahead + 1e-7 * self._rate(mode, guess)(0.0, ahead)
            later = np.sign(s.kinks(ahead))
            signs = np.where(signs == 0.0, np.where(later == 0.0, 1.0, later), signs)
        return signs

    def _after_impact(self, t: float, y: Array, signs: Array) -> Array:
        """The state after a blow, if there is one; what it takes counts as heat."""
        s = self.system
        v = s.split(y)[1]
        now = s.look(y, signs)
        hits = [k for k, x in enumerate(now.touches) if x.gap <= CLOSED and x.N @ v < -REST]
        if not hits:
            return y
        after, made = impact(s, y, now), y.copy()
        made[s.n : 2 * s.n] = after
        made[-1] += 0.5 * float(v @ now.M @ v - after @ now.M @ after)
        self.log += [(t, s.touching[k].words[0], k) for k in hits]
        return made

    def _snapped(self, y: Array, mode: Mode, signs: Array, cause: tuple[str, int]) -> Array:
        """The state with what is closed closed, and what has stopped at rest, exactly."""
        s, made = self.system, y.copy()
        kind, k = cause

        def rows(now: Any) -> tuple[list[Array], list[float], list[Array]]:
            values, A = list(now.loops[0]), list(now.loops[1])
            still = [
                np.eye(s.n)[d.joint] for d, way in zip(s.dry, mode.dry, strict=True) if not way
            ]
            if kind == "speed":
                still.append(np.eye(s.n)[s.dry[k].joint])
            for j, (touch, how) in enumerate(zip(now.touches, mode.touch, strict=True)):
                if how != APART or (kind, k) == ("gap", j):
                    values.append(touch.gap)
                    A.append(touch.N)
                    if how != APART:
                        still.append(touch.N)
                if how == STICKS or (kind, k) == ("slide", j):
                    still += list(touch.T)
            return A, values, still

        for _ in range(2):
            now = s.look(made, signs)
            A, values, _ = rows(now)
            if A:
                zero = np.zeros(s.n)
                step = solve(now.M, zero, np.array(A), np.array(A), -np.array(values))[0]
                made[: s.n] += step
        now = s.look(made, signs)
        still = [*now.loops[1], *rows(now)[2]]
        if still:
            v, B = made[s.n : 2 * s.n], np.array(still)
            made[s.n : 2 * s.n] = solve(now.M, now.M @ v, B, B, np.zeros(len(B)))[0]
            if kind == "speed":
                made[s.n + s.dry[k].joint] = 0.0
        return made

    def _note(self, t: float, before: Mode | None, mode: Mode) -> None:
        """Log what has changed."""
        olds = before.dry if before else (None,) * len(mode.dry)
        for k, (old, new) in enumerate(zip(olds, mode.dry, strict=True)):
            if old != new:
                self.log.append((t, "slides" if new else "sticks", self.system.dry[k].joint))
        olds = before.touch if before else (None,) * len(mode.touch)
        for k, (old, new) in enumerate(zip(olds, mode.touch, strict=True)):
            if old != new:
                self.log.append((t, self.system.touching[k].words[1 + new], k))
