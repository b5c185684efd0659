# SPDX-License-Identifier: Apache-2.0
"""What is said of keys and values that the schema of a scene refuses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from pydantic_core import ErrorDetails

from arm_dynamics.exceptions import did_you_mean, known_names
from arm_dynamics.scene.types import Part

# What the checking library says of types, in the words of a scene file.
_KINDS = {
    "string_type": "text is expected",
    "bool_type": "true or false is expected",
    "int_type": "a whole number is expected",
    "float_type": "a number is expected",
    "float_parsing": "a number is expected",
    "missing": "is missing",
    "too_short": "has too few numbers",
    "too_long": "has too many numbers",
}
_MAPPINGS = ("dict_type", "model_type", "model_attributes_type", "dataclass_type")


def complaint(
    error: ErrorDetails, whole: type[Part], tagged: Mapping[str, type[Part]], hidden: Sequence[str]
) -> str:
    """One line for one thing that is wrong: the key, its value and what is allowed.

    Args:
        error: What the checking library found.
        whole: The schema.
        tagged: Parts that go by the word for their type.
        hidden: Names in the places of errors that no scene has.
    """
    place = [key for key in error["loc"] if key not in hidden and not _internal(key)]
    where = ".".join(map(str, place)) or "scene"
    fields = fields_at(error["loc"][:-1], whole, tagged)
    if error["type"] == "extra_forbidden":
        guess = did_you_mean(str(place[-1]), fields)
        return (
            f"scene: unknown key '{where}' = {error['input']!r}; "
            f"allowed here: {known_names(fields)}{guess}"
        )
    if error["type"] == "missing":
        return f"scene: '{where}' is missing; it is required"
    return f"scene: '{where}' = {error['input']!r}: {_said(error, whole, tagged)}"


def _internal(key: int | str) -> bool:
    """Whether a place of an error is a step inside the checking library, and no key."""
    return isinstance(key, str) and ("[" in key or key in ("bool", "function-after"))


def _said(error: ErrorDetails, whole: type[Part], tagged: Mapping[str, type[Part]]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in _MAPPINGS:
        fields = fields_at(error["loc"], whole, tagged, default=False)
        keys = f" with some of {known_names(fields)}" if fields else " from names to values"
        return f"a mapping{keys} is expected"
    if kind == "union_tag_invalid":
        allowed = [tag.strip().strip("'") for tag in context["expected_tags"].split(",")]
        tag = str(context["tag"])
        return f"no type is called '{tag}'; allowed: {known_names(allowed)}" + did_you_mean(
            tag, allowed
        )
    if kind == "union_tag_not_found":
        return "'type' is missing; it is required"
    if kind == "literal_error" and isinstance(error["input"], str):
        said = error["msg"]
        allowed = [word.strip() for word in said.split("'")[1::2]]
        return said + did_you_mean(error["input"], allowed)
    if kind == "tuple_type":
        value = error["input"]
        example = f", such as [{value}]" if isinstance(value, str) else ", such as [0, 0, 1]"
        return "a list is expected" + ("" if isinstance(value, Mapping) else example)
    return _KINDS.get(kind, error["msg"].removeprefix("Value error, "))


def fields_at(
    path: Sequence[int | str],
    whole: type[Part],
    tagged: Mapping[str, type[Part]],
    default: bool = True,
) -> list[str]:
    """Names of the keys that the schema allows at a path.

    Args:
        path: Keys from the top.
        whole: The schema.
        tagged: Parts that go by the word for their type.
        default: Whether a path that leads to no part stands for the part before it.
    """
    parts: list[type[Part]] = [whole]
    for key in map(str, path):
        named = [part.model_fields[key] for part in parts if key in part.model_fields]
        if tagged.get(key) in parts:  # of several types of constraints, the one that is meant
            parts = [tagged[key]]
        elif named:
            found = _parts_in(named[0].annotation)
            parts = found or (parts if default else [])
    if not parts:
        return []
    return [field.alias or name for name, field in parts[0].model_fields.items()]


def _parts_in(annotation: object) -> list[type[Part]]:
    """The parts of a scene that a type is made of."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return [annotation]
    return [part for argument in get_args(annotation) for part in _parts_in(argument)]
