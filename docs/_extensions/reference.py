# SPDX-License-Identifier: Apache-2.0
"""Directives for what pages take from the code: keys, parameters, commands, messages, names."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from arm_dynamics.terms import TERMS

from . import commands, interfaces, lectures, node_parameters, public_names, scene_keys


def directive(markdown: Callable[..., str]) -> type[SphinxDirective]:
    """A directive that stands for Markdown; its arguments are those of the function.

    Its content is for those who read the file as it is.
    """
    count = len(inspect.signature(markdown).parameters)

    class Generated(SphinxDirective):
        required_arguments = count
        final_argument_whitespace = True
        has_content = True

        def run(self) -> list[nodes.Node]:
            return self.parse_text_to_nodes(markdown(*self.arguments), allow_section_headings=True)

    return Generated


def package(name: str) -> str:
    """What a package says of itself, a summary of its public names, and these names."""
    words = (import_module(name).__doc__ or "").replace("``", "`")
    names = f"```{{eval-rst}}\n{public_names.directives(name)}\n```\n"
    return f"{words}\n\n{public_names.summary(name)}\n\n{names}"


def parts(package: str, names: str) -> str:
    """Public modules of a package, by their names without it, each under a heading."""
    return "\n".join(
        f"## `{name}`\n\n```{{eval-rst}}\n.. automodule:: {package}.{name}\n   :members:\n```\n"
        for name in names.split()
    )


def terms() -> str:
    """The table of terms."""
    rows = (
        f"| `{entry.method_name}` | `{entry.name}` | {', '.join(entry.parameters)} "
        f"| {' × '.join(map(str, entry.shape))} | {entry.unit} | {entry.about} |"
        for entry in TERMS
    )
    heads = "in `Dynamics`", "in C, services and commands", "of", "shape", "unit", "meaning"
    return "\n".join([f"| {' | '.join(heads)} |", "|" + "---|" * len(heads), *rows])


def without_foreign_words(
    app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any
) -> bool | None:
    """Leave away members of which Python or pydantic wrote the words."""
    if (inspect.getdoc(thing) or "").startswith(
        "Alias for field number"
    ) or name == "model_config":
        return True
    return None


def without_constructors(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Cut what pydantic says of every constructor."""
    begins = [
        k for k, line in enumerate(lines) if line.startswith("Create a new model by parsing")
    ]
    if what == "class" and begins:
        del lines[begins[0] :]


def without_repetition(app: Sphinx, domain: str, kind: str, content: nodes.Element) -> None:
    """Leave away arguments of a constructor that are attributes, which are described."""
    for fields in content.findall(nodes.field_list) if kind == "class" else ():
        names = [field[0].astext() for field in fields]
        said = {name.split()[-1] for name in names if name.startswith("ivar ")}
        for name, field in zip(names, list(fields), strict=True):
            if name.startswith(("type ", "param ")) and name.split()[-1] in said:
                fields.remove(field)


def with_bars(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Keep |x| in docstrings an absolute value; reStructuredText reads a substitution."""
    for place, line in enumerate(lines):
        parts = line.split("``")
        lines[place] = "``".join(
            part if literal % 2 else part.replace("|", r"\|") for literal, part in enumerate(parts)
        )


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("scene-keys", directive(scene_keys.markdown))
    app.add_directive("study-keys", directive(scene_keys.of_study))
    app.add_directive("node-parameters", directive(node_parameters.markdown))
    app.add_directive("commands", directive(commands.markdown))
    app.add_directive("commands-overview", directive(commands.overview))
    app.add_directive("interfaces", directive(interfaces.markdown))
    app.add_directive("lectures", directive(lectures.markdown))
    app.add_directive("package", directive(package))
    app.add_directive("terms", directive(terms))
    app.add_directive("parts", directive(parts))
    app.connect("autodoc-skip-member", without_foreign_words)
    app.connect("autodoc-process-docstring", without_constructors)
    app.connect("object-description-transform", without_repetition, priority=900)
    app.connect("autodoc-process-docstring", with_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
