# SPDX-License-Identifier: Apache-2.0
"""Entries of a scene that would change nothing are refused, with what would make them act.

Those of friction, which need the levels of mimic joints, are refused in ``model.friction.source``.
"""

from collections.abc import Mapping
from typing import Any

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.imperfections import ALL
from arm_dynamics.scene.schema import Scene, Stop
from arm_dynamics.scene.types import Part
from arm_dynamics.scene.urdf.description import Urdf

# Keys that change nothing, their parts separated by dots, each with the reason
IdleKeys = dict[str, str]

_POSITIVE = "more than 0 is expected"
# Keys of a joint that matter only if another one, beside them, is not zero
_KEYS_OF_ZERO = {
    "actuator.cogging.amplitude": ("order", "phase"),
    "transmission.kinematic_error.amplitude": ("order", "phase"),
    "transmission.hysteresis.torque": ("deflection", "sharpness"),
    "spring.stiffness": ("rest",),
}
_RANDOM = ("position.noise", "velocity.noise", "effort.noise", "jitter", "loss")


def check_effect(scene: Scene, urdf: Urdf) -> None:
    """Refuse entries without effect."""
    locked = set(scene.robot.lock)
    free = [name for name in urdf.moving if not locked & {name, urdf.leader(name)}]
    refuse_of_joints(scene, {name: _idle_keys(scene, name, urdf) for name in free})
    for i, spring in enumerate(scene.springs):
        if spring.stiffness == 0.0:
            _refuse(spring, f"springs.{i}.", {"rest_length": f"'stiffness' is 0; {_POSITIVE}"})
    if scene.sensors is None:
        return
    idle = {}
    if not scene.sensors.velocity.cutoff:
        idle["velocity.order"] = "there is no filter; a 'cutoff' is expected"
    if not has_chance(scene):
        idle["seed"] = "nothing is random; a 'noise', 'jitter' or 'loss' is expected"
    _refuse(scene.sensors, "sensors.", idle)


def refuse_of_joints(scene: Scene, idle: Mapping[str, IdleKeys]) -> None:
    """Refuse entries of joints that are without effect.

    Under ``"*"``, a key is refused only if it changes nothing for all of them.
    """
    for name, keys in idle.items():
        _refuse(scene.joints.get(name), f"joints.{name}.", keys)
    first = next(iter(idle.values()), {})
    of_all = {key: why for key, why in first.items() if all(key in keys for keys in idle.values())}
    _refuse(scene.joints.get(ALL), f"joints.{ALL}.", of_all)


def _refuse(part: Part | None, where: str, idle: IdleKeys) -> None:
    for key, why in idle.items():
        if (value := value_at(part, key)) is not None:
            raise SceneError(f"scene: '{where}{key}' = {value!r} is without effect: {why}")


def value_at(part: Part | None, key: str) -> Any:
    """The value that is set at a key below a part of a scene, parts as dictionaries; or None.

    Args:
        part: The part; None if the scene has none.
        key: The key, its parts separated by dots.
    """
    value: Any = part
    for name in key.split("."):
        if not isinstance(value, Part) or name not in value.model_fields_set:
            return None
        value = getattr(value, name)
    return value.model_dump(exclude_unset=True) if isinstance(value, Part) else value


def _idle_keys(scene: Scene, name: str, urdf: Urdf) -> IdleKeys:
    """What is idle of a joint's settings, merged with those for all joints."""
    joint, idle = scene.joint(name), IdleKeys()
    for key, others in _KEYS_OF_ZERO.items():
        path, _, own = key.rpartition(".")
        if value_at(joint, key) == 0.0 and value_at(joint, f"{path}.table") is None:
            idle |= {f"{path}.{other}": f"'{own}' is 0; {_POSITIVE}" for other in others}
    if value_at(scene.joints.get(ALL), "transmission.hysteresis.torque"):
        idle.pop("transmission.hysteresis.deflection", None)  # required where it is taken away
    limits = joint.limits
    is_limited = limits.lower is not None or limits.upper is not None or name in urdf.limited
    is_limited &= not (name in urdf.mimics and urdf.mimics[name].multiplier == 0.0)
    if (limits.stop is True or isinstance(limits.stop, Stop)) and not is_limited:
        idle["limits.stop"] = (
            "the joint has no position limits; 'lower' or 'upper' is expected beside it"
        )
    if joint.servo.damping is not None:
        idle["servo.damping_ratio"] = "'damping' is given; one of the two is expected"
    return idle


def has_chance(scene: Scene) -> bool:
    """Whether sensors or commands of a scene have anything random, for which a seed counts."""
    parts = (scene.sensors, scene.commands)
    return any(value_at(part, key) is not None for part in parts for key in _RANDOM)
