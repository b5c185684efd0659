# SPDX-License-Identifier: Apache-2.0
"""Ticks of a scene with contacts: smooth pieces between touch-downs, lift-offs, stops and starts.

Between two such instants each contact is apart, slides or sticks, and the equation is as smooth as
without contacts, so the method keeps its order; the instants themselves are located to rounding.
Joints with dry friction have their events in the same way (``dry_friction.py``).
Event-driven treatment: Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, 1996.
"""

from __future__ import annotations

import numpy as np

from arm_dynamics.codegen.kernel import check_forward
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.model.arm import Array
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.stepping.contact_driver import EVENTS, INSIDE, ContactMemory, contact_driver
from arm_sim.stepping.contact_impact import MOST_REBOUNDS, impact
from arm_sim.stepping.contact_modes import Modes, Trouble
from arm_sim.stepping.contact_newton import Answer
from arm_sim.stepping.contact_pieces import Pieces
from arm_sim.stepping.events import EventStepper


class ContactStepper(EventStepper):
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
        contact = plant.contact
        assert contact is not None
        more = [contact.geometry, contact.look, contact.inertia, contact.close]
        super().__init__(plant, choice, backend, control, more, contact_driver)
        self._plant, self.points = plant, contact.points
        self.memory: ContactMemory = ContactMemory()
        self.modes = Modes(plant, self.kernel)
        self._pieces = Pieces(self.modes, self._flow, self.kernel.call("contact_close"))
        self._check()

    def restart(self) -> None:
        """Forget what was learned from earlier steps."""
        super().restart()
        self.memory.restart()

    def parameters_at(self, x: Array, u: Array) -> Array:
        """See ``Stepper.parameters_at``; a contact that approaches counts as closed already."""
        p = self._blank()
        self.modes.settle(x, u, p)
        return p

    def _blank(self) -> Array:
        return np.concatenate([self.p, np.zeros(self.modes.length)])

    def _tick(self, x: Array, u: Array) -> Array | None:
        after = x.copy()
        self.memory.trouble = self._ended(after, u)
        return after if self.memory.trouble == Trouble.NONE else None

    def _ended(self, x: Array, u: Array) -> Trouble:
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
            after = self._flow.over(x, u, p, length)
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
