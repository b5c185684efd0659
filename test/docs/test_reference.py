# SPDX-License-Identifier: Apache-2.0
"""The reference generated from the code is complete."""

import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

from arm_dynamics.ros.common.params import listed
from docs._extensions import commands, interfaces, node_parameters, public_names
from docs._extensions.attributes import section

REFERENCE = Path(__file__).parents[2] / "docs/reference"
PACKAGES = sorted(public_names.packages())


def test_every_package_has_its_page() -> None:
    pages = {page.stem for page in (REFERENCE / "python").glob("arm_*.md")}
    assert pages == {*PACKAGES, "arm_dynamics.equations.laws"}
    for name in PACKAGES:
        assert f"```{{package}} {name}\n" in (REFERENCE / f"python/{name}.md").read_text()


def test_every_public_module_has_its_place() -> None:
    text = "".join(page.read_text() for page in (REFERENCE / "python").glob("arm_*.md"))
    shown = [
        f"{package}.{name}"
        for package, names in re.findall(r"^```\{parts\} (\S+) (.*)$", text, re.MULTILINE)
        for name in names.split()
    ]
    public = [name for package in PACKAGES for name in public_names.modules(package)
              if not public_names.packages()[package]]  # fmt: skip
    assert sorted(shown) == sorted(public)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_described(package: str) -> None:
    module = import_module(package)
    assert module.__doc__
    silent = []
    for name in public_names.packages()[package]:
        thing = getattr(module, name)
        if public_names.is_constant(thing):
            words = public_names.constant_words(package, name)
        else:
            words = inspect.getdoc(thing) or ""
        if not words or words.startswith(f"{name}("):  # what dataclass writes by itself
            silent.append(name)
    assert silent == []


def public_functions() -> list[tuple[str, object]]:
    found = {}
    for package in PACKAGES:
        for name in public_names.packages()[package]:
            thing = getattr(import_module(package), name)
            if inspect.isfunction(thing):
                found[f"{package}.{name}"] = thing
            elif inspect.isclass(thing):
                for part, method in vars(thing).items():
                    if inspect.isfunction(method) and not part.startswith("_"):
                        found[f"{package}.{name}.{part}"] = method
    return sorted(found.items())


def test_public_functions_and_methods_are_described() -> None:
    assert [name for name, function in public_functions() if not inspect.getdoc(function)] == []


def test_arguments_that_are_described_exist_and_none_is_forgotten() -> None:
    wrong = {}
    for name, function in public_functions():
        said = section(function, "Args")
        taken = [p for p in inspect.signature(function).parameters if p not in {"self", "cls"}]
        if said and set(said) != set(taken):
            wrong[name] = set(said) ^ set(taken)
    assert wrong == {}


@pytest.mark.parametrize("node", ["dynamics", "sim", "controller"])
def test_every_parameter_is_described(node: str) -> None:
    text = node_parameters.markdown(node)
    for name, _, about in listed(node_parameters.kinds()[node]):
        assert f"| `{name}` |" in text and about["description"] in text.replace("\\", "")


def test_every_field_of_an_interface_is_described() -> None:
    for name in interfaces.names():
        text = (interfaces.FOLDER / f"{name}.{name[:3]}").read_text()
        fields = [line for line in text.splitlines() if re.match(r"[\w/]+(\[\])? \w", line)]
        plain = [line for line in fields if "#" not in line and "Header header" not in line]
        assert plain == [], name


def test_every_command_and_option_is_described() -> None:
    for words, command in commands.commands().items():
        assert command.help, words
        for parameter in command.params:
            if getattr(parameter, "opts", [""])[0].startswith("-"):
                assert getattr(parameter, "help", None), f"{words} {parameter.name}"


FOR_USERS = (
    "arm_dynamics", "arm_dynamics.client", "arm_dynamics.control", "arm_studies.identification",
    "arm_dynamics.task_space", "arm_dynamics.trajectory", "arm_sim",
)  # fmt: skip
SHAPES = re.compile(r"shape|\(\w+,|likewise|[Ss]ee ``|[Aa]s (?:for|those|that|``)|[Aa]rguments")


def test_arrays_of_users_functions_have_shapes() -> None:
    silent = []
    for name, function in public_functions():
        about = inspect.signature(function)
        kinds = [str(p.annotation) for p in about.parameters.values()]
        arrays = any("Array" in kind for kind in [*kinds, str(about.return_annotation)])
        package = name.rsplit(".", 2 if name.split(".")[-2][0].isupper() else 1)[0]
        if package in FOR_USERS and arrays and not SHAPES.search(inspect.getdoc(function) or ""):
            silent.append(name)
    assert silent == []
