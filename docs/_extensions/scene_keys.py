# SPDX-License-Identifier: Apache-2.0
"""Tables of the keys of scenes and studies, from the schemas that check them.

Types and defaults are those of the fields, the words those of the docstrings.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from arm_dynamics.scene import Scene
from arm_studies.sweeps import Study

from .attributes import first_paragraph, section

BOUNDS = {"gt": "> {}", "ge": "≥ {}", "lt": "< {}", "le": "≤ {}"}
WORDS = {
    float: "number", int: "integer", str: "text", bool: "true, false", type(None): "",
    Any: "anything",
}  # fmt: skip


def parts(whole: type[BaseModel] = Scene) -> dict[str, type[BaseModel]]:
    """Every part of a scene by the key that holds it, in the order of the schema."""
    found: dict[str, type[BaseModel]] = {}
    _collect("", whole, found)
    return found


def _collect(key: str, part: type[BaseModel], found: dict[str, type[BaseModel]]) -> None:
    found[key] = part
    for name, field in part.model_fields.items():
        below = f"{key}.{field.alias or name}".lstrip(".")
        inner = list(_parts_in(field.annotation))
        several = _many(field.annotation)
        for kind in inner:
            kinds = [k for k in inner if "type" in k.model_fields]
            word = f" with type: {_word_of(kind)}" if kind in kinds else ""
            place = f"{below}{several}{word}"
            if kind not in found.values():
                _collect(place, kind, found)


def _word_of(kind: type[BaseModel]) -> str:
    return str(get_args(kind.model_fields["type"].annotation)[0])


def _parts_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) is not Literal:
        for inner in get_args(annotation):
            yield from _parts_in(inner)


def _many(annotation: Any) -> str:
    """What stands behind a key that holds several parts: a place in a list, or a name."""
    return {tuple: "[]", dict: ".NAME"}.get(get_origin(annotation), "")


def table(part: type[BaseModel]) -> str:
    """The keys of one part as a Markdown table: key, type, default, and what it is."""
    said = {
        name: text
        for kind in reversed(part.__mro__)
        if issubclass(kind, BaseModel)
        for name, text in section(kind, "Attributes").items()
    }
    rows = ["| key | type | default | meaning |", "|---|---|---|---|"]
    for name, field in part.model_fields.items():
        if name == "type":
            continue
        words = said[name].replace("|", "\\|")
        kind = _type(field.annotation, field.metadata)
        rows.append(f"| `{field.alias or name}` | {kind} | {_default(field)} | {words} |")
    return "\n".join(rows) if len(rows) > 2 else ""


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if value is PydanticUndefined or value is None or isinstance(value, BaseModel):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple | list):
        return f"`{_listed(value)}`" if value else "none"
    if isinstance(value, float):
        return f"`{value:g}`"
    return f"`{value}`" if value != {} else "none"


def _listed(values: Any) -> str:
    if isinstance(values, tuple | list):
        return "[" + ", ".join(_listed(v) for v in values) + "]"
    return values if isinstance(values, str) else f"{values:g}"


def _type(annotation: Any, metadata: Any = ()) -> str:
    """A type in the words of a scene's author; bounds come from pydantic's metadata."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if hasattr(annotation, "__metadata__"):
        return _type(inner[0], [*metadata, *annotation.__metadata__])
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "keys below"
    if origin is Literal:
        return ", ".join(f"`{word}`" for word in inner)
    if origin in (Union, types.UnionType):
        kinds = [_type(kind, metadata) for kind in inner if kind is not type(None)]
        return " or ".join(dict.fromkeys(filter(None, kinds)))
    if origin is tuple:
        return _tuple(inner)
    if origin is dict:
        return "mapping" if inner[1] is Any else f"{_type(inner[1])}, by name"
    bounds = [
        sign.format(f"{getattr(about, name):g}")
        for name, sign in BOUNDS.items()
        for about in _flat(metadata)
        if isinstance(getattr(about, name, None), int | float)
    ]
    if bounds:
        return ", ".join(dict.fromkeys(bounds))
    return WORDS.get(annotation, getattr(annotation, "__name__", str(annotation)))


def _flat(metadata: Any) -> Iterator[Any]:
    for about in metadata:
        yield about
        yield from getattr(about, "metadata", ())


def _tuple(inner: tuple[Any, ...]) -> str:
    if inner[-1] is Ellipsis:
        kind = _type(inner[0])
        return "list of keys below" if kind.startswith("keys") else f"list of {_plural(kind)}"
    if get_origin(inner[0]) is tuple or "tuple" in str(inner[0]):
        return f"{len(inner)} × {_type(inner[0])}"
    return f"{len(inner)} {_plural(_type(inner[0]))}"


def _plural(kind: str) -> str:
    return {"number": "numbers", "text": "names"}.get(kind, kind)


def markdown() -> str:
    """All tables of a scene, each under the key that holds them."""
    return tables(Scene)


def tables(whole: type[BaseModel]) -> str:
    """All tables, each under the key that holds them."""
    blocks = []
    for key, part in parts(whole).items():
        title = f"`{key}`" if key else "Top level"
        blocks.append(f"## {title}\n\n{first_paragraph(part)}\n\n{table(part)}\n")
    return "\n".join(blocks)


def of_study() -> str:
    """The same of a study."""
    return tables(Study)
