# SPDX-License-Identifier: Apache-2.0
"""Defaults and ranges that the reference takes from the code are those that users were promised.

A change of one of them is a change of behaviour: it belongs in the changelog, and then here.
"""

import importlib
import inspect
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import BaseModel

from arm_dynamics.ros.common.params import listed
from arm_dynamics.scene import Scene
from arm_studies.sweeps import Study
from docs._extensions import node_parameters, public_names, scene_keys

STATED = yaml.safe_load(Path(__file__).with_name("stated.yaml").read_text(encoding="utf-8"))
SCHEMAS = {"scene": Scene, "study": Study}


def of_schema(kind: str) -> dict[str, str]:
    """Types, with their ranges, and defaults of all keys."""
    found = {}
    for part, model in scene_keys.parts(SCHEMAS[kind]).items():
        for line in scene_keys.table(model).splitlines()[2:]:
            key, about, default, _ = (cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1])
            found[f"{part or 'top'}: {key.strip('`')}"] = f"{about}; {default}".rstrip("; ")
    return found


def of_node(name: str) -> dict[str, str]:
    """Defaults and ranges of parameters, and which of them may change."""
    found = {}
    for parameter, default, about in listed(node_parameters.kinds()[name]):
        fixed = "fixed" if about.get("read_only") else "may change"
        allowed = node_parameters._allowed(about)
        found[parameter] = f"{default!r}, {fixed}{allowed}"
    return found


def of_package(package: str) -> dict[str, str]:
    """Default arguments of public functions, classes and methods; not of parts of files."""
    found = {}
    for name in public_names.packages()[package]:
        thing = getattr(importlib.import_module(package), name)
        if public_names.home(package, name) != package or public_names.is_constant(thing):
            continue
        if inspect.isclass(thing) and issubclass(thing, BaseModel):
            continue
        found |= _defaults(name, thing)
        for inner, method in vars(thing).items() if inspect.isclass(thing) else ():
            if not inner.startswith("_"):
                called = getattr(method, "__func__", method)
                found |= _defaults(f"{name}.{inner}", called) if inspect.isroutine(called) else {}
    return found


def _defaults(name: str, thing: Any) -> dict[str, str]:
    try:
        parameters = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):
        return {}
    plain = (bool, int, float, str, tuple)
    said = [f"{p.name}={p.default!r}" for p in parameters if isinstance(p.default, plain)]
    return {name: ", ".join(said)} if said else {}


@pytest.mark.parametrize("kind", SCHEMAS)
def test_keys_of_files(kind: str) -> None:
    assert of_schema(kind) == STATED[kind]


@pytest.mark.ros
@pytest.mark.parametrize("node", ["dynamics", "sim", "controller"])
def test_parameters_of_nodes(node: str) -> None:
    assert of_node(node) == STATED["nodes"][node]


@pytest.mark.parametrize("package", public_names.packages())
def test_arguments_of_public_functions(package: str) -> None:
    assert of_package(package) == STATED["packages"].get(package, {})
