# SPDX-License-Identifier: Apache-2.0
"""The next mode, and velocities after an impact: by trying all possibilities."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import product

import numpy as np
from scipy.optimize import brentq

from .rows import Touch
from .system import APART, SLIDES, STICKS, Instant, Mode, System, solve

Array = np.ndarray
Way = Array | str | None
"""Of an impulse: the point slides that way, "sticks" or "slides" without friction; or none."""
REST = 1e-9  # [rad/s, m/s] below which a speed is none
CLOSED = 1e-10  # [m, rad] below which a gap is none
SLACK = 1e-8  # of torques and accelerations that decide
NEAREST = 1e-4  # that the nearest mode may be off where none obeys: at a level, just let go
LAST_HOP = 1e-13  # [m] below which a point does not rebound


def candidates(system: System, y: Array, now: Instant) -> Iterator[Mode]:
    """All modes that suit the velocities."""
    v = system.split(y)[1]
    dry = [
        (int(np.sign(v[d.joint])),) if abs(v[d.joint]) > REST else (0, 1, -1) for d in system.dry
    ]
    ways: list[list[tuple[int, Array | None]]] = []
    for touch in now.touches:
        if touch.gap > CLOSED or abs(touch.N @ v) > REST:  # a hop about to end is none yet
            ways.append([(APART, None)])
            continue
        s = touch.T @ v
        closed: list[tuple[int, Array | None]]
        if not len(s):
            closed = [(SLIDES, None)]
        elif np.linalg.norm(s) > REST:
            closed = [(SLIDES, np.sign(s) if len(s) == 1 else None)]
        elif len(s) == 1:
            closed = [(STICKS, None), (SLIDES, np.ones(1)), (SLIDES, -np.ones(1))]
        else:
            closed = [(STICKS, None), (SLIDES, np.zeros(2))]  # direction to be found
        ways.append([*closed, (APART, None)])
    for chosen in product(product(*dry), product(*ways)):
        yield Mode(chosen[0], tuple(w for w, _ in chosen[1]), tuple(d for _, d in chosen[1]))


def decide(system: System, y: Array, signs: Array, without: Mode | None = None) -> Mode:
    """The mode in which everything obeys; not the one that has just ended."""
    now = system.look(y, signs)
    best, found = -np.inf, None
    for mode in candidates(system, y, now):
        for exact in directed(system, y, signs, mode, now):
            if without is not None and exact.key == without.key:
                continue
            worst = obeys(system, y, signs, exact, now)
            if worst > -SLACK:
                return exact
            if worst > best:
                best, found = worst, exact
    if found is not None and best > -NEAREST:
        return found
    raise RuntimeError(f"no mode obeys; nearest {found}, off by {-best:.3g}")


def directed(system: System, y: Array, signs: Array, mode: Mode, now: Instant) -> Iterable[Mode]:
    """The mode itself, or with the directions in which a contact can begin to slide."""
    k = next((k for k, w in enumerate(mode.ways) if w is not None and len(w) == 2), None)
    if k is None:
        return [mode]

    def turned(turn: float) -> Mode:
        way = np.array([np.cos(turn), np.sin(turn)])
        return mode._replace(ways=(*mode.ways[:k], way, *mode.ways[k + 1 :]))

    def across(turn: float) -> float:
        slide = system.answer(y, signs, turned(turn), now).slide[k]
        return float(np.cos(turn) * slide[1] - np.sin(turn) * slide[0])

    return [turned(root) for root in roots(across)]


def roots(of: Callable[[float], float]) -> list[float]:
    """Zeros of a function of an angle."""
    turns = np.linspace(0.0, 2 * np.pi, 73)
    values = [of(t) for t in turns]
    pairs = zip(turns, turns[1:], values, values[1:], strict=False)
    return [brentq(of, a, b, xtol=1e-14) for a, b, x, z in pairs if x == 0.0 or x * z < 0.0]


def obeys(system: System, y: Array, signs: Array, mode: Mode, now: Instant) -> float:
    """The least of all that must not be negative."""
    answer = system.answer(y, signs, mode, now)
    if not np.isfinite(answer.a).all():
        return -np.inf
    v = system.split(y)[1]
    least = [0.0, *answer.slack.values()]
    for dry, way in zip(system.dry, mode.dry, strict=True):
        if way and abs(v[dry.joint]) <= REST:
            least.append(way * answer.a[dry.joint])
    for touch, how, way, opening, slide in zip(
        now.touches, mode.touch, mode.ways, answer.opening, answer.slide, strict=True
    ):
        if how == APART and touch.gap <= CLOSED and abs(touch.N @ v) <= REST:
            least.append(opening)
        if how == SLIDES and way is not None and np.linalg.norm(touch.T @ v) <= REST:
            least.append(float(way @ slide))
    return float(min(least))


def impact(system: System, y: Array, now: Instant) -> Array:
    """Velocities after a blow: Newton's rebound, Coulomb's friction with the speed after.

    Friction in the joints has no part in it: its torques are finite.
    """
    v = system.split(y)[1]
    hit = [k for k, t in enumerate(now.touches) if t.gap <= CLOSED and t.N @ v < REST]
    share = 1.0
    before = v @ now.M @ v
    after = _blow(system, v, now, hit, share)
    low, high = 0.0, 1.0
    if after @ now.M @ after > before * (1.0 + 1e-12):  # the highest rebound that takes no energy
        while high - low > 1e-14:
            share = 0.5 * (low + high)
            after = _blow(system, v, now, hit, share)
            low, high = (low, share) if after @ now.M @ after > before else (share, high)
        after = _blow(system, v, now, hit, low)
    return after


def _blow(system: System, v: Array, now: Instant, hit: list[int], share: float) -> Array:
    aims, free = [], np.linalg.solve(now.M, now.push)
    for k in hit:
        touch = now.touches[k]
        rebound = -share * system.touching[k].restitution * float(touch.N @ v)
        back = abs(float(touch.N @ free) + touch.bend)
        aims.append(rebound if rebound**2 > 2.0 * back * LAST_HOP else 0.0)
    choices = [_ways(now.touches[k], system.touching[k].mu) for k in hit]
    for chosen in product(*choices):
        for ways in _directed_blows(system, v, now, hit, aims, chosen):
            after, forces = _push(system, v, now, hit, aims, ways)
            if _is_lawful(system, now, hit, aims, ways, after, forces):
                return after
    raise RuntimeError("no impulse obeys")


def _ways(touch: Touch, mu: float) -> list[Way]:
    """All that an impulse may do to one point."""
    if not len(touch.T):
        return ["slides", None]
    slides = [np.ones(1), -np.ones(1)] if len(touch.T) == 1 else [np.zeros(2)]
    return ["sticks", *slides, None]


def _directed_blows(
    system: System, v: Array, now: Instant, hit: list[int], aims: list[float],
    chosen: Sequence[Way],
) -> Iterable[Sequence[Way]]:  # fmt: skip
    """Impulses with the directions in which a point of a plane can slide after the blow."""
    k = next((k for k, w in enumerate(chosen) if isinstance(w, np.ndarray) and len(w) == 2), None)
    if k is None:
        return [chosen]

    def turned(turn: float) -> Sequence[Way]:
        return (*chosen[:k], np.array([np.cos(turn), np.sin(turn)]), *chosen[k + 1 :])

    def across(turn: float) -> float:
        after = _push(system, v, now, hit, aims, turned(turn))[0]
        s = now.touches[hit[k]].T @ after
        return float(np.cos(turn) * s[1] - np.sin(turn) * s[0])

    return [turned(root) for root in roots(across)]


def _push(
    system: System, v: Array, now: Instant, hit: list[int], aims: list[float], ways: Sequence[Way]
) -> tuple[Array, list[Array]]:
    """Velocities after the impulses that bring about what ``ways`` and ``aims`` say."""
    A = now.loops[1]
    G, C, b, mine = [A], [A], [np.zeros(len(A))], []
    count = len(A)
    for k, aim, way in zip(hit, aims, ways, strict=True):
        touch = now.touches[k]
        if way is None:
            mine.append(np.zeros(0, dtype=int))
            continue
        column = touch.N
        if isinstance(way, np.ndarray):
            column = touch.N - system.touching[k].mu * way @ touch.T
        rows, columns, rhs = touch.N[None], column[None], [aim]
        if isinstance(way, str) and way == "sticks":
            rows, columns = np.vstack([rows, touch.T]), np.vstack([columns, touch.T])
            rhs = [aim, *np.zeros(len(touch.T))]
        G, C, b = [*G, rows], [*C, columns], [*b, np.array(rhs)]
        mine.append(np.arange(count, count + len(rows)))
        count += len(rows)
    after, f, _ = solve(now.M, now.M @ v, np.vstack(G), np.vstack(C), np.concatenate(b))
    return after, [f[own] for own in mine]


def _is_lawful(
    system: System, now: Instant, hit: list[int], aims: list[float], ways: Sequence[Way],
    after: Array, forces: list[Array],
) -> bool:  # fmt: skip
    """Whether impulses push, keep to their cones and rub against the motion."""
    for k, aim, way, f in zip(hit, aims, ways, forces, strict=True):
        touch, one = now.touches[k], system.touching[k]
        if way is None:
            if touch.N @ after < aim - 1e-12:
                return False
            continue
        if not np.isfinite(f).all() or f[0] < -1e-12:
            return False
        if isinstance(way, np.ndarray) and way @ (touch.T @ after) < -1e-12:
            return False
        if (
            isinstance(way, str)
            and way == "sticks"
            and np.linalg.norm(f[1:]) > one.mu * f[0] + 1e-14
        ):
            return False
    return True
