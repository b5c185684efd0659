# SPDX-License-Identifier: Apache-2.0
"""Each key of a scene, misspelt, of another type or out of range: the message names the key, its
value and what is allowed.
"""

import re
from collections.abc import Iterator
from copy import deepcopy
from math import nan
from typing import Annotated, Any, get_args

import pytest
from annotated_types import Ge, Gt, Le
from pydantic.fields import FieldInfo

from arm_dynamics import SceneError
from arm_dynamics.scene.constraint import SCHEMAS
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.types import Part
from models.every_key import SCENES, at, built, entries, parts_in

Place = tuple[Any, ...]
LEAKS = re.compile(r"pydantic|Input should|valid (tuple|dict|list|string)|function-|instance of")


def said_of(name: str, place: Place, value: Any, key: str = "") -> str:
    """What is said of a scene with another value at a place, or under another key there."""
    content = deepcopy(SCENES[name])
    above = at(content, place[:-1])
    if key:
        del above[place[-1]]
    above[key or place[-1]] = value
    try:
        built(content)
    except SceneError as error:
        assert not LEAKS.search(str(error)), error
        return str(error)
    return ""


def shown(place: Place) -> str:
    """A key as messages write it."""
    return ".".join(map(str, place))


@pytest.mark.parametrize("name", SCENES)
def test_misspelt(name: str) -> None:
    places = {place[: end + 1] for place in of(name) for end in range(len(place))}
    for place in (p for p in places if p[-1] not in ("*", "robot") and isinstance(p[-1], str)):
        key, value = place[-1], at(SCENES[name], place)
        wrong = f"{key[:-1]}q{key[-1]}"
        said = said_of(name, place, value, wrong)
        where = re.escape(shown((*place[:-1], wrong)))
        unknown = rf"unknown key '{where}' = .*; allowed here: "
        no_name = rf"names (joint )?'{wrong}', which does not exist; allowed: "
        assert re.search(rf"({unknown}|{no_name}).*\b{re.escape(key)}\b", said), said
        assert len(key) < 4 or f"; did you mean '{key}'?" in said, said


@pytest.mark.parametrize("name", SCENES)
def test_of_another_type(name: str) -> None:
    for place in of(name):
        for wrong in others(at(SCENES[name], place)):
            said, where = said_of(name, place, wrong), re.escape(shown(place))
            assert re.search(rf"'{where}[^']*' = .*: .*(expected|allowed: )", said), said


@pytest.mark.parametrize("name", SCENES)
def test_out_of_range(name: str) -> None:
    for place in of(name):
        value = at(SCENES[name], place)
        for wrong, allowed in beyond(place, name):
            given = [wrong, *value[1:]] if isinstance(value, list) else wrong
            said, where = said_of(name, place, given), re.escape(shown(place))
            wanted = rf"'{where}(\.0)*' = {wrong}(\.0)?: {allowed} is expected"
            assert re.search(wanted, said), said


def of(name: str) -> list[Place]:
    return list(entries(SCENES[name]))


def others(value: Any) -> list[Any]:
    """Values of other types than a value."""
    if isinstance(value, bool):
        return ["yes", 3, [True]]
    if isinstance(value, float | int):
        return ["much", *([True] if isinstance(value, float) else []), [[1.0, 2.0, 3.0]], nan]
    if isinstance(value, list):
        return [3, "1 2", {"x": 1}, [*value, [[None]]]]
    return [3, ["a", "b"], {"x": 1}]


def beyond(place: Place, name: str) -> Iterator[tuple[float, str]]:
    """Numbers just outside of what the schema allows at a place, and what is allowed instead.

    The ranges themselves are those of ``docs/stated.yaml``.
    """
    for end in ends(annotation_at(place, name)):
        match end:
            case Ge(ge=low):
                yield int(low - 1), f"at least {low:g}"
            case Gt(gt=low):
                yield int(low), f"more than {low:g}"
            case Le(le=high):
                yield int(high + 1), f"at most {high:g}"


def annotation_at(place: Place, name: str) -> Any:
    """The type in the schema, with its range, of an entry of a scene."""
    part: type[Part] = Scene
    for key in (key for key in place if isinstance(key, str)):
        fields = {field.alias or name: field for name, field in part.model_fields.items()}
        if key in fields:
            found = fields[key]
            part = next(parts_in(found.annotation), part)
        if key == "constraints":
            part = SCHEMAS[SCENES[name][key][place[1]]["type"]]
    return Annotated[(found.annotation, *found.metadata)] if found.metadata else found.annotation


def ends(annotation: Any) -> Iterator[Any]:
    for each in (*getattr(annotation, "__metadata__", ()), *get_args(annotation)):
        if isinstance(each, FieldInfo):
            yield from each.metadata
        elif isinstance(each, Ge | Gt | Le):
            yield each
        else:
            yield from ends(each)
