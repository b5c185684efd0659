# SPDX-License-Identifier: Apache-2.0
"""Ticks of a scene with contacts: smooth pieces between touch-downs, lift-offs, stops and starts.

Between two such instants each contact is apart, slides or sticks, and the equation is as smooth as
without contacts, so the method keeps its order; the instants themselves are located to rounding.
Joints with dry friction have their events in the same way (``dry_friction.py``).
Event-driven treatment: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996.
"""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np

from arm_dynamics.dynamics import Dynamics
from arm_dynamics.kernel import Kernel, check_forward
from arm_dynamics.laws.contact import ContactPoint
from arm_dynamics.model import Array
from arm_sim.actuation import CompiledControl, actuation
from arm_sim.adaptive import SubstepControl
from arm_sim.choice import Choice
from arm_sim.contact_driver import EVENTS, INSIDE, ContactMemory, contact_driver
from arm_sim.contact_impact import MOST_REBOUNDS, impact
from arm_sim.contact_modes import Modes, Trouble
from arm_sim.contact_newton import Answer
from arm_sim.contact_pieces import Pieces
from arm_sim.integrators import build_attempt, build_step
from arm_sim.plant import Plant
from arm_sim.stepper import library_function, pointer, row_stride


class ContactStepper:
    """Event-driven steps; see ``Stepper`` for the interface.

    What follows in Python runs on machines without a compiler; ``native/contact.c`` is its twin.

    Attributes:
        points: The contacts.
        modes: What they and the joints do at a state.
        memory: Losses, number of impacts, last trouble.
    """

    def __init__(
        self, plant: Plant, choice: Choice, backend: str, control: CompiledControl | None = None
    ) -> None:
        assert plant.contact is not None
        self._plant, self._n, self._dt = plant, plant.model.n, choice.dt
        contact, (smooth, name) = plant.contact, _flow_function(plant, choice)
        functions = [plant.rhs, smooth, actuation(plant, control), contact.geometry]
        functions += [contact.look, contact.inertia, contact.close]
        self.kernel = Kernel(functions, backend, contact_driver(plant, choice, functions))
        self.p = plant.parameters.nominal
        self.tick_operations = self.kernel.operations(name)
        self.points: tuple[ContactPoint, ...] = contact.points
        self.memory = ContactMemory()
        self._control: SubstepControl | None = None
        if choice.tolerance is not None:
            self._control = SubstepControl(choice.tolerance, choice.method.order)
        self._actuate = self.kernel.call("actuate")
        self.modes = Modes(plant, self.kernel)
        smooth_call, close = self.kernel.call(name), self.kernel.call("contact_close")
        self._pieces = Pieces(self.modes, smooth_call, close, self._control)
        self._check()

    def restart(self) -> None:
        """Forget what was learned from earlier steps."""
        self.memory.restart()
        if self._control is not None:
            self._control.restart()

    def roll(
        self, x: Array, command: Array, ticks: int, trace: Array, effort: Array, errors: Array
    ) -> int:
        """See ``Stepper.roll``."""
        self.memory.trouble = Trouble.NONE
        if self.kernel.library is not None:
            return self._by_library(x, command, ticks, trace, effort, errors)
        for k in range(ticks):
            effort[k] = self._actuate(x, command[k] if command.ndim == 2 else command)[0]
            after = x.copy()
            self.memory.trouble = self._tick(after, effort[k])
            if self.memory.trouble != Trouble.NONE:
                return k
            x[:] = trace[k] = after
            errors[k] = self._control.error if self._control is not None else 0.0
        return ticks

    def _by_library(
        self, x: Array, command: Array, ticks: int, trace: Array, effort: Array, errors: Array
    ) -> int:
        control = None if self._control is None else ctypes.byref(self._control)
        return library_function(self.kernel, "roll_contact")(
            pointer(x), pointer(command), row_stride(command), pointer(self.p),
            ctypes.c_double(self._dt), ctypes.c_longlong(ticks), pointer(trace), pointer(effort),
            pointer(errors), control, ctypes.byref(self.memory),
        )  # fmt: skip

    def parameters_at(self, x: Array, u: Array) -> Array:
        """See ``Stepper.parameters_at``; a contact that approaches counts as closed already."""
        p = self._blank()
        self.modes.settle(x, u, p)
        return p

    def _blank(self) -> Array:
        return np.concatenate([self.p, np.zeros(self.modes.length)])

    def _tick(self, x: Array, u: Array) -> Trouble:
        """Bring x to the end of a tick."""
        left, p, pieces, impacts = self._dt, self._blank(), self._pieces, 0
        ended = dict[int, Answer]()
        if self.modes.geometry(x)[0][::3].min() < -INSIDE:
            return Trouble.INSIDE
        for _ in range(EVENTS):
            lost = impact(self.modes, x, u, p, impacts < MOST_REBOUNDS)
            self.modes.still(x)
            if lost is None or not self.modes.settle(x, u, p, ended=ended):
                return Trouble.UNDETERMINED
            slow = pieces.slow(x, u, p, self._dt)
            if slow and not self.modes.settle(x, u, p, slow, ended):
                return Trouble.UNDETERMINED
            x[:] = pieces.aligned(x, p, slow)
            self.memory.loss += lost
            self.memory.impacts += lost > 0.0
            impacts += lost > 0.0
            anchor = self.modes.geometry(x)[0].reshape(-1, 3)[:, 1:].ravel()
            if pieces.is_off(x, p):
                x[:] = pieces.closed(x, p, anchor)
            if pieces.is_held(x, u, p):
                self.modes.velocity(x)[:] = 0.0
                return Trouble.NONE
            reach = min(left, pieces.reach(x, u, p, self._dt))
            length, calm = pieces.length(x, u, p, reach)
            after = pieces.flow(x, u, p, length)
            if after is None:
                return Trouble.NUMBERS
            ended = {} if calm else self.modes.ended(after, u, p)
            if not self._advance(x, u, p, length, anchor, after):
                return Trouble.NUMBERS
            if (calm and reach == left) or left - length <= 0.0:
                return Trouble.NONE
            left -= length
        return Trouble.EVENTS

    def _advance(
        self, x: Array, u: Array, p: Array, length: float, anchor: Array, after: Array
    ) -> bool:
        """Put x to the end of a piece, set right; False if that was no continuous motion."""
        rested = self._pieces.rest(self._pieces.closed(after, p, anchor), p)
        if rested is None:
            return False
        if self.memory.audit:
            self.memory.friction += self._pieces.friction_work(x, u, p, length)
        x[:] = rested
        return True

    def _check(self) -> None:
        """Hold the accelerations without contact against Pinocchio before anyone uses them."""
        call, p = self.kernel.call("rhs"), self._blank()

        def acceleration(q: Array, v: Array, tau: Array) -> Array:
            direction = self.modes.directions(p)
            direction[:] = np.sign(v[: len(direction)])
            return call(np.concatenate([q, v]), tau, p)[0][self._n :]

        check_forward(Dynamics(self._plant.model), acceleration)


def _flow_function(plant: Plant, choice: Choice) -> tuple[ca.Function, str]:
    if choice.tolerance is None:
        return build_step(choice.method, plant.rhs, plant.model.n), "step"
    return build_attempt(choice.method, plant.rhs, plant.model.n, plant.scale), "attempt"
