# SPDX-License-Identifier: Apache-2.0
"""Messages for keys and values that the schema of a scene refuses."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple, get_args

from pydantic_core import ErrorDetails

from arm_dynamics.exceptions import choices, known_names, plain
from arm_dynamics.scene.imperfections import ALL
from arm_dynamics.scene.types import Part

# Messages of pydantic in the terms of a scene file.
_ENDS = {
    "greater_than_equal": ("ge", "at least {:g} is expected"),
    "greater_than": ("gt", "more than {:g} is expected"),
    "less_than_equal": ("le", "at most {:g} is expected"),
    "less_than": ("lt", "less than {:g} is expected"),
}
_KINDS = {
    "string_type": "text is expected",
    "invalid_key": "a key is text",
    "bool_type": "true or false is expected",
    "int_type": "a whole number is expected",
    "float_type": "a number is expected",
    "float_parsing": "a number is expected",
    "finite_number": "allowed: finite numbers",
}
_MAPPINGS = ("dict_type", "model_type", "model_attributes_type", "dataclass_type")


class Schema(NamedTuple):
    """The schema of a file.

    Attributes:
        whole: Type of the whole file.
        tagged: Parts by the value of their key ``type``.
        hidden: Names in the location of an error that are not keys.
        file: Name of the file.
    """

    whole: type[Part]
    tagged: Mapping[str, type[Part]]
    hidden: Sequence[str]
    file: str = "scene"


def complaints(errors: Sequence[ErrorDetails], schema: Schema) -> list[str]:
    """One line for each error; see ``complaint``."""
    lines = dict[str, None]()
    for error in errors:
        is_short = error["type"] == "too_short"  # also where pydantic does not count bad entries
        if is_short and len(error["input"]) >= error["ctx"]["min_length"]:
            continue
        (*place, own), kinds = error["loc"], (*_KINDS, *_MAPPINGS)
        if error["type"] in kinds and _internal(own):  # of one of several kinds that are allowed
            others = [e for e in errors if [*e["loc"][: len(place)]] == place]
            if any(len(e["loc"]) > len(error["loc"]) or e["type"] not in kinds for e in others):
                continue  # the value is of another one
        if error["type"] == "missing" and isinstance(error["loc"][-1], int):
            # A list that is too short: each missing entry is an error.
            ends = [e["loc"][-1] for e in errors if [*e["loc"][:-1]] == place]
            context = {"length": 1 + max(end for end in ends if isinstance(end, int))}
            error = ErrorDetails(
                type="too_short", loc=tuple(place), msg="", input=error["input"], ctx=context
            )
        lines[complaint(error, schema)] = None
    return list(lines)


def complaint(error: ErrorDetails, schema: Schema) -> str:
    """One line for an error of pydantic: the key, its value and what is allowed."""
    place = [key for key in error["loc"] if key not in schema.hidden and not _internal(key)]
    if place[:1] == ["constraints"] and place[2:3] and place[2] in schema.tagged:
        del place[2]  # the type, by which pydantic has found the part
    if place[:1] == ["sensors"] and place[-1] == ALL:
        place.pop()  # one number for all joints is written without it
    where = ".".join(map(str, place)) or schema.file
    fields, value = fields_at(error["loc"][:-1], schema), plain(repr(error["input"]))
    if error["type"] == "extra_forbidden":
        allowed = choices(place[-1], fields)
        return f"{schema.file}: unknown key '{where}' = {value}; allowed here: {allowed}"
    if error["type"] == "missing":
        return f"{schema.file}: '{where}' is missing; it is required"
    return f"{schema.file}: '{where}' = {value}: {_reason(error, schema)}"


def _internal(key: int | str) -> bool:
    """Whether an item of an error's location is internal to pydantic, and not a key."""
    return isinstance(key, str) and ("[" in key or key in ("bool", "function-after"))


def _reason(error: ErrorDetails, schema: Schema) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in _MAPPINGS:
        named = kind == "dict_type"  # with keys that are names, and not those of the schema
        fields = [] if named else fields_at(error["loc"], schema, default=False)
        keys = f" with some of {known_names(fields)}" if fields else " from names to values"
        return f"a mapping{keys} is expected"
    if kind == "union_tag_invalid":
        allowed = [tag.strip().strip("'") for tag in context["expected_tags"].split(",")]
        tag = str(context["tag"])
        return f"unknown type '{tag}'; allowed: {choices(tag, allowed)}"
    if kind == "union_tag_not_found":
        return "'type' is missing; it is required"
    if kind == "literal_error":
        allowed = [word.strip("' ") for word in re.split(r",| or ", context["expected"])]
        return f"allowed: {choices(error['input'], allowed)}"
    if kind in ("too_short", "too_long"):
        length = context.get("length") or context.get("max_length") or context.get("min_length")
        count, commas = len(error["input"]), any(isinstance(x, int) for x in error["input"])
        hint = " (decimals have a point, as in 0.5)" if kind == "too_long" and commas else ""
        return f"{count} {'entry' if count == 1 else 'entries'}; {length} are expected{hint}"
    if kind in _ENDS:
        end, words = _ENDS[kind]
        return words.format(context[end])
    if kind == "tuple_type":
        value, example = error["input"], ""
        if isinstance(value, str):
            entries = value.strip("[]() \n").replace(",", " ").split()
            example = f", such as [{', '.join(entries)}]"
        elif isinstance(value, int | float) and not isinstance(value, bool):
            example = f", such as [0, 0, {-abs(value):g}]"
        return f"a list is expected{example}"
    if kind == "string_type" and isinstance(error["input"], bool | int | float):
        return "text is expected; in quotes it is text"
    return _KINDS.get(kind, error["msg"].removeprefix("Value error, "))


def fields_at(path: Sequence[int | str], schema: Schema, default: bool = True) -> list[str]:
    """Names of the keys that the schema allows at a path of keys from the top.

    A path that leads to no part refers to its parent, unless ``default`` is false.
    """
    parts: list[type[Part]] = [schema.whole]
    for key in map(str, path):
        named = [part.model_fields[key] for part in parts if key in part.model_fields]
        if schema.tagged.get(key) in parts:  # of several types of constraints, that of 'type'
            parts = [schema.tagged[key]]
        elif named:
            parts = _parts_in(named[0].annotation) or (parts if default else [])
    if not parts:
        return []
    return [field.alias or name for name, field in parts[0].model_fields.items()]


def _parts_in(annotation: object) -> list[type[Part]]:
    """The parts of a scene in a type annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return [annotation]
    return [part for argument in get_args(annotation) for part in _parts_in(argument)]
