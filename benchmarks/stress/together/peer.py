# SPDX-License-Identifier: Apache-2.0
"""The same case in MuJoCo, where it has words for all of it.

Coulomb friction is ``frictionloss``, a current a torque with the rotor's inertia as armature, a
rod a tendon of fixed length, a mimic joint an equality of joints. MuJoCo knows no coefficient of
restitution: the damping ratio ζ of contacts and limits is that of a mass on a spring and a damper
that leaves with the part e of its speed, e = exp(-πζ/√(1-ζ²)).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.stress.together.cases import Case, features
from benchmarks.stress.verdict import Setting

SOFT = 2.0  # ticks of the time constant of contacts and limits: the least that MuJoCo allows
POINT = 1e-4  # [m], radius of the sphere that stands for a contact point
TINY = 1e-9  # [kg m²], least inertia
INTEGRATORS = {"rk4": "RK4", "euler": "Euler"}  # any other: implicitfast
Vector = np.ndarray


@cache
def mujoco() -> ModuleType | None:
    """MuJoCo, if it is installed: ``./arm bench`` sees to that."""
    try:
        import mujoco as module
    except ImportError:
        return None
    module.set_mju_user_warning(lambda message: None)  # it would write a log file
    return module


def there() -> bool:
    """Whether MuJoCo is installed."""
    return mujoco() is not None


def method(setting: Setting) -> str:
    """MuJoCo's integrator that stands beside ours."""
    return INTEGRATORS.get(setting.method, "implicitfast")


def follow(
    case: Case, start: tuple[Vector, Vector], command: Vector, names: tuple[str, ...]
) -> tuple[Vector, str]:
    """Positions at every tick, shape (ticks + 1, n), and MuJoCo's warning, if it gave one."""
    mj = mujoco()
    assert mj is not None
    model = compiled(case)
    data = mj.MjData(model)
    for name, q, v in zip(names, *start, strict=True):
        _put(model, data, name, q, v)
    if "mimic" in case.features:
        k = names.index(features.ARMS[case.arm]["joints"][2])
        _put(model, data, "flapping", -0.5 * start[0][k], -0.5 * start[1][k])
    places = [model.joint(name).qposadr[0] for name in names]
    dofs = [model.joint(name).dofadr[0] for name in names]
    torque, q = command * _torque(case, names), np.empty((len(command) + 1, len(names)))
    q[0] = start[0]
    for k, tau in enumerate(torque):
        data.qfrc_applied[dofs] = tau
        mj.mj_step(model, data)
        q[k + 1] = data.qpos[places]
        if bad := [str(mj.mjtWarning(i).name) for i in range(len(data.warning))
                   if data.warning[i].number]:  # fmt: skip
            return q, ", ".join(bad)
    return q, ""


def _put(model: Any, data: Any, name: str, q: float, v: float) -> None:
    joint = model.joint(name)
    data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = q, v


def _torque(case: Case, names: tuple[str, ...]) -> Vector:
    """Torque at each joint for a unit of its command, shape (n,)."""
    drives = [case.scene["joints"].get(name, {}).get("actuator", {}) for name in names]
    return np.array([features.PER_AMPERE if "command" in drive else 1.0 for drive in drives])


def compiled(case: Case) -> Any:
    """The case as a MuJoCo model."""
    mj = mujoco()
    assert mj is not None
    spec = mj.MjSpec.from_string(_bare(case.scene["robot"]))
    spec.option.timestep = case.setting.dt
    spec.option.integrator = getattr(mj.mjtIntegrator, f"mjINT_{method(case.setting).upper()}")
    spec.option.cone = mj.mjtCone.mjCONE_ELLIPTIC
    for joint in spec.joints:
        common, own = case.scene["joints"]["*"], case.scene["joints"].get(joint.name, {})
        _joint(joint, common | own, case.setting.dt)
    for payload in case.scene.get("payloads", ()):
        spec.body(payload["frame"]).add_body(
            pos=payload["com"], mass=payload["mass"], inertia=[TINY] * 3,
            ipos=[0, 0, 0], explicitinertial=True,
        )  # fmt: skip
    for spring in case.scene.get("springs", ()):
        tendon = _tendon(spec, spring["frames"], spring["points"])
        tendon.stiffness = _first(tendon.stiffness, spring["stiffness"])
        tendon.damping = _first(tendon.damping, spring["damping"])
        tendon.springlength = [spring["rest_length"]] * 2
    for constraint in case.scene.get("constraints", ()):
        _constraint(spec, constraint, case.setting.dt)
    if "mimic" in case.features:
        leader = features.ARMS[case.arm]["joints"][2]
        equality = spec.add_equality(
            type=mj.mjtEq.mjEQ_JOINT, objtype=mj.mjtObj.mjOBJ_JOINT, name1="flapping",
            name2=leader, solref=_solref(0.0, case.setting.dt),
        )  # fmt: skip
        equality.data[:] = 0.0
        equality.data[1] = -0.5
    model = spec.compile()
    _set_lengths(model, case.scene.get("constraints", ()))
    return model


def _set_lengths(model: Any, constraints: Any) -> None:
    """Rods hold their length, which MuJoCo counts from that where all joints are at zero."""
    rods = [each["distance"] for each in constraints if each["type"] == "distance"]
    held = np.flatnonzero(model.eq_type == int(mujoco().mjtEq.mjEQ_TENDON))  # type: ignore[union-attr]
    for equality, distance in zip(held, rods, strict=True):
        tendon = model.eq_obj1id[equality]
        model.eq_data[equality, 0] = distance - model.tendon_length0[tendon]


def _bare(robot: dict[str, Any]) -> str:
    """The URDF without shapes, with locked joints fixed and every link kept as a body."""
    root = ElementTree.fromstring(robot["urdf"])
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for joint in root.findall("joint"):
        if joint.get("name") in robot["lock"]:
            joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    own = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(own, "compiler", fusestatic="false", boundinertia=str(TINY))
    return ElementTree.tostring(root, encoding="unicode")


def _solref(restitution: float, dt: float) -> list[float]:
    """Time constant and damping ratio."""
    if restitution <= 0.0:
        return [SOFT * dt, 1.0]
    log = np.log(max(restitution, 1e-9))
    ratio = max(-log / np.hypot(np.pi, log), 1e-3)
    # MuJoCo's time constant is that of the decay, 1/(ζω): ω is that of the critical damping.
    return [SOFT * dt / ratio, ratio]


def _joint(joint: Any, settings: dict[str, Any], dt: float) -> None:
    friction, spring = settings.get("friction", {}), settings.get("spring", {})
    motor = settings.get("actuator", {})
    viscous = friction.get("viscous", 0.0) + spring.get("damping", 0.0)
    joint.damping = _first(joint.damping, viscous)
    joint.stiffness = _first(joint.stiffness, spring.get("stiffness", 0.0))
    joint.springref = spring.get("rest", 0.0)
    joint.frictionloss = friction.get("coulomb", 0.0)
    joint.armature = settings.get("armature", 0.0) + (
        motor["rotor_inertia"] * motor["gear_ratio"] ** 2 if motor else 0.0
    )
    joint.limited = 0
    limits = settings.get("limits", {})
    if isinstance(limits.get("stop"), dict):
        joint.limited, joint.range = 1, [limits["lower"], limits["upper"]]
        joint.solref_limit = _solref(limits["stop"]["restitution"], dt)


def _first(old: Any, value: float) -> Any:
    """A coefficient, or the first of a polynomial's."""
    return value if np.size(old) == 1 else [value, *[0.0] * (np.size(old) - 1)]


def _body(spec: Any, frame: str) -> Any:
    """The body of a link; the world for it and for the robot's base."""
    return spec.body(frame) or spec.worldbody if frame != "world" else spec.worldbody


def _tendon(spec: Any, frames: Any, points: Any) -> Any:
    number = len(spec.sites)
    tendon = spec.add_tendon(name=f"tendon{number}")
    for k, (frame, point) in enumerate(zip(frames, points, strict=True)):
        name = f"site{number + k}"
        _body(spec, frame).add_site(name=name, pos=point)
        tendon.wrap_site(name)
    return tendon


def _constraint(spec: Any, constraint: dict[str, Any], dt: float) -> None:
    mj = mujoco()
    assert mj is not None
    if constraint["type"] == "distance":
        tendon = _tendon(spec, constraint["frames"], constraint["points"])
        equality = spec.add_equality(
            type=mj.mjtEq.mjEQ_TENDON, objtype=mj.mjtObj.mjOBJ_TENDON, name1=tendon.name,
            solref=_solref(0.0, dt),
        )  # fmt: skip
        equality.data[:] = 0.0
        return
    number, plane = len(spec.geoms), constraint["plane"]
    radius = constraint.get("radius", POINT)
    depth = 0.0 if "radius" in constraint else POINT  # then the point itself touches
    body = _body(spec, constraint["frame"])
    body.add_geom(
        name=f"ball{number}", type=mj.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0], mass=0.0,
        pos=constraint.get("point", [0, 0, 0]), contype=0, conaffinity=0,
    )  # fmt: skip
    ground = [*plane["point"][:2], plane["point"][2] - depth]
    spec.worldbody.add_geom(
        name=f"plane{number}", type=mj.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1], pos=ground,
        contype=0, conaffinity=0,
    )  # fmt: skip
    slide = constraint["friction"]
    spec.add_pair(
        geomname1=f"plane{number}", geomname2=f"ball{number}", condim=3,
        friction=[slide, slide, 0, 0, 0], solref=_solref(constraint["restitution"], dt),
    )  # fmt: skip
