# SPDX-License-Identifier: Apache-2.0
"""User-defined controllers: loaded by name, constructed with arguments they need, and checked.

The contract is that of ``Controller``: an object with ``torque(state, reference)``, and with
``restart()`` if it has a memory. ``construct`` wraps it in ``CheckedController``, so that its
exceptions and results never reach an arm unchecked.
"""

from __future__ import annotations

import inspect
import re
import reprlib
import sys
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array, all_finite, read_only
from arm_dynamics.attributes import sealed
from arm_dynamics.control.controller import ArmState, CheckedState, Controller, checked
from arm_dynamics.control.law import Law, Parts, Wrapper
from arm_dynamics.exceptions import (
    ControllerFailed,
    InvalidInput,
    KernelError,
    choices,
    known_names,
)
from arm_dynamics.trajectory.reference import Reference

_LIBRARY_FILE = re.compile(f".*importlib|{re.escape(str(Path(__file__).parents[1]))}/")
# A controller class, or a function that returns a controller; see ``make_controller``
Maker = Callable[..., Any]


def is_own(name: str) -> bool:
    """Whether a controller's name is of the form ``package.module:Class``."""
    return ":" in name


def load_controller(name: str) -> Maker:
    """Import a controller class.

    This runs the code of its module: call it only with names from the user of the program, never
    with names from the network.

    Args:
        name: ``package.module:Class``; the module is looked for where Python finds modules, and
            then in the present folder.

    Raises:
        InvalidInput: If there is no such module or class, or the module cannot be imported.
    """
    module_name, _, class_name = name.partition(":")
    if not all(part.isidentifier() for part in (*module_name.split("."), class_name)):
        raise InvalidInput(f"controller = {name!r}; expected the form package.module:Class")
    if "" not in sys.path:
        sys.path.append("")  # the last, so that it hides no other module
    try:
        module = import_module(module_name)
    except Exception as error:  # user code may raise anything
        raise InvalidInput(
            f"controller = {name!r}: importing '{module_name}' failed with {_cause(error)}; "
            "modules are looked for in installed packages, the folders of PYTHONPATH, and the "
            "present folder"
        ) from error
    maker: Maker | None = getattr(module, class_name, None)
    if maker is None or not callable(maker):
        classes = [n for n, x in vars(module).items() if inspect.isclass(x) and n[0] != "_"]
        raise InvalidInput(
            f"controller = {name!r}: '{module_name}' has no class '{class_name}'; "
            f"it has {choices(class_name, classes)}"
        )
    return maker


def construct(maker: Maker, offered: Mapping[str, Any], n: int) -> CheckedController:
    """Construct a user-defined controller with those of the offered arguments that it takes."""
    name = maker_name(maker)
    if not callable(maker):
        instead = "a name or a class is expected; objects are for Simulator(…).run(duration, …)"
        raise InvalidInput(f"controller = {maker!r}: {instead}")
    try:
        parameters = inspect.signature(maker).parameters.values()
        named = [p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
        missing = [p.name for p in named if p.name not in offered and p.default is p.empty]
        if missing:
            raise InvalidInput(
                f"controller {name} needs {known_names(missing)}; it is made with any of "
                f"{known_names(sorted(offered))}, other arguments need defaults"
            )
        control = maker(**{p.name: offered[p.name] for p in named if p.name in offered})
    except InvalidInput:
        raise
    except Exception as error:
        raise InvalidInput(f"controller {name} cannot be made: {_cause(error)}") from error
    return CheckedController(control, name, n)


def maker_name(maker: Maker) -> str:
    """The name of a class or function, for messages."""
    return str(getattr(maker, "__name__", type(maker).__name__))


def accepts(maker: Maker, argument: str) -> bool:
    """Whether a class or function takes an argument of this name."""
    return argument in inspect.signature(maker).parameters


@sealed
class CheckedController(Wrapper):
    """A user-defined controller whose results are checked.

    It receives read-only arrays. If it raises, or returns anything but n finite numbers, it has
    failed and is not called again until it is restarted. If it has a formula (see ``Law``), that
    is compiled as those of the suite are.

    Attributes:
        name: Its name, for messages.
    """

    def __init__(self, control: Controller[Any], name: str, n: int) -> None:
        """Take a controller and its name, for an arm of n joints.

        Raises:
            InvalidInput: If it has no method ``torque``, or if it has a formula whose tuning,
                memory or key cannot be used.
        """
        if not callable(getattr(control, "torque", None)):
            raise InvalidInput(
                f"controller {name} is of type {type(control).__name__}, which has no method "
                "torque(state, reference)"
            )
        try:
            law: Any = control if isinstance(control, Law) else None
            hash(None if law is None else law.key)
        except Exception as error:  # user code may raise anything
            raise InvalidInput(
                f"the key of controller {name} raised {_cause(error)}; a tuple of strings, "
                "numbers and the like is expected, or None"
            ) from error
        for key in () if law is None else ("tuning", "memory"):
            parts = getattr(law, key)
            if not isinstance(parts, tuple) or not all(isinstance(x, np.ndarray) for x in parts):
                raise InvalidInput(
                    f"controller {name}: {key} = {reprlib.repr(parts)}; a tuple of arrays is "
                    "expected"
                )
        super().__init__(control, n)
        self.name = name
        self._failed: ControllerFailed | None = None

    @property
    def friction_terms(self) -> str | None:
        """Friction that it leaves to ``FrictionFeedForward``, as its class says; None if silent.

        Raises:
            InvalidInput: If it says something else than ``all`` or ``dry``.
        """
        terms = getattr(self.control, "friction_terms", None)
        if terms not in (None, "all", "dry"):
            raise InvalidInput(
                f"controller {self.name}: friction_terms = {terms!r}; allowed: 'all', 'dry'"
            )
        return terms

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, tuning: Parts, memory: Parts
    ) -> tuple[Any, Parts]:
        """The controller's formula as an expression; see ``law.Law``.

        Raises:
            KernelError: If it does not take expressions, or its results have wrong shapes.
        """
        try:
            with warnings.catch_warnings():
                # CasADi's, of NumPy's functions of expressions: what comes of them is compared.
                warnings.simplefilter("ignore", FutureWarning)
                tau, after = self._law.formula(rigid, q, v, desired, tuning, memory)
            shapes = [part.shape for part in (tau, *after)]
        except Exception as error:  # user code may raise anything
            raise KernelError(
                f"the formula of controller {self.name} raised {_cause(error)}"
            ) from error
        if shapes != (expected := [part.shape for part in (q, *memory)]):
            raise KernelError(
                f"the formula of controller {self.name} returned torques and memory of shapes "
                f"{shapes}; expected {expected}"
            )
        return tau, after

    def restart(self) -> None:
        """Restart it, also after a failure."""
        self._failed = None
        try:
            super().restart()
        except Exception as error:
            self._fail(f"raised {_cause(error)} when restarted")

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], finite, of shape (n,).

        Raises:
            ControllerFailed: If it has failed, now or since it was restarted.
        """
        if self._failed is not None:
            raise self._failed
        q, v = checked(state, self._n)
        goal = Reference(*map(read_only, (reference.q, reference.v, reference.a)))
        try:
            tau = self.control.torque(CheckedState(read_only(q), read_only(v)), goal)
        except Exception as error:
            raise self._fail(f"raised {_cause(error)}") from error
        try:
            torques = np.array(tau, dtype=float)
        except (TypeError, ValueError):
            wrong = f"a {type(tau).__name__}"
        else:
            if torques.shape == (self._n,) and all_finite(torques):
                return torques
            wrong = f"shape {torques.shape}" if torques.shape != (self._n,) else f"{torques}"
        raise self._fail(f"returned {wrong}; finite numbers of shape ({self._n},) are expected")

    def _fail(self, reason: str) -> ControllerFailed:
        """The error of a controller that has failed, now and until it is restarted."""
        self._failed = ControllerFailed(f"controller {self.name} {reason}")
        return self._failed


def _cause(error: Exception) -> str:
    """An exception in one line, with its place in the file of the user."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    text = text if len(text) <= 300 else text[:299] + "…"
    own = [x for x in extract_tb(error.__traceback__) if not _LIBRARY_FILE.match(x.filename)]
    lines = [x.lineno for x in own if x.filename == own[0].filename]
    return f"{text} (line {lines[-1]} of '{own[0].filename}')" if own else text
