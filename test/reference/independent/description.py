# SPDX-License-Identifier: Apache-2.0
"""A scene, read as plain data."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any
from xml.etree import ElementTree

Settings = dict[str, Any]


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> Settings:
    """Two nested dictionaries, key by key; ``above`` wins."""
    made = deepcopy(dict(below))
    for key, value in above.items():
        deep = isinstance(value, Mapping) and isinstance(made.get(key), Mapping)
        made[key] = merged(made[key], value) if deep else deepcopy(value)
    return made


def joint(scene: Mapping[str, Any], name: str) -> Settings:
    """What holds of one joint: the entry of "*" under its own, and the URDF under both."""
    said = scene.get("joints", {})
    own = merged(said.get("*", {}), said.get(name, {}))
    element = next(
        e for e in ElementTree.fromstring(scene["robot"]["urdf"].encode()).iter("joint")
        if e.get("name") == name
    )  # fmt: skip
    dynamics = element.find("dynamics")
    given = {} if dynamics is None else dynamics.attrib
    default = {
        "viscous": float(given.get("damping", 0.0)),
        "coulomb": float(given.get("friction", 0.0)),
    }
    limit = element.find("limit")
    found = {} if limit is None or element.get("type") == "continuous" else limit.attrib
    limits = {key: float(found[key]) for key in ("lower", "upper") if key in found}
    return merged({"friction": default, "limits": limits}, own)


def mimics(urdf: str) -> dict[str, tuple[str, float, float]]:
    """Leader, multiplier and offset of every joint that follows another."""
    rules = {}
    for element in ElementTree.fromstring(urdf.encode()).iter("joint"):
        rule = element.find("mimic")
        if rule is not None:
            factors = float(rule.get("multiplier", "1")), float(rule.get("offset", "0"))
            rules[str(element.get("name"))] = (str(rule.get("joint")), *factors)
    return rules


def only(said: Mapping[str, Any], what: str, *known: str) -> None:
    """Refuse keys that would be passed over in silence."""
    unknown = set(said) - set(known)
    if unknown:
        raise NotImplementedError(f"{what}: {sorted(unknown)} is not known here")
