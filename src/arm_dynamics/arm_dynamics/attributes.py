# SPDX-License-Identifier: Apache-2.0
"""Objects refuse attributes and arguments that are not theirs, and say which are meant.

Python sets any attribute of any object: ``simulator.dt = 0.01`` would change nothing of what was
built for another dt, without a word.
"""

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass
from functools import wraps
from inspect import signature
from reprlib import Repr
from typing import Any, dataclass_transform

from arm_dynamics.exceptions import (
    ELSEWHERE,
    NotAssignable,
    UnknownArgument,
    did_you_mean,
    known_names,
)


def sealed[C](cls: type[C]) -> type[C]:
    """Class decorator: after construction, public attributes of objects cannot be set.

    Methods may set private ones, and public ones that the class annotates or that are properties
    with a setter. The class attribute ``_instead`` maps names, separated by spaces, to what to do
    instead; ``_parts`` names attributes whose own are suggested for those that an object lacks.
    Subclasses are not sealed, unless they are decorated, too.
    """
    target: Any = cls
    target.__getattr__, target.__init__ = _missing, with_arguments(target.__init__)
    if is_dataclass(cls):
        target.__setattr__ = _refuse_frozen
        return cls
    init = target.__init__

    @wraps(init)
    def initialize(self: Any, *args: Any, **kwargs: Any) -> None:
        init(self, *args, **kwargs)
        if type(self) is cls:
            object.__setattr__(self, "_sealed", True)

    target.__init__, target.__setattr__ = initialize, _refuse_sealed
    target._sealed, target._parts = False, getattr(cls, "_parts", ())
    return cls


def with_values[T](original: T, **values: object) -> T:
    """Copy of a sealed object in which some attributes have other values."""
    other = copy(original)
    vars(other).update(values)
    return other


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen[C](cls: type[C]) -> type[C]:
    """Class decorator: a frozen dataclass that is ``sealed``, with a short ``repr`` of arrays."""
    own = "__repr__" in vars(cls)
    target: Any = sealed(dataclass(frozen=True)(cls))
    if not own and any("Array" in str(item.type) for item in fields(target)):
        target.__repr__ = brief
    return cls


class _Brief(Repr):
    """Values of one line; of arrays that are not short, the shape."""

    def repr_ndarray(self, array: Any, _: int) -> str:
        short = array.ndim < 2 and array.size < 10 and array.dtype.kind == "f"
        numbers = ", ".join(f"{x:.4g}" for x in array.flat) if short else ""
        return f"[{numbers}]" if short else f"array of shape {array.shape}"


_BRIEF = _Brief(maxother=60, maxstring=60)


def brief(instance: Any) -> str:
    """The ``repr`` of a dataclass, in lines."""
    shown = [item for item in fields(instance) if item.repr and item.name[0] != "_"]
    values = ((item.name, _BRIEF.repr(getattr(instance, item.name))) for item in shown)
    lines = (f"\n  {name}={' '.join(value.split())}" for name, value in values)
    return f"{type(instance).__name__}({','.join(lines)})"


def with_arguments[**P, R](method: Callable[P, R]) -> Callable[P, R]:
    """Decorator: keywords that the method lacks are refused by ``UnknownArgument``."""

    @wraps(method)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return method(*args, **kwargs)
        except TypeError as error:
            check_arguments(args[0], method, kwargs)
            if (text := str(error)).startswith(method.__qualname__):
                error.args = (text.replace(method.__qualname__, _qualname(args[0], method), 1),)
            raise

    return call


def check_arguments(owner: object, method: Callable[..., Any], keywords: Iterable[str]) -> None:
    """Refuse keywords that a method, or the constructor, lacks."""
    parameters = [*signature(method).parameters.values()][1:]
    takes_any = any(x.kind is x.VAR_KEYWORD for x in parameters)
    names = [] if takes_any else [x.name for x in parameters if x.kind is not x.VAR_POSITIONAL]
    for name in set(keywords) - set(names) if names else ():
        called = _qualname(owner, method).removesuffix(".__init__")
        near = did_you_mean(name, names) or _hint(owner, name)
        near = near or f"; allowed: {known_names(names)}"
        raise UnknownArgument(f"{called} has no argument '{name}'{near}") from None


def _qualname(owner: object, method: Callable[..., Any]) -> str:
    return f"{type(owner).__name__}.{method.__name__}"


def _missing(self: Any, name: str) -> Any:
    """``__getattr__``: the error of an attribute that is missing, with what may be meant."""
    cls, near = type(self), ""
    if name[0] != "_" and not hasattr(cls, name):  # else it is Python's error, or a property's
        others = {x: "" for x in ELSEWHERE if x.startswith("arm_")}
        for part in reversed(cls._parts if getattr(self, "_sealed", False) else ()):
            others |= dict.fromkeys(dir(getattr(self, part)), f"{part}.")
        near = (
            f"; did you mean '{others[name]}{name}'?"
            if name in others
            else did_you_mean(name, [x for x in dir(self) if x[0] != "_"], others)
        ) or _hint(self, name)
    if not near:
        return object.__getattribute__(self, name)
    raise AttributeError(f"{cls.__name__} has no attribute '{name}'{near}", obj=self)


def _refuse_sealed(self: Any, name: str, value: object) -> None:
    """``__setattr__`` of other sealed classes: it refuses what their constructor has set."""
    cls = type(self)
    if name[0] != "_" and self._sealed:
        if isinstance(attribute := getattr(cls, name, None), property):
            settable = attribute.fset is not None
        else:
            settable = any(name in vars(base).get("__annotations__", ()) for base in cls.__mro__)
        if not settable:
            instead = f"build another {cls.__name__}({', '.join(signature(cls).parameters)})"
            raise not_assignable(self, name, vars(self), instead)
    object.__setattr__(self, name, value)


def _refuse_frozen(self: Any, name: str, value: object) -> None:
    """``__setattr__`` of frozen dataclasses; a class that extends one may add attributes."""
    names = [item.name for item in fields(self)]
    if "__setattr__" in vars(type(self)) or name in names:
        instead = f"dataclasses.replace changes a copy: {known_names(names, 8)}"
        raise not_assignable(self, name, names, instead)
    object.__setattr__(self, name, value)


def not_assignable(obj: object, name: str, names: Iterable[str], instead: str) -> NotAssignable:
    """The error for an attribute that cannot be set, with what to do instead.

    ``names`` are attributes that the object has besides those of its class.
    """
    cls, hint = type(obj), _hint(obj, name)
    public = [other for other in {*dir(cls), *names} if not other.startswith("_")]
    if name in public:
        return NotAssignable(f"{cls.__name__}.{name} cannot be set{hint or f'; {instead}'}")
    near = hint or did_you_mean(name, public) or f"; {instead}"
    return NotAssignable(f"{cls.__name__} has no attribute '{name}'{near}")


def _hint(obj: object, name: str) -> str:
    """What to do instead, as the end of a message."""
    hints = getattr(type(obj), "_instead", {}).items()
    return next((f"; {text}" for names, text in hints if name in names.split()), "")
