# SPDX-License-Identifier: Apache-2.0
"""Random scenes with a start and commands; the same kind and seed give the same case.

A robot is a tree of links or a Panda. Hardships make its numbers unpleasant, features are what its
joints and tip carry: friction, stops, drives, springs, contacts. Their sizes follow the inertia of
the joint that carries them, over some decades. Sets of parts that statics does not determine are
drawn by ``held``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from arm_dynamics import Dynamics, load_scene
from arm_sim.integrators.methods import METHODS
from benchmarks.robots.urdf import joint, link

Vector = np.ndarray
Settings = dict[str, Any]
Draw = np.random.Generator

PIECE, PIECES = 2e-2, 20  # [s] a command holds, and how many there are
TICKS = (2e-2, 5e-3, 1e-3, 2e-4)  # [s]; each divides a piece
WAYS = 6  # of integrating a scene with features; arms are integrated in all
TRIES = 20  # starts that are offered: the tip may begin inside a plane
LONG_TO_COMPILE = 10  # joints: the implicit method's Jacobian takes too long with more

MOST_JOINTS, FEW = 30, 3
HARDSHIPS = {
    "uneven masses": 0.35, "uneven lengths": 0.35, "needles": 0.35, "fast": 0.4,
    "extreme torque": 0.25, "absurd torque": 0.05, "weightless": 0.2,
}  # fmt: skip
MASSES, LENGTHS = (1e-3, 1e3), (1e-3, 10.0)  # [kg], [m]
NEEDLE = 1e-4  # thickness of a needle as a part of its length
SLOW, FAST = (1e-2, 1.0), (1.0, 100.0)  # [rad/s]; sliding joints a tenth of it in [m/s]
CALM, PUSH, ABSURD = (0.1, 30.0), (1.0, 1e5), (1e12, 1e30)  # [rad/s²] that the torque demands
FRICTIONS = {"no friction": 0.5, "viscous friction": 0.3, "dry friction": 0.2}


@dataclass(frozen=True)
class Way:
    """A way to integrate: method (None for the scene's default), tick in [s], tolerance."""

    method: str | None
    dt: float
    tolerance: float | None = None

    @property
    def name(self) -> str:
        return f"{self.method or 'default'}{'' if self.tolerance is None else ' controlled'}"


@dataclass(frozen=True)
class Case:
    """A scene, its start, what drives it, and ways to integrate it."""

    kind: str  # ``arms`` or ``features``
    seed: int  # it was drawn from
    scene: Settings = field(repr=False)  # for ``load_scene``
    traits: tuple[str, ...]  # what is unpleasant about it, and its features
    q: Vector  # positions at the start, the first that the scene allows, shape (TRIES, n)
    v: Vector  # velocities, shape (n,)
    command: Vector  # of each piece, shape (PIECES, n)
    ways: tuple[Way, ...]  # how it is integrated

    def commands(self, dt: float) -> Vector:
        """The command of every tick of a length, shape (ticks, n)."""
        return np.repeat(self.command, round(PIECE / dt), axis=0)


def draw(kind: str, seed: int, most_joints: int = MOST_JOINTS) -> Case:
    """Draw a case.

    ``arms`` are trees with hardships and friction under constant commands, ``features`` ordinary
    arms with many features under changing commands.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    hard = {name: kind == "arms" and rng.uniform() < p for name, p in HARDSHIPS.items()}
    if kind == "arms":
        n = int((most_joints + 1) ** rng.uniform() ** 0.7)
        n = min(n, FEW) if hard["absurd torque"] else n
    else:
        n = int(rng.integers(1, FEW + 1))
    panda = kind == "features" and rng.uniform() < 0.3
    scene, sliding = _panda() if panda else _tree(rng, n, hard)
    bare = Dynamics(load_scene(scene))
    n = bare.n
    q = rng.uniform(-np.pi, np.pi, n) * np.where(sliding, 0.1, 1.0)
    if panda:
        q = np.deg2rad([0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0])
    units = np.where(sliding, 0.1, 1.0)
    v = rng.uniform(-1, 1, n) * units * _log(rng, *(FAST if hard["fast"] else SLOW))
    push = ABSURD if hard["absurd torque"] else PUSH if hard["extreme torque"] else CALM
    tau = bare.inverse(q, v, rng.uniform(-1, 1, n) * _log(rng, *push))
    traits = [f"{n} joints", *(name for name, there in hard.items() if there)]
    command = np.tile(tau, (PIECES, 1))
    if kind == "arms":
        traits.append(_friction(rng, scene, bare, q, tau))
    else:
        traits += _features(rng, scene, bare, q)
        holding = bare.gravity(q) * (rng.uniform() < 0.8)
        command = holding + (tau - holding) * rng.uniform(-1, 1, (PIECES, n))
    starts = q + np.linspace(0.0, 0.5, TRIES)[:, None] * rng.uniform(-1, 1, (TRIES, n)) * units
    return Case(kind, seed, scene, tuple(traits), starts, v, command, tuple(_ways(rng, kind, n)))


KINDS = ("arms", "features")


def _ways(rng: Draw, kind: str, n: int) -> list[Way]:
    """By fixed steps, under error control, and as the scene itself chooses."""
    names = [name for name in METHODS if name != "implicit" or n <= LONG_TO_COMPILE]
    able = [name for name in names if METHODS[name].adaptive]
    tick = lambda: float(rng.choice(TICKS))  # noqa: E731
    fixed = [(name, dt) for name in names for dt in TICKS]
    controlled = [(name, dt) for name in able for dt in TICKS]
    if kind == "features":
        fixed = [(str(rng.choice(names)), tick()) for _ in range(WAYS // 2)]
        controlled = [(str(rng.choice(able)), tick()) for _ in range(WAYS - WAYS // 2 - 1)]
    tolerances = _log(rng, 1e-10, 1e-5, len(controlled))
    return [
        *(Way(*one) for one in fixed),
        *(Way(*one, float(to)) for one, to in zip(controlled, tolerances, strict=True)),
        Way(None, tick()),
    ]


def _log(rng: Draw, low: float, high: float, size: Any = None) -> Any:
    """Between two numbers, evenly in the logarithm."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


# --- robots ------------------------------------------------------------------------------------


def _panda() -> tuple[Settings, Vector]:
    robot = load_scene("panda").robot
    lock = ["panda_finger_joint1", "panda_finger_joint2"]
    bare = {"friction": {"viscous": 0.0, "coulomb": 0.0}, "limits": {"stop": False}}
    return {"robot": {"urdf": robot.urdf, "lock": lock}, "joints": {"*": bare}}, np.zeros(7, bool)


def _tree(rng: Draw, n: int, hard: dict[str, bool]) -> tuple[Settings, Vector]:
    """A tree of rods, and which of its joints slide."""
    kinds = rng.choice(("revolute", "continuous", "prismatic"), n, p=(0.45, 0.35, 0.2))
    masses = _spread(rng, MASSES if hard["uneven masses"] else (0.5, 5.0), n)
    lengths = _spread(rng, LENGTHS if hard["uneven lengths"] else (0.1, 0.5), n)
    skew, branching = rng.uniform() < 0.5, float(rng.choice((0.0, 0.2, 0.6))) * (n > FEW)
    parts = ['<?xml version="1.0"?>', '<robot name="arm">', '<link name="link0"/>']
    for i, kind in enumerate(kinds):
        parent = int(rng.integers(0, i + 1)) if rng.uniform() < branching else i
        shift = lengths[parent - 1] if parent else 0.0
        thin = NEEDLE if hard["needles"] else float(rng.uniform(0.1, 0.6))
        axis, turn = _skew(rng) if skew else _square(rng)
        # A rod along x from its joint on; inertia of an ellipsoid with axes 1, thin, thin / 2.
        a, b, c = (lengths[i] / 2 * part for part in (1.0, thin, thin / 2))
        moments = [masses[i] / 5 * s for s in (b * b + c * c, a * a + c * c, a * a + b * b)]
        parts.append(link(f"link{i + 1}", masses[i], diagonal(moments), (lengths[i] / 2, 0, 0)))
        parts.append(joint(f"joint{i + 1}", str(kind), f"link{parent}", f"link{i + 1}", axis,
                           (shift, 0, 0), turn))  # fmt: skip
    scene: Settings = {"robot": {"urdf": "\n".join([*parts, "</robot>"])}, "joints": {}}
    if hard["weightless"]:
        scene["gravity"] = [0.0, 0.0, 0.0]
    return scene, kinds == "prismatic"


def diagonal(moments: Sequence[float]) -> tuple[float, ...]:
    """A tensor of inertia, as a URDF has it, of its principal moments."""
    x, y, z = moments
    return x, 0.0, 0.0, y, 0.0, z


def _spread(rng: Draw, ends: tuple[float, float], n: int) -> Vector:
    """Sizes from a third of a range to all of it: at random, growing or shrinking to the tips."""
    least, most = np.log(ends)
    span = (most - least) * rng.uniform(1 / 3, 1)
    low = rng.uniform(least, most - span)
    sizes = np.exp(low + span * rng.permutation(np.linspace(0.0, 1.0, n)))
    order = rng.integers(3)
    return sizes if order == 0 else np.sort(sizes)[:: -1 if order == 1 else 1]


def _skew(rng: Draw) -> tuple[Vector, Vector]:
    axis = np.eye(3)[0] if rng.uniform() < 0.125 else rng.normal(size=3)
    return axis / np.linalg.norm(axis), rng.uniform(-np.pi, np.pi, 3)


def _square(rng: Draw) -> tuple[Vector, Vector]:
    axis = np.eye(3)[rng.choice(3, p=(0.125, 0.4375, 0.4375))]
    return axis, rng.integers(-1, 3, 3) * np.pi / 2


# --- friction and features ---------------------------------------------------------------------


def _inertias(bare: Dynamics, q: Vector) -> Vector:
    """What a joint's torque accelerates while the others are free: 1 / (M⁻¹)ᵢᵢ."""
    still = np.zeros(bare.n)
    weight = bare.forward(q, still, still)
    return np.array([1.0 / (bare.forward(q, still, e) - weight)[i]
                     for i, e in enumerate(np.eye(bare.n))])  # fmt: skip


def _friction(rng: Draw, scene: Settings, bare: Dynamics, q: Vector, tau: Vector) -> str:
    """Viscous friction by the rate at which it stops a joint, dry friction by the torque."""
    kind = str(rng.choice(list(FRICTIONS), p=list(FRICTIONS.values())))
    if kind == "no friction":
        return kind
    inertias, rate = _inertias(bare, q), _log(rng, 0.1, 1e4)
    for i, name in enumerate(bare.joint_names):
        if kind == "viscous friction":
            own = {"viscous": float(rate * rng.uniform() * inertias[i])}
        else:
            own = _dry(rng, abs(tau[i]) * 10 ** rng.uniform(-2, 0.5))
        scene["joints"][name] = {"friction": own}
    return kind


def _dry(rng: Draw, level: float) -> Settings:
    static = {"static": 1.5 * float(level), "stribeck_velocity": 0.05}
    return {"coulomb": float(level)} | (static if rng.uniform() < 0.5 else {})


def _features(rng: Draw, scene: Settings, bare: Dynamics, q: Vector) -> list[str]:
    """Give joints and tip some features; their names."""
    inertias, chosen = _inertias(bare, q), []
    torques = np.maximum(abs(bare.gravity(q)), inertias)
    for i, name in enumerate(bare.joint_names):
        own: Settings = dict(scene["joints"].get("*", {}))
        for make in (_rubbing, _stopped, _driven, _sprung):
            if rng.uniform() < 0.45:
                feature, settings = make(rng, inertias[i], torques[i], q[i])
                chosen.append(feature)
                own |= settings
        scene["joints"][name] = own
    frame, tip = ("panda_hand", [0.0, 0.0, 0.1]) if bare.n == 7 else (f"link{bare.n}", [0.1, 0, 0])
    pose, load = bare.pose(q, frame), float(torques.max())
    at = pose[:3, :3] @ tip + pose[:3, 3]
    for chance, at_tip in ((0.3, _contact), (0.2, _cord), (0.15, _rod), (0.15, _payload)):
        if rng.uniform() < chance:
            chosen.append(at_tip(rng, scene, frame, tip, at, load))
    return sorted(set(chosen)) or ["no feature"]


def _rubbing(rng: Draw, inertia: float, torque: float, _: float) -> tuple[str, Settings]:
    kind, level = rng.uniform(), float(torque * _log(rng, 0.03, 1.0))
    if kind < 0.6:
        return "dry friction", {"friction": _dry(rng, level)}
    if kind < 0.75:
        return "viscous", {"friction": {"viscous": float(inertia * _log(rng, 0.1, 100.0))}}
    if kind < 0.9:
        factors = {"at": [-1.0, 0.0, 1.0], "factor": [0.6, 1.0, 1.5]}
        return "friction by position", {"friction": {"coulomb": level, "position": factors}}
    lugre = {"sigma0": float(level * _log(rng, 1e2, 1e4)), "sigma1": float(inertia)}
    return "bristles", {"friction": {"coulomb": level, "viscous": level, "lugre": lugre}}


def _stopped(rng: Draw, inertia: float, _: float, q: float) -> tuple[str, Settings]:
    ends = {"lower": float(q - rng.uniform(0.02, 0.3)), "upper": float(q + rng.uniform(0.02, 0.3))}
    if rng.uniform() < 0.4:
        stop = {"restitution": float(rng.choice([0.0, 0.5, 1.0]))}
        return "rigid stop", {"limits": ends | {"stop": stop}}
    stiffness = float(inertia * _log(rng, 1e2, 1e8))
    damping = float(rng.choice([0.0, 0.1]) * np.sqrt(stiffness * inertia))
    return "compliant stop", {"limits": ends | {"stop": {"stiffness": stiffness,
                                                         "damping": damping}}}  # fmt: skip


def _driven(rng: Draw, inertia: float, torque: float, _: float) -> tuple[str, Settings]:
    rotor = {"rotor_inertia": float(inertia * _log(rng, 0.05, 1.0))}
    kind = rng.uniform()
    if kind < 0.35:
        motor = {
            "command": "voltage", "resistance": 1.0, "torque_constant": 1.0,
            "inductance": float(_log(rng, 1e-4, 1e-1)), "current_limit": float(torque),
        }  # fmt: skip
        return "current limit", {"actuator": rotor | motor}
    if kind < 0.5:
        return "lossy gear", {"actuator": rotor | {"gear_ratio": 1.0, "efficiency": 0.8}}
    stiffness = float(inertia * _log(rng, 1e2, 1e7))
    belt = {"stiffness": stiffness,
            "damping": float(rng.choice([0.0, 0.05]) * np.sqrt(stiffness * inertia))}  # fmt: skip
    if kind < 0.8:
        return "flexible drive", {"actuator": rotor, "transmission": belt}
    return "backlash", {"actuator": rotor, "transmission": belt | {"backlash": 0.01}}


def _sprung(rng: Draw, inertia: float, _: float, q: float) -> tuple[str, Settings]:
    stiffness = float(inertia * _log(rng, 1.0, 1e4))
    return "spring", {
        "spring": {"stiffness": stiffness, "rest": float(q + rng.uniform(-0.2, 0.2))}
    }


def _contact(rng: Draw, scene: Settings, frame: str, tip: Any, at: Vector, _: float) -> str:
    """A plane a little below the tip; for a point or a ball."""
    ball = {"radius": 0.02} if rng.uniform() < 0.4 else {}
    plane = {"point": [0.0, 0.0, float(at[2] - rng.uniform(0.021, 0.1))]}
    scene.setdefault("constraints", []).append({
        "type": "contact", "frame": frame, "point": tip, "plane": plane,
        "friction": float(rng.choice([0.0, 0.3])), "restitution": float(rng.choice([0.0, 0.5])),
    } | ball)  # fmt: skip
    return "contact"


def _cord(rng: Draw, scene: Settings, frame: str, tip: Any, at: Vector, load: float) -> str:
    """Between the tip and a point above it, slack or tight."""
    length = float(rng.uniform(0.1, 0.5))
    scene["springs"] = [{
        "name": "cord", "frames": [frame, "world"], "points": [tip, [*at[:2], at[2] + length]],
        "stiffness": float(load * _log(rng, 1.0, 1e4)), "tension_only": True,
        "rest_length": float(length * rng.uniform(0.9, 1.1)),
    }]  # fmt: skip
    return "cord"


def _rod(rng: Draw, scene: Settings, frame: str, tip: Any, at: Vector, _: float) -> str:
    """Of the length that the start has."""
    end = at + rng.uniform(0.2, 0.5, 3)
    scene.setdefault("constraints", []).append({
        "type": "distance", "frames": [frame, "world"], "points": [tip, end.tolist()],
        "distance": float(np.linalg.norm(end - at)),
    })  # fmt: skip
    return "rod"


def _payload(rng: Draw, scene: Settings, frame: str, tip: Any, _: Vector, load: float) -> str:
    mass = float(0.1 * load * _log(rng, 0.1, 1.0))
    scene["payloads"] = [{"frame": frame, "mass": mass, "com": list(tip)}]
    return "payload"


# --- parts that hold together ------------------------------------------------------------------


def held(seed: int) -> tuple[str, Settings]:
    """A family and a scene at rest whose reactions statics does not determine."""
    rng = np.random.default_rng([seed, len(KINDS)])
    family = FAMILIES[seed % len(FAMILIES)]
    parts, more = family(rng)
    urdf = f'<robot name="set"><link name="base"/>{"".join(parts)}</robot>'
    return family.__name__.strip("_"), {"robot": {"urdf": urdf}, "joints": {}} | more


def _levels(rng: Draw, low: float, high: float) -> tuple[float, float]:
    """Sliding and static level; equal in one of four."""
    sliding = float(rng.uniform(low, high))
    return sliding, sliding * (1.0 if rng.random() < 0.25 else float(rng.uniform(1.0, 2.5)))


def _rubs(rng: Draw, names: list[str], chance: float) -> Settings:
    levels = {name: _levels(rng, 0.5, 3.0) for name in names if rng.random() < chance}
    return {name: {"friction": {"coulomb": sliding, "static": static}}
            for name, (sliding, static) in levels.items()}  # fmt: skip


def _touch(rng: Draw, name: str, frame: str, point: Any, plane: Settings) -> Settings:
    sliding, static = _levels(rng, 0.1, 0.8)
    return {
        "type": "contact", "name": name, "frame": frame, "point": [float(x) for x in point],
        "plane": plane, "friction": sliding, "static_friction": static,
    }  # fmt: skip


def _free(name: str, moves: str, mass: float, lowest: str = "") -> list[str]:
    """A body on rails (small letters; ``lowest`` has a stop at 0) that turns (capitals)."""
    parts, parent = [], "base"
    for axis in moves:
        child = name if axis == moves[-1] else f"{name}_{axis}_part"
        own = (
            link(child, mass, diagonal((0.3 * mass,) * 3))
            if child == name
            else f'<link name="{child}"/>'
        )
        kind = "prismatic" if axis.islower() else "continuous"
        direction = np.eye(3)["xyz".index(axis.lower())]
        lower = 0.0 if axis == lowest else -1e9
        parts += [own, joint(f"{name}_{axis}", kind, parent, child, direction, lower=lower)]
        parent = child
    return parts


def _body(rng: Draw) -> tuple[list[str], Settings]:
    """A body on feet, on a floor or on slopes, on rails with friction, perhaps on a stop."""
    moves, mass = str(rng.choice(["xzY", "xyz", "xyzXYZ"])), float(rng.uniform(0.5, 5.0))
    count = 1 if moves == "xyz" else int(rng.integers(2 if moves == "xzY" else 3, 5))
    tilts = rng.uniform(-0.4, 0.4, count) * (moves == "xzY" and rng.random() < 0.5)
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(0.0, 0.7, count)) / count
    feet = np.c_[np.cos(angles), np.sin(angles), 0 * angles] * rng.uniform(0.3, 1.0, (count, 1))
    if moves == "xzY":
        feet[:, 1:] = np.c_[0 * angles, rng.uniform(-0.3, 0.3, count)]
    if moves == "xyz":
        feet *= 0.0
    planes = [{"point": foot.tolist(), "normal": [float(np.sin(a)), 0.0, float(np.cos(a))]}
              for foot, a in zip(feet, tilts, strict=True)]  # fmt: skip
    return _free("b", moves, mass, "z" if moves == "xyz" and rng.random() < 0.5 else ""), {
        "joints": _rubs(rng, [f"b_{axis}" for axis in moves], 0.9 if moves == "xyz" else 0.3),
        "constraints": [_touch(rng, f"foot_{k}", "b", foot, plane)
                        for k, (foot, plane) in enumerate(zip(feet, planes, strict=True))],
    }  # fmt: skip


def _loop(rng: Draw) -> tuple[list[str], Settings]:
    """A chain of three to five bars with friction in its hinges; its end is pinned."""
    lengths = rng.uniform(0.4, 1.2, int(rng.integers(3, 6)))
    q = rng.uniform(-np.pi, np.pi, len(lengths))
    way = np.cumsum(q)
    end = [float(lengths @ np.cos(way)), 0.0, float(lengths @ np.sin(way))]
    parts, names = [], [f"h{k}" for k in range(len(lengths))]
    for k, name in enumerate(names):
        parent, at = (f"bar{k - 1}", (lengths[k - 1], 0, 0)) if k else ("base", (0, 0, 0))
        parts += [link(f"bar{k}", lengths[k], diagonal((0.1,) * 3)),
                  joint(name, "continuous", parent, f"bar{k}", (0, -1, 0), at)]  # fmt: skip
    tip = [float(lengths[-1]), 0.0, 0.0]
    pin = {"type": "point", "frames": [f"bar{len(names) - 1}", "world"], "points": [tip, end]}
    return parts, {
        "gravity": [0.0, 0.0, 0.0], "constraints": [pin], "joints": _rubs(rng, names, 0.9),
        "initial": {"position": dict(zip(names, q.tolist(), strict=True))},
    }  # fmt: skip


def _couplings(rng: Draw) -> tuple[list[str], Settings]:
    """Wheels coupled by gears, with friction at each; in half of them, two trains."""
    names = [f"w{k}" for k in range(int(rng.integers(3, 7)))]
    parts = [text for name in names for text in (
        link(f"wheel_{name}", 1.0, diagonal((rng.uniform(0.05, 1.0),) * 3)),
        joint(name, "continuous", "base", f"wheel_{name}", (0, 0, 1)))]  # fmt: skip
    cut = len(names) // 2 if rng.random() < 0.5 and len(names) > 3 else 0
    gears = [
        {"type": "coupling", "joints": [names[k], names[cut if cut and k > cut else 0]],
         "ratio": float(rng.choice([-1, 1]) * rng.uniform(0.3, 3))}
        for k in range(1, len(names)) if k != cut
    ]  # fmt: skip
    return parts, {"constraints": gears, "joints": _rubs(rng, names, 1.0)}


def _grasp(rng: Draw) -> tuple[list[str], Settings]:
    """Two fingers with friction that hold a box by one or two points each."""
    half, touches = float(rng.uniform(0.1, 0.4)), []
    for finger, way in (("l", -1.0), ("r", 1.0)):
        plane = {"frame": "b", "point": [way * half, 0.0, 0.0], "normal": [way, 0.0, 0.0]}
        for k in range(int(rng.integers(1, 3))):
            point = (way * half, 0.0, rng.uniform(-0.2, 0.2))
            touches.append(_touch(rng, f"{finger}{k}", finger, point, plane))
    mass = float(rng.uniform(0.2, 2.0))
    parts = [*_free("b", "xzY", mass), *_free("l", "x", 0.3), *_free("r", "x", 0.3)]
    return parts, {"constraints": touches, "joints": _rubs(rng, ["l_x", "r_x"], 0.85)}


FAMILIES: tuple[Callable[[Draw], tuple[list[str], Settings]], ...] = (
    _body, _loop, _body, _couplings, _body, _grasp,
)  # fmt: skip
