# SPDX-License-Identifier: Apache-2.0
"""Keys of varied quantities: their location in a scene, and the cost of a change.

A change of a tunable quantity, the initial state, the motion, a controller's settings, or sensors
and commands requires no new equations. All other changes require a separate world.
"""

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any

from arm_dynamics.exceptions import SceneError, known_names

_TUNABLE = {
    "payload": re.compile(r"payloads\.\d+\.(mass|com\.\d|inertia\.\d)"),
    "friction": re.compile(r"joints\.[^.]+\.friction\.viscous"),
    "coulomb": re.compile(r"joints\.[^.]+\.friction\.coulomb"),
    "gravity": re.compile(r"gravity\.\d"),
}
STUDY_KEYS = ("scene", "controller", "motion")
# Keys that require no new equations, except some of them.
RUN_KEYS = (
    "motion", "controller.settings", "initial.position", "initial.velocity", "sensors", "commands",
)  # fmt: skip
EQUATION_KEYS = ("commands.gravity_compensated",)


def tunable(key: str) -> str | None:
    """The tunable quantity that a key changes, see ``arm_sim.plant.Parameter``; None if none."""
    return next((name for name, form in _TUNABLE.items() if form.fullmatch(key)), None)


def is_number(value: object) -> bool:
    """Whether a value is a number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def below(key: str, above: Sequence[str]) -> bool:
    """Whether a key is one of ``above`` or lies in it."""
    return any(key == other or key.startswith(f"{other}.") for other in above)


def values_below(values: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    """The values of some keys and of those that lie in them."""
    return {key: value for key, value in values.items() if below(key, keys)}


def with_values(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a scene file, or a part of it, with other values.

    Args:
        data: The content.
        values: New values by keys, whose parts are separated by dots.

    Raises:
        SceneError: If a key does not exist.
    """
    changed = deepcopy(dict(data))
    for key, value in values.items():
        _put(changed, key, value)
    return changed


def value_at(data: Any, key: str) -> Any:
    """The value of a key; None if there is none."""
    for name in key.split("."):
        if isinstance(data, Mapping):
            data = data.get(name)
        elif isinstance(data, list) and name.isdecimal() and int(name) < len(data):
            data = data[int(name)]
        else:
            return None
    return data


def overlaid(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A mapping with changes merged into it, key by key; lists are replaced."""
    merged = dict(data)
    for key, value in changes.items():
        old = merged.get(key)
        both = isinstance(value, Mapping) and isinstance(old, Mapping)
        merged[key] = overlaid(old, value) if both else value  # type: ignore[arg-type]
    return merged


def _put(data: dict[str, Any], key: str, value: Any) -> None:
    *path, last = key.split(".")
    node: Any = data
    for depth, name in enumerate(path, 1):
        entry = _entry(node, name, ".".join(path[:depth]), key)
        if isinstance(node, dict):
            node.setdefault(entry, {})
        node = node[entry]
    node[_entry(node, last, key, key)] = value


def _entry(node: Any, name: str, place: str, key: str) -> Any:
    """The index in a list that a name denotes, or the name itself."""
    if isinstance(node, list):
        if name.isdecimal() and int(name) < len(node):
            return int(name)
        allowed = known_names(map(str, range(len(node))))
        raise SceneError(f"study: 'vary.{key}': there is no '{place}'; entries: {allowed}")
    if isinstance(node, dict):
        if not name.isdecimal():
            return name
        raise SceneError(
            f"study: 'vary.{key}': there is no '{place}': the list has no entries; 'changes' may "
            "add some"
        )
    raise SceneError(f"study: 'vary.{key}': nothing lies below {node!r}")
