# SPDX-License-Identifier: Apache-2.0
"""A simulated robot arm: integrates M q̈ + C q̇ + G + F = τ tick by tick."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed, with_arguments
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.dynamics.arm_models import arm_model
from arm_dynamics.exceptions import choices, not_copied
from arm_dynamics.scene.constraint import label, switchable
from arm_dynamics.scene.load import SceneSource, naming
from arm_dynamics.trajectory.reference import Motion
from arm_sim.derivatives import Derivatives
from arm_sim.imperfections import delivered
from arm_sim.inputs import scene_name, tick_count
from arm_sim.integrators.selection import Choice, choose
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.admissible_states import (
    admissible_state,
    close_loops,
    warn_of_closing,
    warn_of_degrees,
    warn_of_speeds,
)
from arm_sim.plant.parameters import CONSTRAINTS, EXTERNAL
from arm_sim.plant.plant import Plant
from arm_sim.progress import Progress
from arm_sim.recording.recording import Recording
from arm_sim.servo import JointCommand
from arm_sim.servo.stability import instability
from arm_sim.simulation.compiled_scene import CompiledScene
from arm_sim.simulation.plan import Plan
from arm_sim.simulation.run import Control, driver_of
from arm_sim.simulation.simulated_arm import SimulatedArm
from arm_sim.simulation.trace import Trace
from arm_sim.state import State
from arm_sim.stepping.contact_forces import ContactForce, contact_forces
from arm_sim.stepping.rollouts.batch import Batch
from arm_sim.stepping.stepper import Stepper

if TYPE_CHECKING:
    from arm_dynamics.control.controller import AnyController

TICKS_PER_PART = 2000  # of a run that is recorded in a file

_log = logging.getLogger(__name__)


def _of_derivatives[**P, R](
    method: Callable[Concatenate[Derivatives, P], R],
) -> Callable[Concatenate[Simulator, P], R]:
    """A method of ``Derivatives`` as one of a simulator, whose present values it uses."""

    @with_arguments
    @wraps(method)
    def call(simulator: Simulator, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(simulator.arm.compiled.derivatives, *args, **kwargs)

    return call


@sealed
class Simulator:
    """Simulated arm; keep one instance per thread.

    Args:
        scene: A scene, anything ``load_scene`` accepts, or an existing arm model.
        integrator: Name of a method, or ``auto``; None for the scene's, else ``auto``.
        dt: Length of a tick in [s], for which a torque is held; None for the scene's.
        tolerance: Turns on error control: largest scaled error |e| / (1 + |x|) of each sub-step
            inside a tick.
        backend: ``auto``, ``native`` (compiled) or ``vm`` (CasADi's virtual machine).

    Attributes:
        n: Degrees of freedom.
        joint_names: Order of every vector.
        z_names: Names of the internal states z of drives and friction, with joint and unit.
        dt: Length of a tick in [s].
        arm: The arm that moves, for loops that need no ``State`` of each tick.

    Raises:
        InvalidInput: If the method is unknown, or dt or tolerance is out of range.
        SceneError: If the scene cannot be used.
        KernelError: If the generated equations disagree with Pinocchio.
    """

    _instead = {
        "dt timestep integrator method tolerance choice": "build another Simulator(scene, dt=…, "
        "integrator=…, tolerance=…)",
        "q v z x q0 v0 state position velocity qpos": "set_state(q=…, v=…) or reset(q=…, v=…)",
        "time t": "reset() begins at zero",
        "plot animate save": "run(…) returns a Recording, which has it",
        "wrench apply_wrench external_force apply_force xfrc_applied": "step(tau + "
        "dynamics.jacobian(q, frame).T @ wrench), of a wrench (force, moment) in the world",
        "tau effort torque command control": "step(tau), or run(duration, control)",
        "gravity mass payload payloads friction damping viscous coulomb external": "set_parameter("
        "name, value), where the scene's key 'tunable' lists it; else build another Simulator, of "
        "a changed scene",
    }
    _parts = "state", "dynamics", "choice", "model"

    @one_at_a_time
    def __init__(
        self, scene: SceneSource | ArmModel, integrator: str | None = None,
        dt: float | None = None, tolerance: float | None = None, backend: str = "auto",
    ) -> None:  # fmt: skip
        model = arm_model(scene)
        with naming(scene):
            plant = Plant(model)
            choice = choose(plant, integrator, dt, tolerance)
            compiled = CompiledScene.choose(plant, choice, backend)
        if unstable := instability(model, choice.dt):
            _log.warning("%s", unstable)
        self.n, self.joint_names, self.dt = model.n, model.joint_names, choice.dt
        self.z_names = plant.laws.names
        self.arm = SimulatedArm(compiled, scene_name(scene))
        self.reset()

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse to be copied or pickled.

        Raises:
            ArmError: Always; it says what to do instead.
        """
        raise not_copied(self, "build another one of the same scene, and give it this one's state")

    def __repr__(self) -> str:
        """The arm, the method and the time."""
        head, choice = repr(self.dynamics).removeprefix("<Dynamics").removesuffix(">"), self.choice
        tolerance = "" if choice.tolerance is None else f", tolerance {choice.tolerance:g}"
        method = f"{choice.method.name}, dt {self.dt:g} s{tolerance}"
        return f"<Simulator{head}; {method}; t = {self.state.time:.6g} s>"

    @property
    def model(self) -> ArmModel:
        """The arm as built, without later tuning; see ``dynamics.model``."""
        return self.arm.plant.model

    @property
    def state(self) -> State:
        """The current state; read-only arrays that later steps do not change."""
        return self.arm.state

    @property
    def choice(self) -> Choice:
        """Method, tick and tolerance in use, and why."""
        return self.arm.compiled.choice

    @property
    def measured(self) -> State:
        """The state as measured by the scene's sensors; without sensors, the exact state.

        States z have no sensors and are exact.
        """
        return self.arm.measured

    @property
    def held_constraints(self) -> tuple[str, ...]:
        """Names of the active constraints."""
        return self.arm.held_constraints

    @property
    def effort(self) -> Array:
        """Torque that acted in the last tick, limits applied, in [N m] or [N], shape (n,).

        For a drive: its torque on the joint at the end of the tick.
        """
        return self.arm.effort

    @property
    def impacts(self) -> int:
        """Impacts of contacts, and of joints on their stops, since the last reset."""
        return int(self._stepper.report.impacts)

    @property
    def stop_torque(self) -> Array:
        """Torques of the stops on the joints under the last command, shape (n,).

        In [N m] or [N]: positive at a lower stop, negative at an upper one, zero elsewhere. A part
        that static friction may bear is included.
        """
        arm, stepper = self.arm, self._stepper
        return stepper.reactions.of_stops(arm.x, arm.acted, stepper.p)

    @property
    def dynamics(self) -> Dynamics:
        """Numeric dynamics of the arm as it is now, by Pinocchio.

        Under its current gravity, payloads, viscous friction, external torques and constraints.
        """
        return self.arm.compiled.present.with_external(self._stepper.p)

    @property
    def plan(self) -> Plan:
        """The parts that a tick computes and skips, with reasons; print it to read it."""
        return self.arm.compiled.plan

    @property
    def _stepper(self) -> Stepper:
        return self.arm.compiled.stepper

    def step(self, tau: ArrayLike | JointCommand) -> State:
        """Advance one tick with the torque held.

        Args:
            tau: Joint torques in [N m] or [N], or the command of a joint's drive, shape (n,);
                clipped at the limits. Or a ``JointCommand``: positions and velocities.
                With ``commands`` in the scene it acts when it arrives.

        Returns:
            The state at the end of the tick.

        Raises:
            InvalidInput: If ``tau`` has the wrong shape or is not finite.
            SimulationDiverged: If the tick gives numbers that are not finite; the state is kept.
        """
        return self.arm.step(tau)

    @with_arguments
    def run(
        self,
        duration: float,
        control: Control | CompiledControl | AnyController | ArrayLike | None = None,
        reference: Motion | None = None,
    ) -> Recording:
        """Advance by a duration and record every tick.

        Args:
            duration: In [s]; rounded to whole ticks, with a warning.
            control: None for no torque, torques of shape (n,) to hold, a table of shape
                (steps, n), a compiled controller, a controller (an object with
                ``torque(state, reference)``), or a function of the state that returns torques;
                positions and velocities as ``JointCommand``, held, a table or a function's. All
                but controllers, functions and servos run in compiled code; controllers and
                functions receive the state as measured by the scene's sensors.
            reference: Reference of a controller from now on, such as
                ``trajectory.quintic(…)``; None: stay where it is.

        After two seconds progress is shown on a terminal and in a notebook, and logged elsewhere.

        Returns:
            The motion, starting with the current state.

        Raises:
            InvalidInput: If an argument is not allowed, or the recording would take more than half
                of the available memory; the state is kept.
            SimulationDiverged: If the state becomes non-finite; it has the recording so far.
            KeyboardInterrupt: After Ctrl-C; the state is that after the last whole tick, and the
                exception has the recording so far, as ``recording``.
        """
        ticks = tick_count(duration, self.dt)
        with Progress(ticks * self.dt) as progress:
            driver = driver_of(self.arm, control, reference, ticks)
            motion, stop = driver.drive(Trace(self.arm, ticks, progress))
        if isinstance(stop, KeyboardInterrupt):
            vars(stop)["recording"] = motion
            stop.add_note(
                f"interrupted at t = {self.state.time:.6g} s: the simulator has this state, "
                "and the exception's attribute 'recording' the motion until then"
            )
        if stop is not None:
            raise stop
        return motion

    @with_arguments
    def record(
        self,
        path: str | os.PathLike[str],
        duration: float,
        control: Control | CompiledControl | AnyController | ArrayLike | None = None,
        reference: Motion | None = None,
    ) -> Path:
        """Advance by a duration and record every tick in a file, not in memory.

        If it is broken off, by Ctrl-C, because the state becomes non-finite, or by an error of the
        controller, the file is complete up to there. ``Recording.load`` reads it.

        Args:
            path: A new file (``.mcap``), or a new folder, for a bag; see ``Recording.save``.
            duration: As for ``run``.
            control: As for ``run``.
            reference: As for ``run``.

        Returns:
            Path of the file or folder.

        Raises:
            InvalidInput: If an argument is not allowed, or the path exists; the state is kept.
            SimulationDiverged: If the state becomes non-finite.
            NotWritten: If the system does not let it be written.
        """
        from arm_sim.recording.files import Stream  # imports libraries that a run does not require

        ticks = tick_count(duration, self.dt)
        driver = driver_of(self.arm, control, reference, ticks)
        with Progress(ticks * self.dt) as progress, Stream(path) as stream:
            for start in range(0, max(ticks, 1), TICKS_PER_PART):
                trace = Trace(self.arm, min(TICKS_PER_PART, ticks - start), progress, start)
                part, stop = driver.drive(trace)
                stream.append(part, part.tau)
                if stop is not None:
                    raise stop
        return stream.path

    @with_arguments
    def reset(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, z: ArrayLike | None = None
    ) -> State:
        """Reset the simulation to time zero.

        Args:
            q: Joint positions in [rad] or [m], shape (n,); None for the scene's initial ones.
            v: Joint velocities in [rad/s] or [m/s], likewise.
            z: Internal states, shape (nz,); None for those consistent with q and v.

        Raises:
            InvalidInput: If a shape or value is not allowed; the state stays.
        """
        hold = self.model.held_at_start if q is None and v is None else ()
        q, v = self.model.q0 if q is None else q, self.model.v0 if v is None else v
        x = self._find_state(q, v, z, self.held_constraints, hold)
        self.arm.restore(x, self._stepper.p, 0)
        return self.state

    @with_arguments
    def set_state(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, z: ArrayLike | None = None
    ) -> State:
        """Set the state without changing the time.

        Args:
            q: Joint positions in [rad] or [m], shape (n,); None keeps them.
            v: Joint velocities in [rad/s] or [m/s], shape (n,); None keeps them.
            z: States of drives and friction, shape (nz,); None: those consistent with q and v.
        """
        q, v = self.state.q if q is None else q, self.state.v if v is None else v
        self.arm.place(self._find_state(q, v, z, self.held_constraints))
        return self.state

    def _find_state(self, q: Any, v: Any, z: Any, names: Any, hold: Sequence[int] = ()) -> Array:
        """The ``admissible_state``, with warnings of what is unlikely to be meant."""
        x = admissible_state(self.arm.plant, q, v, z, names, hold)
        warn_of_closing(self.arm.plant, q, x[: self.n])
        warn_of_speeds(self.arm.plant, x[self.n : 2 * self.n])
        warn_of_degrees(self.arm.plant, x[: self.n], self.model.q0, self.state.q)
        return x

    def set_parameter(self, name: str, value: Any) -> None:
        """Change a tunable quantity of the scene (see ``Parameter``), or raise InvalidInput."""
        merged = self.arm.plant.parameters.merged({name: value}, self._stepper.p)
        if merged.ndim != 1:
            raise InvalidInput(f"{name} has shape {np.shape(value)}; expected one row")
        self._stepper.p[:] = merged

    @with_arguments
    def rollout(
        self, q0: ArrayLike, v0: ArrayLike, tau: ArrayLike, steps: int, *,
        parameters: dict[str, Any] | None = None, last_only: bool = False,
        threads: int | None = None, lanes: int | None = None,
    ) -> Array:  # fmt: skip
        """Simulate many arms at once; the simulator's own state does not change.

        Args:
            q0: Initial positions in [rad] or [m], shape (b, n).
            v0: Initial velocities in [rad/s] or [m/s], shape (b, n).
            tau: Torques in [N m] or [N], shape (n,), (b, n) or (b, steps, n); delays and losses
                are drawn for each arm; those of the first are the simulator's.
            steps: Ticks to advance.
            parameters: Tunable quantities by name, shape (size,) or (b, size).
            last_only: Whether to return only the last states.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register: 8, 4, 2 or 1; None for the widest there is, under
                error control and with dry friction or contact only where arms and steps are many.
                Results do not depend on it.

        Returns:
            States (q, v), shape (b, steps + 1, 2n), or (b, 2n) if ``last_only``; NaN from where an
            arm diverges. Internal states z start as after a reset and are not returned.

        Raises:
            InvalidInput: If a shape or value is not allowed.
        """
        plant = self.arm.plant
        p = plant.parameters.merged(parameters or {}, self._stepper.p)
        batch = Batch.of(plant, q0, v0, tau, steps, p, last_only)
        batch = replace(batch, tau=delivered(self.model.scene, self.dt, batch.tau))
        return self.arm.compiled.rollouts.run(batch, threads, lanes)

    linearize = _of_derivatives(Derivatives.linearize)
    linearize_many = _of_derivatives(Derivatives.linearize_many)
    jvp = _of_derivatives(Derivatives.jvp)
    vjp = _of_derivatives(Derivatives.vjp)
    rollout_jvp = _of_derivatives(Derivatives.rollout_jvp)
    rollout_gradient = _of_derivatives(Derivatives.rollout_gradient)

    def multipliers(self) -> Array:
        """λ under the last torque, shape (m,); see ``Dynamics.constrained_forward``."""
        state, names = self.state, self.held_constraints
        outside = self.arm.plant.parameters.of(EXTERNAL, self._stepper.p)
        tau = self.effort + outside if outside.size else self.effort
        if self.arm.plant.eventful and self.arm.plant.constrained:
            reactions, p = self._stepper.reactions, self._stepper.p
            tau = tau + reactions.beside_bilateral(self.arm.x, self.arm.acted, p)
        return self.dynamics.constrained.without_sticking(state.q, state.v, tau, names)[1]

    def set_constraint(self, name: str, on: bool) -> State:
        """Switch a constraint that the scene declares switchable.

        A constraint that is switched on is enforced immediately: velocities across it are lost, as
        in an impact without restitution, and a position that violates it is moved to the nearest
        one that satisfies it.

        Args:
            name: Name of the constraint.
            on: Whether it is active from now on.

        Returns:
            The state, time unchanged.

        Raises:
            InvalidInput: If the constraint does not exist or is not switchable; the state is kept.
            ConstraintError: If it cannot be closed from here; state and constraint are kept.
        """
        constraints = self.model.scene.constraints
        places = [label(constraints[i], i) for i in switchable(constraints)]
        if name not in places:
            raise InvalidInput(
                f"constraint '{name}' cannot be switched; switchable: {choices(name, places)}"
            )
        names = {*self.held_constraints, name} if on else {*self.held_constraints} - {name}
        n, x = self.n, close_loops(self.arm.plant, self.arm.x, names)
        x = self._find_state(x[:n], x[n : 2 * n], x[2 * n :], names)
        self.set_parameter(CONSTRAINTS, [float(place in names) for place in places])
        self.arm.place(x)
        return self.state

    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the contacts at the current state, under the torque of the last tick.

        Returns:
            One for each contact, in the order of the scene.

        Raises:
            InvalidInput: If the scene has no contact.
        """
        return contact_forces(self.arm.plant, self._stepper, self.arm.x, self.arm.acted)
