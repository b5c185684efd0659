# SPDX-License-Identifier: Apache-2.0
"""A simulated robot arm: integrates M q̈ + C q̇ + G + F = τ tick by tick."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from struct import Struct
from typing import Any, Concatenate

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.actuation import StateKind
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.wrappers import AnyController
from arm_dynamics.exceptions import choices
from arm_dynamics.model.arm import arm_model
from arm_dynamics.scene import Scene
from arm_dynamics.scene.constraint import label, switchable
from arm_dynamics.scene.load import SceneSource, naming
from arm_dynamics.trajectory.reference import Motion
from arm_sim.compiled_scene import CompiledScene
from arm_sim.derivatives import Derivatives
from arm_sim.exceptions import SimulationDiverged
from arm_sim.imperfections import Line, Measured, command_line, delivered, sensors_of
from arm_sim.inputs import (
    SaturationNotice,
    answers,
    named,
    row,
    tick_count,
    torque,
    torque_table,
    whole,
)  # fmt: skip
from arm_sim.integrators.selection import Choice, choose
from arm_sim.plan import Plan
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.placing import closed, constraint_hint, holding, placed
from arm_sim.plant.plant import Plant
from arm_sim.recording.changes import Changes
from arm_sim.recording.contents import BRAKES, FREE, SERVOS
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.origin import Origin, Physics
from arm_sim.recording.recording import Recording
from arm_sim.servo import JointCommand
from arm_sim.servo.stability import danger
from arm_sim.state import State, read_only
from arm_sim.stepping.contact_forces import ContactForce, contact_forces, trouble
from arm_sim.stepping.roll import Roll
from arm_sim.stepping.stepper import Stepper

Control = Callable[[State], Any]

_log = logging.getLogger(__name__)


def _differentiated[**P, R](
    method: Callable[Concatenate[Derivatives, P], R],
) -> Callable[Concatenate[Simulator, P], R]:
    """The same method of a simulator, from its state and scene."""

    @wraps(method)
    def derivative(self: Simulator, /, *args: P.args, **options: P.kwargs) -> R:
        return method(self.compiled.derivatives, *args, **options)

    return derivative


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
        source: Name or path of the scene; empty if it is not from a file.
        x: The current state (q, v, z), shape (nx,): a read-only view that steps change.
        acted: The current ``command``, likewise.
        hold: What held the arm in the last tick: ``FREE``, ``BRAKES`` or ``SERVOS``, see
            ``Recording``.
        notes: Current estimated error and number of time-stepped ticks, see ``State``, likewise.
        pointers: The tick for other compiled code, see ``passed``; None if the scene runs on the
            virtual machine. Replaced by ``use``.
        sensors: The scene's sensors; None if it has none.

    Raises:
        InvalidInput: If the method is unknown, or dt or tolerance is out of range.
        SceneError: If the scene cannot be used.
        KernelError: If the generated equations disagree with Pinocchio.
    """

    @one_at_a_time
    def __init__(
        self,
        scene: SceneSource | ArmModel,
        integrator: str | None = None,
        dt: float | None = None,
        tolerance: float | None = None,
        backend: str = "auto",
    ) -> None:
        model = arm_model(scene)
        self.source = named(scene)
        with naming(scene):
            plant = Plant(model)
            self.choice: Choice = choose(plant, integrator, dt, tolerance)
            compiled = CompiledScene(plant, self.choice, backend)
        if unstable := danger(model, self.choice.dt):
            _log.warning("%s", unstable)
        self.n, self.joint_names, self.dt = model.n, model.joint_names, self.choice.dt
        self.z_names = plant.laws.names if plant.laws else ()
        self.backend = backend
        self._x, self._command = np.zeros(plant.nx), np.zeros(self.n)
        self._q, self._v = self._x[: self.n], self._x[self.n : 2 * self.n]
        self._effort, self._notes = np.zeros((1, self.n)), np.zeros((1, 2))
        self._put = Struct(f"{self.n}d").pack_into
        self.x, self.acted = read_only(self._x), read_only(self._effort[0])
        self.notes, self.hold = read_only(self._notes[0]), FREE
        self._state: State | None = None
        self._step = 0
        self.pointers: Roll | None = None
        self._saturation = SaturationNotice(model)
        self.sensors = sensors_of(model.scene, self.joint_names, self.dt)
        self._line: Line[list[float] | JointCommand] | None = command_line(model.scene, self.dt)
        self._bind(compiled)
        self.reset()

    @property
    def compiled(self) -> CompiledScene:
        """Equations and compiled ticks, see ``use``."""
        return self._compiled

    @property
    def plant(self) -> Plant:
        """The equation of motion."""
        return self._compiled.plant

    @property
    def model(self) -> ArmModel:
        """The arm as built, without later tuning; see ``dynamics.model``."""
        return self._compiled.plant.model

    @property
    def step_count(self) -> int:
        """Ticks since the last reset."""
        return self._step

    @property
    def state(self) -> State:
        """The current state; read-only arrays that later steps do not change."""
        if (state := self._state) is None:
            notes = self._notes.tolist()[0]
            self._state = state = State.of(self._x, self.n, self._step, self.dt, *notes)
        return state

    @property
    def measured(self) -> State:
        """The state as measured by the scene's sensors; without sensors, the exact state.

        States z have no sensors and are exact.
        """
        state, n = self.state, self.n
        if self.sensors is None:
            return state
        told = read_only(self.sensors.said.copy())
        return replace(state, q=told[:n], v=told[n : 2 * n])

    @property
    def held_constraints(self) -> tuple[str, ...]:
        """Names of the active constraints."""
        return holding(self.plant, self._stepper.p)

    @property
    def effort(self) -> Array:
        """Torque that acted in the last tick, limits applied, in [N m] or [N], shape (n,).

        For a drive: its torque on the joint at the end of the tick.
        """
        return self.plant.joint_torque(self._x, self.command)

    @property
    def command(self) -> Array:
        """Command of the last tick, limits applied, shape (n,)."""
        return self.acted.copy()

    @property
    def parameters(self) -> Array:
        """Current tunable quantities, in the order of the plant's, shape (np,)."""
        return self._stepper.p.copy()

    @property
    def substep(self) -> float:
        """Sub-step that error control tries next in [s]; 0 if it is not known yet."""
        return self._stepper.substep

    @property
    def origin(self) -> Origin:
        """Scene, method and versions, to be stored with a recording."""
        choice, scene = self.choice, self.plant.model.scene
        return Origin(scene, choice.method.name, choice.dt, choice.tolerance, self.source)

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
        return self._stepper.stop_torque(self._x, self.command)

    @property
    def dynamics(self) -> Dynamics:
        """Numeric dynamics of the arm as it is now, by Pinocchio.

        Under its current gravity, payloads, viscous friction, external torques and constraints.
        """
        return self._compiled.present.tuned(self._stepper.p)

    @property
    def energy_account(self) -> EnergyAccount:
        """Computes the energy account of motions of this scene."""
        return self._compiled.energy_account

    @property
    def plan(self) -> Plan:
        """The parts that a tick computes and skips, with reasons; print it to read it."""
        return self._compiled.plan

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
        if isinstance(tau, JointCommand):
            next(tau.rows(1, self.n, self.dt))  # which checks the shape
            acts = self._arrived(tau)
        else:
            acts = self._arrived(torque(tau, self.joint_names))
        if isinstance(acts, JointCommand):
            self.follow(acts)
        else:
            self.advance(acts)
        return self.state

    def advance(self, tau: Sequence[float]) -> None:
        """As ``step`` for n finite numbers, for a loop that reads ``x``: no State is created.

        They act immediately: a loop that calls this implements delays of commands itself.
        """
        self._put(self._command, 0, *tau)
        self._advance()

    def follow(self, command: JointCommand) -> None:
        """As ``step`` for a command of shape (n,), for a loop that reads ``x``.

        The same object means the same command; another one, the next command of a stream. A joint
        that a servo holds at a position stays exactly at rest there.
        """
        servo, x, n = self._compiled.servo, self._x, self.n
        self._command[:] = servo.command(command, x, self._stepper.p, self._step)
        rest = self._compiled.rest
        held = self.hold == SERVOS and rest.knows(x, self._stepper.p)
        before = x.copy() if servo.at_rest and rest.slow(x) else None
        if before is None or not (held or self._balances(command)):
            self._advance(servo=True)
            return
        self._advance(servo=True)
        if rest.stays(before, x) if held else rest.slow(x):
            x[:n], x[n : 2 * n], self.hold = before[:n], 0.0, SERVOS

    def _balances(self, command: JointCommand) -> bool:
        """Whether the servos would hold the arm at rest where it is."""
        servo, rest, stepper = self._compiled.servo, self._compiled.rest, self._stepper
        still = rest.stopped(self._x)
        asked = servo.command(command, still, stepper.p, self._step)
        return rest.balanced(still, asked, stepper.p, stepper.slope)

    def lock(self) -> None:
        """Close the brakes: joints and motors stop at once, and drives are switched off."""
        self._x[self.n : 2 * self.n] = 0.0
        states = self.plant.laws.states if self.plant.laws else ()
        for k, state in enumerate(states, 2 * self.n):
            if state.kind in (StateKind.MOTOR_VELOCITY, StateKind.CURRENT):
                self._x[k] = 0.0
        self._effort[:], self._state = 0.0, None

    def stand(self) -> None:
        """Advance by a tick in which closed brakes hold every joint, see ``lock``."""
        self._step, self._state, self.hold = self._step + 1, None, BRAKES
        if self.sensors is not None:
            self.sensors.look(self._step, self._q, self._v, self._driving)

    @property
    def notices_cuts(self) -> bool:
        """Whether no command has been clipped at its limit yet, which would be logged."""
        return not self._saturation.said

    def passed(self, ticks: int) -> None:
        """Register ticks that other code executed by ``pointers``, as ``advance`` would have."""
        self._step, self._state, self.hold = self._step + ticks, None, FREE
        self._saturation.look(self._command, self._effort)

    def _advance(self, servo: bool = False) -> None:
        if self._tick() != 1:
            raise self._diverged()
        self._step, self._state, self.hold = self._step + 1, None, FREE
        self._saturation.look(self._command, self._effort, servo)
        if self.sensors is not None:
            self.sensors.look(self._step, self._q, self._v, self._driving)

    def run(
        self,
        duration: float,
        control: Control | CompiledControl | AnyController | ArrayLike | None = None,
        reference: Motion | None = None,
    ) -> Recording:
        """Advance by a duration and record every tick.

        Args:
            duration: In [s]; rounded to whole ticks.
            control: None for no torque, torques of shape (n,) to hold, a table of shape
                (ticks, n), a compiled controller, a controller (an object with
                ``torque(state, reference)``), or a function of the state that returns torques;
                positions and velocities as ``JointCommand``, held, a table or a function's. All
                but controllers, functions and servos run in compiled code; controllers and
                functions receive the state as measured by the scene's sensors.
            reference: Reference of a controller from now on, such as
                ``trajectory.quintic(…)``; None: stay where it is.

        Returns:
            The motion, starting with the current state.

        Raises:
            InvalidInput: If an argument is not allowed; the state is kept.
            SimulationDiverged: If the state becomes non-finite; it has the recording so far.
        """
        ticks = tick_count(duration, self.dt)
        if hasattr(control, "torque"):
            control = answers(control, reference, self.dynamics, self.measured)
        elif reference is not None:
            raise InvalidInput("a reference is for a controller with torque(state, reference)")
        time = np.asarray((self._step + np.arange(ticks + 1)) * self.dt, dtype=np.float64)
        x, command = np.empty((ticks + 1, self.plant.nx)), np.empty((ticks + 1, self.n))
        notes = np.empty((ticks + 1, 2))
        x[0], notes[0] = self._x, self._notes[0]
        trace, effort, later = x[1:], command[:-1], notes[1:]
        changes, substep = Changes(self), self.substep
        told = None if self.sensors is None else np.empty((ticks + 1, 3 * self.n))
        if self.sensors is not None and told is not None:
            told[0] = self.sensors.said
        if isinstance(control, CompiledControl):
            self._refuse_imperfections()
            stepper = self._compiled.controlled(control)
            substep = stepper.substep
            done = self._roll(stepper, control.reference(time[:-1]), trace, effort, later)
        elif isinstance(control, JointCommand):
            commands = control.rows(ticks, self.n, self.dt)
            done = self._run_function(lambda _: next(commands), x, effort, later, changes, told)
        elif callable(control):
            done = self._run_function(control, x, effort, later, changes, told)
        else:
            table = torque_table(control, ticks, self.joint_names, self.dt)
            if self._line is not None:
                rows = np.broadcast_to(table, (ticks, self.n))
                table = np.array([self._arrived(row, k) for k, row in enumerate(rows.tolist())])
                table = table.reshape(ticks, self.n)
            done = self._roll(self._stepper, table, trace, effort, later)
            self._saturation.look(table[:done] if table.ndim == 2 else table, effort[:done])
            self._update_sensors(trace[:done], effort[:done], told)
        command[done] = command[done - 1] if done else 0.0
        time, x, command, notes = (
            read_only(array[: done + 1]) for array in (time, x, command, notes)
        )
        q, v, z = np.split(x, (self.n, 2 * self.n), axis=1)
        compiled, origin = self._compiled, self.origin
        recording = Recording(
            time=time, q=q, v=v, z=z, command=command, error=notes[:, 0],
            time_stepped=notes[:, 1], joint_names=self.joint_names,
            p=changes.parameters(done + 1), origin=origin, held=self.held_constraints,
            jumps=changes.jumps(), hold=changes.hold(done + 1), substep=substep,
            physics=Physics.built(
                origin, compiled.plant, compiled.present, compiled.energy_account
            ),
            measured=None if told is None else Measured.of(told[: done + 1]),
        )  # fmt: skip
        if done < ticks:
            diverged = self._diverged()
            diverged.recording = recording
            raise diverged
        return recording

    def reset(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        z: ArrayLike | None = None,
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
        self._x[:] = placed(self.plant, q, v, z, self.held_constraints, hold)
        self._step, self._effort[:], self._notes[:] = 0, 0.0, 0.0
        self._compiled.restart()
        self._state = None
        self._begin_anew()
        return self.state

    def set_state(
        self,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        z: ArrayLike | None = None,
    ) -> State:
        """Set the state without changing the time.

        Args:
            q: Joint positions in [rad] or [m], shape (n,); None keeps them.
            v: Joint velocities in [rad/s] or [m/s], shape (n,); None keeps them.
            z: States of drives and friction, shape (nz,); None: those consistent with q and v.
        """
        q, v = self.state.q if q is None else q, self.state.v if v is None else v
        self._x[:] = placed(self.plant, q, v, z, self.held_constraints)
        self._state = None
        self._sense_anew()
        if self._compiled.has_servo:
            self._compiled.servo.restart()
        return self.state

    def restore(self, x: Array, p: Array, step: int, substep: float = 0.0) -> None:
        """Continue from a recorded state, bit for bit, without projecting it onto constraints.

        Args:
            x: The state (q, v, z), shape (nx,).
            p: Tunable quantities, shape (np,).
            step: Ticks since the last reset.
            substep: Value of ``substep``.

        Raises:
            InvalidInput: If a shape or value is not allowed; nothing changes.
        """
        x, p = row("x", x, self.plant.nx), row("p", p, len(self._stepper.p))
        whole("step", step, 0)
        self._compiled.restart()
        self._x[:], self._stepper.p[:], self._stepper.substep = x, p, substep
        self._step, self._effort[:], self._notes[:], self._state = step, 0.0, 0.0, None
        self._begin_anew()

    def imperfect(self, scene: Scene) -> None:
        """Use the sensors and commands of another scene with the same joints, and restart them.

        Raises:
            SceneError: If a filter's cut-off frequency is too high for this rate.
        """
        self.sensors = sensors_of(scene, self.joint_names, self.dt)
        self._line = command_line(scene, self.dt)
        self._begin_anew()

    def set_parameter(self, name: str, value: Any) -> None:
        """Change a tunable quantity of the scene (see ``Parameter``), or raise InvalidInput."""
        merged = self.plant.parameters.merged({name: value}, self._stepper.p)
        if merged.ndim != 1:
            raise InvalidInput(f"{name} has shape {np.shape(value)}; expected one row")
        self._stepper.p[:] = merged

    def rollout(
        self,
        q0: ArrayLike,
        v0: ArrayLike,
        tau: ArrayLike,
        steps: int,
        *,
        parameters: dict[str, Any] | None = None,
        last_only: bool = False,
        threads: int | None = None,
        lanes: int | None = None,
    ) -> Array:
        """Simulate many arms at once; the simulator's own state does not change.

        Args:
            q0: Initial positions in [rad] or [m], shape (b, n).
            v0: Initial velocities in [rad/s] or [m/s], shape (b, n).
            tau: Torques in [N m] or [N], shape (n,), (b, n) or (b, steps, n); delays and losses
                are drawn for each arm; those of the first are the simulator's.
            steps: Ticks to advance.
            parameters: Tunable quantities by name, shape (size,) or (b, size).
            last_only: Whether to return only the last states.
            threads: Cores to use; None for all.
            lanes: Arms in a vector register: 8, 4, 2 or 1; None for the widest there is, under
                error control and with dry friction or contact only where arms and steps are many.
                Results do not depend on it.

        Returns:
            States (q, v), shape (b, steps + 1, 2n), or (b, 2n) if ``last_only``; NaN from where an
            arm diverges. Internal states z start as after a reset and are not returned.

        Raises:
            InvalidInput: If a shape or value is not allowed.
        """
        p = self.plant.parameters.merged(parameters or {}, self._stepper.p)
        rollouts = self._compiled.rollouts
        batch = rollouts.batch(q0, v0, tau, steps, p, last_only)
        batch = replace(batch, tau=delivered(self.model.scene, self.dt, batch.tau))
        return rollouts.run(batch, threads, lanes)

    linearize = _differentiated(Derivatives.linearize)
    linearize_many = _differentiated(Derivatives.linearize_many)
    jvp = _differentiated(Derivatives.jvp)
    vjp = _differentiated(Derivatives.vjp)
    rollout_jvp = _differentiated(Derivatives.rollout_jvp)
    rollout_gradient = _differentiated(Derivatives.rollout_gradient)

    def multipliers(self) -> Array:
        """λ under the last torque, shape (m,); see ``Dynamics.constrained_forward``."""
        state, names = self.state, self.held_constraints
        outside = self.plant.parameters.of("external", self._stepper.p)
        tau = self.effort + outside if outside.size else self.effort
        if self.plant.eventful and self.plant.constrained:
            tau = tau + self._stepper.push(self._x, self.command)
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
            ConstraintError: If it cannot be closed from here; the state is kept.
        """
        constraints = self.model.scene.constraints
        places = [label(constraints[i], i) for i in switchable(constraints)]
        if name not in places:
            raise InvalidInput(
                f"constraint '{name}' cannot be switched; switchable: {choices(name, places)}"
            )
        names = {*self.held_constraints, name} if on else {*self.held_constraints} - {name}
        state = self.state
        x = closed(self.plant, np.concatenate([state.q, state.v]), tuple(names))
        self.set_parameter("constraints", [float(place in names) for place in places])
        return self.set_state(x[: self.n], x[self.n :], state.z)

    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the contacts at the current state, under the torque of the last tick.

        Returns:
            One for each contact, in the order of the scene.

        Raises:
            InvalidInput: If the scene has no contact.
        """
        return contact_forces(self.plant, self._stepper, self._x, self.command)

    def use(self, compiled: CompiledScene, **parameters: Any) -> None:
        """Continue with another compiled scene of the same states, between two ticks.

        Tunable quantities keep their values, except those given by name.

        Raises:
            InvalidInput: If a quantity is not tunable; nothing changes.
        """
        tuned, p = self.plant.parameters, self._stepper.p
        values = {name: tuned.of(name, p) for name in tuned.names} | parameters
        merged = compiled.plant.parameters.merged(values, compiled.stepper.p)
        compiled.stepper.p[:] = merged
        self._bind(compiled)

    def _bind(self, compiled: CompiledScene) -> None:
        self._compiled, self._stepper = compiled, compiled.stepper
        arrays = self._command, self._x[None].copy(), self._effort, self._notes
        self._tick = self._stepper.bound(self._x, *arrays)
        self.pointers = Roll.of(self._tick)

    def _roll(
        self, stepper: Stepper, command: Array, trace: Array, effort: Array, notes: Array
    ) -> int:
        done = stepper.roll(self._x, command, trace, effort, notes)
        if done:
            self._step += done
            self._effort[0], self._notes[0] = effort[done - 1], notes[done - 1]
            self._state = None
        return done

    def _run_function(
        self,
        control: Control,
        x: Array,
        effort: Array,
        notes: Array,
        changes: Changes,
        told: Array | None,
    ) -> int:
        for k in range(len(effort)):
            command = control(self.measured)
            changes.look(k, x)
            try:
                self.step(command)
            except SimulationDiverged:
                return k
            x[k + 1], effort[k], notes[k] = self._x, self._effort[0], self._notes[0]
            if self.hold != FREE:
                changes.held(k, self.hold)
            if self.sensors is not None and told is not None:
                told[k + 1] = self.sensors.said
        return len(effort)

    def _arrived[C: (list[float], JointCommand)](
        self, command: C, ahead: int = 0
    ) -> C | list[float] | JointCommand:
        """The effective command when ``command`` is sent, some ticks after the current one."""
        if self._line is None:
            return command
        return self._line.carry(self._step + ahead, command) or [0.0] * self.n

    @property
    def _driving(self) -> Array:
        return self._effort[0] if self.plant.torques is None else self.effort

    def _begin_anew(self) -> None:
        """Restart without commands in transit, and with settled sensors."""
        if self._line is not None:
            self._line.restart()
        self._sense_anew()

    def _sense_anew(self) -> None:
        if self.sensors is not None:
            self.sensors.restart(self._step, self._q, self._v, self._driving)

    def _update_sensors(self, trace: Array, command: Array, told: Array | None) -> None:
        """Update the sensors with ticks that were executed in one call."""
        if self.sensors is None or told is None:
            return
        n, first = self.n, self._step - len(trace) + 1
        effort = self.plant.joint_torque(trace, command)
        for k, x in enumerate(trace):
            self.sensors.look(first + k, x[:n], x[n : 2 * n], effort[k])
            told[k + 1] = self.sensors.said

    def _refuse_imperfections(self) -> None:
        if self.sensors is not None or self._line is not None:
            raise InvalidInput(
                "a compiled controller uses the true state without delay, but the scene has "
                "'sensors' or 'commands'; allowed: a controller that is a function of the state"
            )

    def _diverged(self) -> SimulationDiverged:
        state, choice = self.state, self.choice
        hint = constraint_hint(self.plant, state.q, state.v, self.held_constraints)
        return SimulationDiverged(
            f"tick {state.step + 1} (t = {state.time:.6g} s) cannot be computed with "
            f"{choice.method.name}{choice.remark}; the state before it is kept: largest |v| = "
            f"{abs(state.v).max():.3g}{hint}{trouble(self._stepper)}"
        )
