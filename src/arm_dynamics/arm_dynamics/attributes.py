# SPDX-License-Identifier: Apache-2.0
"""Objects refuse to be given attributes that are not theirs, or that are fixed.

Python sets any attribute of any object: ``simulator.dt = 0.01`` would change nothing of what was
built for another dt, without a word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, is_dataclass
from functools import wraps
from inspect import signature
from typing import Any, dataclass_transform

from arm_dynamics.exceptions import NotAssignable, did_you_mean, known_names


def sealed[C](cls: type[C]) -> type[C]:
    """Class decorator: after construction, public attributes of objects cannot be set.

    Methods may set private ones, and public ones that the class annotates or that are properties
    with a setter. The class attribute ``_instead`` maps names, separated by spaces, to what to do
    instead. Subclasses are not sealed, unless they are decorated, too.
    """
    made: Any = cls
    if is_dataclass(cls):
        made.__setattr__ = _refuse
    else:
        made.__init__, made.__setattr__ = _sealing(cls, made.__init__), _refuse_once_sealed
        made._sealed = False
    return cls


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen[C](cls: type[C]) -> type[C]:
    """Class decorator: a frozen dataclass that is ``sealed``."""
    return sealed(dataclass(frozen=True)(cls))


def _sealing(cls: type, init: Callable[..., None]) -> Callable[..., None]:
    @wraps(init)
    def initialize(self: Any, *args: Any, **kwargs: Any) -> None:
        init(self, *args, **kwargs)
        if type(self) is cls:
            object.__setattr__(self, "_sealed", True)

    return initialize


def _refuse_once_sealed(self: Any, name: str, given: object) -> None:
    if name[0] != "_" and self._sealed and not _settable(type(self), name):
        cls, arguments = type(self), ", ".join(signature(type(self)).parameters)
        raise not_assignable(self, name, vars(self), f"build another {cls.__name__}({arguments})")
    object.__setattr__(self, name, given)


def _settable(cls: type, name: str) -> bool:
    if isinstance(found := getattr(cls, name, None), property):
        return found.fset is not None
    return any(name in vars(base).get("__annotations__", ()) for base in cls.__mro__)


def _refuse(self: Any, name: str, given: object) -> None:
    """Of frozen dataclasses; a class that extends one may have further attributes."""
    names = [item.name for item in fields(self)]
    if "__setattr__" in vars(type(self)) or name in names:
        instead = f"dataclasses.replace changes a copy: {known_names(names, 8)}"
        raise not_assignable(self, name, names, instead)
    object.__setattr__(self, name, given)


def not_assignable(what: object, name: str, names: Iterable[str], instead: str) -> NotAssignable:
    """The error for an attribute that cannot be set.

    Args:
        what: The object.
        name: Name of the attribute.
        names: Attributes that the object has besides those of its class.
        instead: What to do instead, where the class does not say it.
    """
    cls, hints = type(what), dict[str, str]()
    for keys, text in getattr(cls, "_instead", {}).items():
        hints |= dict.fromkeys(keys.split(), text)
    known = [other for other in {*dir(cls), *names} if not other.startswith("_")]
    if name in known:
        return NotAssignable(f"{cls.__name__}.{name} cannot be set; {hints.get(name, instead)}")
    near = f"; {hints[name]}" if name in hints else did_you_mean(name, known) or f"; {instead}"
    return NotAssignable(f"{cls.__name__} has no attribute '{name}'{near}")
