# SPDX-License-Identifier: Apache-2.0
"""The whole arm: rates of its state while the modes of joints and contacts do not change."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linprog

from .bristles import Bristles
from .description import joint as settings_of
from .description import mimics, only
from .drives import drive, rotor_at_joint
from .dry import Dry
from .flow import Law
from .rows import Contact, Rod, Stop, Touch, stops
from .springs import JointSpring, PointSpring, soft_stops
from .tree import Tree

Array = np.ndarray
APART, STICKS, SLIDES = 0, 1, 2
RANK = 1e-9  # singular values below this part of the largest are rows that others imply


class Mode(NamedTuple):
    """Who holds."""

    dry: tuple[int, ...]  # for each joint with dry friction -1, 0 or 1: slides that way, or sticks
    touch: tuple[int, ...]  # for each contact and stop APART, STICKS or SLIDES
    # Direction in which each begins to slide, or slides if there is only one line; None where the
    # velocity says it
    ways: tuple[Array | None, ...]

    @property
    def key(self) -> tuple[Any, ...]:
        """What distinguishes modes."""
        lines = (None if w is None or len(w) > 1 else float(w[0]) for w in self.ways)
        return self.dry, self.touch, *lines


class Instant(NamedTuple):
    """The arm at an instant, before it is said who holds."""

    M: Array  # inertia, shape (n, n)
    push: Array  # torques that follow from the state alone, shape (n,)
    loads: Array  # torque of the drive of each joint, shape (n,)
    slopes: Array  # rates of the laws' states
    stored: float  # energy of laws and springs [J]
    supplied: float  # power that comes in [W]
    lost: float  # power that laws, springs and viscous friction take [W]
    loops: tuple[Array, Array, Array]  # φ, A and bend of the bilateral rows
    touches: tuple[Touch, ...]  # of each contact and stop


class Answer(NamedTuple):
    """What happens in a mode."""

    a: Array  # accelerations, shape (n,)
    friction: tuple[float, ...]  # of each joint with dry friction that slides, against its motion
    # How far each sticking joint, contact and stop is from letting go, by name; negative where it
    # should have. With forces that rigid bodies leave open, of the best ones.
    slack: dict[tuple[str, int], float]
    opening: tuple[float, ...]  # acceleration of the gaps of contacts and stops that are apart
    slide: tuple[Array, ...]  # acceleration along the plane of each contact and stop
    rubbing: float  # power that sliding contacts take [W]


class System:
    """A scene with its command."""

    def __init__(self, scene: Mapping[str, Any], command: Mapping[str, float]) -> None:
        only(scene, "scene", "robot", "gravity", "joints", "payloads", "constraints", "initial",
             "tunable", "sim", "springs")  # fmt: skip
        names = Tree(scene, {}).joint_names
        said = {name: settings_of(scene, name) for name in names}
        self._check_followers(scene)
        for name, own in said.items():
            only(own, name, "friction", "armature", "actuator", "transmission", "limits", "spring")
        rotors = {k: s.get("armature", 0.0) + rotor_at_joint(s) for k, s in said.items()}
        self.tree = Tree(scene, rotors)
        self.names, self.n = names, len(names)
        self.u = np.array([command.get(name, 0.0) for name in names])
        self.viscous = np.array([s["friction"]["viscous"] for s in said.values()])
        self.laws: list[Law] = [drive(i, s) for i, s in enumerate(said.values())]
        self.dry: list[Dry] = []
        limits: list[Stop] = []
        for i, own in enumerate(said.values()):
            efficiency = own.get("actuator", {}).get("efficiency", 1.0)
            dry = Dry(i, own["friction"], efficiency)
            self.dry += [dry] if dry.exists else []
            self.laws += [Bristles(i, own["friction"])] if "lugre" in own["friction"] else []
            self.laws += [JointSpring(i, own["spring"])] if own.get("spring") else []
            self.laws += soft_stops(i, own.get("limits", {}))
            limits += stops(i, self.n, own.get("limits", {}))
        self.springs = [PointSpring(self.tree, one) for one in scene.get("springs", ())]
        given = scene.get("initial", {})
        self.q0 = self._of(given.get("position", {}))
        self.v0 = self._of(given.get("velocity", {}))
        ties = scene.get("constraints", ())
        only(dict.fromkeys(c["type"] for c in ties), "constraints", "contact", "distance")
        self.loops = [Rod(self.tree, c) for c in ties if c["type"] == "distance"]
        touching = [Contact(self.tree, c, self.q0) for c in ties if c["type"] == "contact"]
        self.touching: list[Contact | Stop] = [*touching, *limits]
        ends = np.cumsum([0, *(law.size for law in self.laws)])
        self._slices = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
        self.nz = int(ends[-1])
        self._counts = [len(law.kinks(0.0, 0.0, np.zeros(law.size))) for law in self.laws]

    def _of(self, said: Mapping[str, float]) -> Array:
        return np.array([said.get(name, 0.0) for name in self.names])

    def _check_followers(self, scene: Mapping[str, Any]) -> None:
        for name in mimics(scene["robot"]["urdf"]):
            own = settings_of(scene, name)
            stops = own.pop("limits").get("stop", True) is not False
            if stops or any(own["friction"].values()) or set(own) - {"friction"}:
                raise NotImplementedError(f"a follower without laws and stops is expected: {name}")

    def start(self) -> Array:
        """State q, v, z, work, heat at the beginning."""
        return self.at_rest(self.q0, self.v0)

    def at_rest(self, q: Array, v: Array) -> Array:
        """The state of an arm that is put to q, v: no current, nothing twisted."""
        pairs = [law.initial(q[law.joint], v[law.joint]) for law in self.laws]
        return np.concatenate([q, v, *(np.array(p) for p in pairs), [0.0, 0.0]])

    def split(self, y: Array) -> tuple[Array, Array, Array]:
        """q, v and z."""
        return y[: self.n], y[self.n : 2 * self.n], y[2 * self.n : 2 * self.n + self.nz]

    def kinks(self, y: Array) -> Array:
        """Values whose signs the laws hold fixed between events; gears' loads are the last."""
        q, v, z = self.split(y)
        found = []
        for law, part in zip(self.laws, self._slices, strict=True):
            found += law.kinks(q[law.joint], v[law.joint], z[part])
        if any(spring.cord for spring in self.springs):
            self.tree.move(q, v)
        for spring in self.springs:
            found += spring.kinks(v)
        geared = [dry.joint for dry in self.dry if dry.geared]
        if geared:
            loads = self._flows(y, np.ones(len(found)))[1]
            found += [loads[i] for i in geared]
        return np.array(found, dtype=float)

    def _flows(self, y: Array, signs: Array) -> tuple[Array, Array, list[float], Array]:
        """Torques, drives' torques, rates of z; stored, supplied and lost."""
        q, v, z = self.split(y)
        push, loads, slopes, sums, at = np.zeros(self.n), np.zeros(self.n), [], np.zeros(3), 0
        for k, (law, part) in enumerate(zip(self.laws, self._slices, strict=True)):
            i, own = law.joint, z[part]
            count = self._counts[k]
            flow = law.flow(q[i], v[i], own, self.u[i], signs[at : at + count])
            at += count
            push[i] += flow.torque
            if k < self.n:  # drives come first, one for each joint
                loads[i] = flow.torque
            slopes += flow.slope
            sums += flow.stored, flow.supplied, flow.lost
        return push, loads, slopes, sums

    def look(self, y: Array, signs: Array) -> Instant:
        """Everything that does not depend on the mode."""
        q, v, _ = self.split(y)
        push, loads, slopes, (stored, supplied, lost) = self._flows(y, signs)
        push = push - self.tree.bias(q, v) - self.viscous * v
        lost = lost + float(self.viscous @ v**2)
        if self.springs or self.touching or self.loops:
            self.tree.move(q, v)
        at = sum(self._counts)
        for spring in self.springs:
            torque, energy, heat = spring.act(v, signs[at:])
            at += 2 * spring.cord if spring.d else spring.cord
            push, stored, lost = push + torque, stored + energy, lost + heat
        rows = [loop.at(q, v) for loop in self.loops]
        loops = (
            np.array([row.value for row in rows]),
            np.array([row.A for row in rows]).reshape(-1, self.n),
            np.array([row.bend for row in rows]),
        )
        touches = tuple(one.at(q, v) for one in self.touching)
        made = np.array(slopes, dtype=float)
        M = self.tree.mass(q)
        return Instant(M, push, loads, made, stored, supplied, lost, loops, touches)

    def way(self, touch: Touch, v: Array, begin: Array | None) -> Array:
        """Direction of sliding: that of the velocity, or of its beginning."""
        if begin is not None and len(begin) == 1:
            return begin
        s = touch.T @ v
        if begin is not None:
            s = s + 1e-9 * begin
        size = np.linalg.norm(s)
        return s / size if size else s

    def answer(self, y: Array, signs: Array, mode: Mode, now: Instant) -> Answer:
        """Accelerations and what is left of what holds, in a mode."""
        q, v, _ = self.split(y)
        gears = iter(signs[len(signs) - sum(d.geared for d in self.dry) :])
        push, friction = now.push.copy(), []
        G, C, b = [now.loops[1]], [now.loops[1]], [-now.loops[2]]
        held: list[tuple[str, int, Array]] = []  # who, and which of the forces are his
        count = len(now.loops[0])
        levels: dict[int, tuple[float, float]] = {}
        for k, (dry, way) in enumerate(zip(self.dry, mode.dry, strict=True)):
            i = dry.joint
            load, sign = now.loads[i], next(gears) if dry.geared else 1.0
            size = dry.sliding(way, q[i], v[i], load, sign) if way else 0.0
            friction.append(size)
            push[i] -= way * size
            if not way:
                row = np.eye(self.n)[i : i + 1]
                G, C, b = [*G, row], [*C, row], [*b, np.zeros(1)]
                levels[k] = dry.level(1, q[i], load, sign), dry.level(-1, q[i], load, sign)
                held.append(("dry", k, np.array([count])))
                count += 1
        directions: dict[int, Array] = {}
        for k, (touch, how) in enumerate(zip(now.touches, mode.touch, strict=True)):
            if how == APART:
                continue
            column = touch.N
            if how == SLIDES and len(touch.T):
                directions[k] = self.way(touch, v, mode.ways[k])
                column = touch.N - self.touching[k].mu * directions[k] @ touch.T
            rows, columns, rhs = touch.N[None], column[None], np.array([-touch.bend])
            if how == STICKS:
                rows, columns = np.vstack([rows, touch.T]), np.vstack([columns, touch.T])
                rhs = np.concatenate([rhs, -touch.slide_bend])
            G, C, b = [*G, rows], [*C, columns], [*b, rhs]
            held.append(("touch", k, np.arange(count, count + len(rows))))
            count += len(rows)
        a, f, open_ways = solve(now.M, push, np.vstack(G), np.vstack(C), np.concatenate(b))
        slack = self._slack(held, levels, mode, f, open_ways)
        opening = tuple(
            float(t.N @ a + t.bend) if how == APART else 0.0
            for t, how in zip(now.touches, mode.touch, strict=True)
        )
        slide = tuple(t.T @ a + t.slide_bend for t in now.touches)
        rubbing = 0.0
        for who, k, mine in held:
            if who == "touch" and k in directions:
                speed = float(directions[k] @ (now.touches[k].T @ v))
                rubbing += self.touching[k].mu * float(f[mine[0]]) * speed
        return Answer(a, tuple(friction), slack, opening, slide, rubbing)

    def _slack(
        self, held: list[tuple[str, int, Array]], levels: dict[int, tuple[float, float]],
        mode: Mode, f: Array, open_ways: Array,
    ) -> dict[tuple[str, int], float]:  # fmt: skip
        """How far from letting go; forces may move along ``open_ways`` without any effect."""
        if not open_ways.size:
            made = {}
            for who, k, mine in held:
                if who == "dry":
                    plus, minus = levels[k]
                    made["dry", k] = min(plus + f[mine[0]], minus - f[mine[0]])
                    continue
                made["touch", k] = float(f[mine[0]])
                if mode.touch[k] == STICKS and len(mine) > 1:
                    least = self.touching[k].mu_static * f[mine[0]]
                    made["grip", k] = float(least - np.linalg.norm(f[mine[1:]]))
            return made
        # The best that forces can do: a linear programme, the cone by 64 planes.
        rows, limits = [], []
        for who, k, mine in held:
            if who == "dry":
                plus, minus = levels[k]
                rows += [(mine, [-1.0]), (mine, [1.0])]
                limits += [plus, minus]
                continue
            rows.append((mine[:1], [-1.0]))
            limits.append(0.0)
            if mode.touch[k] == STICKS and len(mine) > 1:
                turns = [0.0, np.pi] if len(mine) == 2 else np.linspace(0, 2 * np.pi, 65)[:-1]
                for turn in turns:
                    along = [np.cos(turn), np.sin(turn)][: len(mine) - 1]
                    rows.append((mine, [-self.touching[k].mu_static, *along]))
                    limits.append(0.0)
        A = np.zeros((len(rows), len(f)))
        for at, (mine, numbers) in zip(A, rows, strict=True):
            at[mine] = numbers
        scale = np.ones((len(rows), 1))
        best = linprog(
            np.r_[np.zeros(open_ways.shape[1]), -1.0],
            np.hstack([A @ open_ways, scale]), np.array(limits) - A @ f,
            bounds=[(None, None)] * open_ways.shape[1] + [(None, 1e3)],
        )  # fmt: skip
        return {("all", 0): float(best.x[-1])}


def solve(M: Array, push: Array, G: Array, C: Array, b: Array) -> tuple[Array, Array, Array]:
    """Accelerations a, forces f and the forces that have no effect: M a = push + Cᵀ f, G a = b."""
    free = np.linalg.solve(M, push)
    if not len(G):
        return free, np.zeros(0), np.zeros((0, 0))
    ways = np.linalg.solve(M, C.T)
    K, rhs = G @ ways, b - G @ free
    U, sizes, V = np.linalg.svd(K)
    rank = int(np.sum(sizes > RANK * sizes[0]))
    f = V[:rank].T @ ((U[:, :rank].T @ rhs) / sizes[:rank])
    open_ways = V[rank:].T if rank < len(sizes) else np.zeros((0, 0))
    if np.linalg.norm(K @ f - rhs) > 1e-7 * (1.0 + np.linalg.norm(rhs)):
        f = np.full(len(b), np.nan)  # what is asked for cannot be
    return free + ways @ f, f, open_ways
