# SPDX-License-Identifier: Apache-2.0
"""Varied quantities in words, with the units that the scene's descriptions state, for headings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any, get_args

from arm_dynamics.scene import Scene
from arm_dynamics.scene.types import Part


def unit(key: str) -> str:
    """The unit of a key of a scene, of revolute joints; empty if it has none."""
    unit, parts = "", list[type[Part]]([Scene])
    for name in key.split("."):
        part = next((part for part in parts if name in part.model_fields), None)
        if part is None:  # an index, or the name of a joint
            continue
        about = _description(part, name)
        if "in the unit of" not in about:
            stated = re.search(r"\[(.+?)\]", about)
            unit = stated[1] if stated else ""
        parts = list(_parts(part.model_fields[name].annotation))
    return unit


def _description(part: type[Part], name: str) -> str:
    """What a part, or one that it extends, says of a key among its attributes."""
    for base in part.__mro__:
        text = inspect.cleandoc(base.__doc__ or "")
        if entry := re.search(rf"^ {{4}}{name}: (.*(?:\n {{5,}}.*)*)", text, re.MULTILINE):
            return " ".join(entry[1].split())
    return ""


def _parts(annotation: Any) -> Iterator[type[Part]]:
    """The parts of a scene that a value of this type may contain."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        yield annotation
    for argument in get_args(annotation):
        yield from _parts(argument)


def heading(key: str) -> str:
    """A key of a study in words, with its unit."""
    words = re.sub(r"^joints\.(\*\.)?|s\.\d+(?=\.)", "", key)  # payloads.0.mass is that of one
    words = re.sub(r"friction\.(\w+)$", r"\1 friction", words)
    label = re.sub(r"[._]", " ", words)
    return f"{label}\n[{unit(key)}]" if unit(key) else label
