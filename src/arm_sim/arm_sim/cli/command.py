# SPDX-License-Identifier: Apache-2.0
"""Commands made of typed functions.

A positional parameter is an argument and a keyword-only one an option, a bool a flag, a tuple
many values; without a default it is required. The section ``Args`` of the docstring is the help
of the options, all before it that of the command. An annotation may add a click type, a text (of
an option its name and placeholder, ``--out DIR``, or the help where ``Args`` has none; of an
argument the placeholder), and a dictionary of further settings.
"""

import inspect
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import click

from arm_sim.cli.output import as_called, examples

_ARGUMENT = re.compile(r"^    (\w+): (.*(?:\n {5,}.*)*)", re.MULTILINE)


class _Command(click.Command):
    """Its parameters are derived from its function at their first use, after ``first``."""

    def __init__(self, first: Sequence[click.Parameter], **settings: Any) -> None:
        self._first, self._params = first, None
        super().__init__(**settings)

    @property
    def params(self) -> list[click.Parameter]:
        if self._params is None:
            self._params = [*self._first, *_parameters(self.callback)]
        return self._params

    @params.setter
    def params(self, value: object) -> None:
        """Click sets an empty list."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, or fail with how to type an argument that was typed as an option."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            arguments = (x for x in self.params if isinstance(x, click.Argument))
            if error.option_name not in (option_name(x.name) for x in arguments):
                raise
            ctx.fail(f"'{error.option_name}' is an argument: type its value without a name")


def command(
    *lines: str, name: str | None = None, first: Sequence[click.Parameter] = (), **settings: Any
) -> Callable[[Callable[..., Any]], click.Command]:
    """Make a command of a function.

    Args:
        lines: Examples of the command.
        name: What is typed; by default the function's name.
        first: Parameters that come before those of the function.
        settings: Settings of click's context.
    """

    def decorator(function: Callable[..., Any]) -> click.Command:
        return _Command(
            first, name=name or function.__name__.replace("_", "-"), context_settings=settings,
            callback=function, help=as_called(inspect.getdoc(function).partition("\n\nArgs:")[0]),
            epilog=examples(*lines),
        )  # fmt: skip

    return decorator


def _parameters(function: Callable[..., Any]) -> list[click.Parameter]:
    """The arguments and options of a function, without those that collect any others."""
    arguments = as_called(inspect.getdoc(function).partition("\n\nArgs:")[2])
    about = {name: re.sub(r"\n *", " ", text) for name, text in _ARGUMENT.findall(arguments)}
    hints = get_type_hints(function, include_extras=True)
    return [
        _parameter(parameter, hints[name], about.get(name, ""))
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    ]


def _parameter(parameter: inspect.Parameter, hint: Any, about: str) -> click.Parameter:
    """The click argument or option of a function's parameter, from its annotation and its text."""
    kind, marks, many = _unwrapped(hint)
    types = [mark for mark in marks if isinstance(mark, click.ParamType)]
    texts = [mark for mark in marks if isinstance(mark, str)]
    settings: dict[str, Any] = {"required": parameter.default is parameter.empty}
    for mark in marks:
        if isinstance(mark, dict):
            settings |= mark
    if kind is bool:
        settings["is_flag"] = True
    else:
        settings["type"] = types[0] if types else _click_type(kind)
        if parameter.default not in (parameter.empty, None, ()):
            settings["default"] = parameter.default
    if parameter.kind is not parameter.KEYWORD_ONLY:
        settings["nargs"] = -1 if many else 1
        settings["metavar"] = texts[0] if texts else None
        return click.Argument([parameter.name], **settings)
    named = [text for text in texts if text.startswith("--")]
    helps = [about, *(text for text in texts if not text.startswith("--"))]
    option, _, placeholder = (named[0] if named else option_name(parameter.name)).partition(" ")
    return click.Option(
        [option, parameter.name], help=next(filter(None, helps), None), multiple=many,
        metavar=placeholder or None, show_default="default" in settings, **settings,
    )  # fmt: skip


def option_name(name: str) -> str:
    """How an option is typed: ``--no-wait`` for ``no_wait``."""
    return "--" + name.replace("_", "-")


def _unwrapped(hint: Any) -> tuple[Any, list[Any], bool]:
    """The type of one value, what it is annotated with, the innermost last, and if many come."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        kind, marks, many = _unwrapped(inside[0])
        return kind, [*inside[1:], *marks], many
    if origin in (Union, UnionType):
        return _unwrapped(next(part for part in inside if part is not type(None)))
    if origin is tuple and inside[-1] is Ellipsis:
        kind, marks, _ = _unwrapped(inside[0])
        return kind, marks, True
    return hint, [], False


def _click_type(kind: Any) -> Any:
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    return click.Path(path_type=Path) if kind is Path else kind
