# SPDX-License-Identifier: Apache-2.0
"""The arm of a simulator, for loops: its state, and what advances or changes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.actuation import StateKind
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.scene import Scene
from arm_sim.exceptions import SimulationDiverged
from arm_sim.imperfections import Line, command_line, sensors_of
from arm_sim.inputs import check_row, check_torque, check_whole
from arm_sim.plant.admissible_states import active_constraints, constraint_hint
from arm_sim.plant.plant import Plant
from arm_sim.recording.contents import BRAKES, FREE, SERVOS
from arm_sim.recording.origin import Origin
from arm_sim.servo import JointCommand
from arm_sim.simulation.compiled_scene import CompiledScene
from arm_sim.simulation.saturation import SaturationNotice
from arm_sim.state import State, read_only_view
from arm_sim.stepping.arm import Arm
from arm_sim.stepping.events import trouble_message
from arm_sim.stepping.python_step import PythonStep, python_step
from arm_sim.stepping.stepper import Stepper

if TYPE_CHECKING:
    from arm_sim.servo import Balance

_set_sealed = object.__setattr__  # an attribute that others cannot set


class _TickState:
    """What changes with every tick beside x: see properties of ``SimulatedArm``."""

    __slots__ = ("hold", "state", "step_count")

    def __init__(self) -> None:
        self.step_count, self.hold = 0, FREE
        self.state: State | None = None


@sealed
class SimulatedArm:
    """A simulated arm that other code advances: ``Simulator.arm``.

    Args:
        compiled: The scene.
        source: Its name or path; empty if it is not from a file.

    Attributes:
        n: Degrees of freedom.
        joint_names: Order of every vector.
        dt: Length of a tick in [s].
        source: Name or path of the scene.
        compiled: Equations and compiled ticks, see ``use``.
        x: The current state (q, v, z), shape (nx,): a read-only view that ticks change.
        acted: The effective command of the last tick, limits applied, shape (n,), likewise.
        notes: Current estimated error and number of time-stepped ticks, see ``State``, likewise.
        pointers: The tick for other compiled code, see ``share``; None if the scene runs on the
            virtual machine. Replaced by ``use``.
        sensors: The scene's sensors; None if it has none.
        line: Commands in transit; None if they act at once.
    """

    _instead = {
        "q v z state": "place(x)", "step_count hold time": "restore(x, p, step)",
        "compiled": "use(compiled)", "sensors line": "imperfect(scene)",
    }  # fmt: skip

    def __init__(self, compiled: CompiledScene, source: str) -> None:
        model, self.dt, self.source = compiled.plant.model, compiled.choice.dt, source
        self._now = _TickState()
        self.n, self.joint_names = model.n, model.joint_names
        self._x, self._command = np.zeros(compiled.plant.nx), np.zeros(self.n)
        self._q, self._v = self._x[: self.n], self._x[self.n : 2 * self.n]
        self._effort, self._notes = np.zeros((1, self.n)), np.zeros((1, 2))
        self._pack_command = Struct(f"{self.n}d").pack_into
        self.x, self.acted = read_only_view(self._x), read_only_view(self._effort[0])
        self.notes = read_only_view(self._notes[0])
        self.compiled, self._stepper = compiled, compiled.stepper
        self._tick, self.pointers = self._tick_of(compiled)
        self._step: PythonStep | None = None  # compiled when it is first used
        self._balance: Balance | None = None  # in which servos hold the arm
        self._saturation = SaturationNotice(model)
        self._servo_saturation = SaturationNotice(model, "servo's command")
        self.sensors = sensors_of(model.scene, self.joint_names, self.dt)
        self.line: Line[list[float] | JointCommand] | None = command_line(model.scene, self.dt)

    def _tick_of(self, compiled: CompiledScene) -> tuple[Callable[[], int], Arm | None]:
        """The tick of a scene for Python, and for other compiled code."""
        arrays = self._x, self._command, self._effort[0], self._notes[0]
        return compiled.stepper.tick_function(*arrays)

    @property
    def step_count(self) -> int:
        """Ticks since the last reset."""
        return self._now.step_count

    @property
    def hold(self) -> int:
        """What held the arm in the last tick, see ``Recording``; ``FREE`` after a reset."""
        return self._now.hold

    @property
    def plant(self) -> Plant:
        """The equation of motion."""
        return self.compiled.plant

    @property
    def state(self) -> State:
        """The current state; read-only arrays that later ticks do not change."""
        state = self._now.state
        if state is None or state.step != self._now.step_count:
            notes = self._notes.tolist()[0]
            state = State.of(self._x, self.n, self._now.step_count, self.dt, *notes)
            self._now.state = state
        return state

    @property
    def measured(self) -> State:
        """The state as measured by the sensors; without sensors, and of z, the exact one."""
        state, n = self.state, self.n
        if self.sensors is None:
            return state
        measured = read_only_view(self.sensors.measured.copy())
        return replace(state, q=measured[:n], v=measured[n : 2 * n])

    @property
    def effort(self) -> Array:
        """Torque that acted in the last tick in [N m] or [N], shape (n,)."""
        return self.plant.joint_torque(self._x, self.acted.copy())

    @property
    def parameters(self) -> Array:
        """Current tunable quantities, in the order of the plant's, shape (np,)."""
        return self._stepper.p.copy()

    @property
    def held_constraints(self) -> tuple[str, ...]:
        """Names of the active constraints."""
        return active_constraints(self.plant, self._stepper.p)

    @property
    def substep(self) -> float:
        """Sub-step that error control tries next in [s]; 0 if it is not known yet."""
        return self._stepper.substep

    @property
    def origin(self) -> Origin:
        """Scene, method and versions, to be stored with a recording."""
        choice, scene = self.compiled.choice, self.plant.model.scene
        return Origin(scene, choice.method.name, choice.dt, choice.tolerance, self.source)

    # --- ticks ---------------------------------------------------------------------------------

    def step(self, tau: object) -> State:
        """Advance by a tick under a command as for ``Simulator.step``, checked and delayed."""
        if (step := self._step) is None:
            step = self._step = python_step(self.pointers, self.n, self.plant.nz)
        try:
            state = step(tau, self._now.step_count) if self.line is None else None
            if state is None:
                self._step_by_python(tau)
                return self.state
        except BaseException:
            self._catch_up()
            raise
        if state is False:
            raise self.diverged()
        self._finish_tick(state, self._saturation)
        return state

    def _catch_up(self) -> None:
        """Register a tick at the end of which the handler of a signal raised an exception."""
        state, x = self._now.state, self._x.tobytes()
        if state is not None and x != np.concatenate([state.q, state.v, state.z]).tobytes():
            self._finish_tick(None, self._saturation)

    def _step_by_python(self, tau: object) -> None:
        """Make a tick under a command of any kind, which is checked."""
        if isinstance(tau, JointCommand):
            next(tau.rows(1, self.n, self.dt))  # which checks the shape
            acts = self._send(tau)
        else:
            acts = self._send(check_torque(tau, self.joint_names))
        if isinstance(acts, JointCommand):
            self.follow(acts)
        else:
            self.advance(acts)

    def _send[C: (list[float], JointCommand)](
        self, command: C, ahead: int = 0
    ) -> C | list[float] | JointCommand:
        """Send a command some ticks after the current one, and return the one that acts then."""
        if self.line is None:
            return command
        return self.line.carry(self.step_count + ahead, command) or [0.0] * self.n

    def _send_rows(self, commands: Array) -> Array:
        """Send commands in the next ticks, a row in each, and return those that act then."""
        return np.array([self._send(row, k) for k, row in enumerate(commands.tolist())])

    def advance(self, tau: Sequence[float]) -> None:
        """Advance by a tick under n finite numbers, for a loop that reads ``x``.

        They act immediately: a loop that calls this implements delays of commands itself.

        Raises:
            SimulationDiverged: If the tick cannot be computed; the state is kept.
        """
        self._pack_command(self._command, 0, *tau)
        self._advance(self._saturation)

    def follow(self, command: JointCommand) -> None:
        """Advance by a tick under a command of shape (n,), which its servos turn into torques.

        The same object means the same command; another one, the next command of a stream. A joint
        that a servo holds at a position stays exactly at rest there.
        """
        servo, rest = self.compiled.servo, self.compiled.rest
        x, p, n = self._x, self._stepper.p, self.n
        self._command[:] = servo.command(command, x, p, self.step_count)
        if not (servo.at_rest and rest.is_slow(x)):
            self._advance(self._servo_saturation)
            return
        held, before = self.hold == SERVOS and rest.is_balance_at(self._balance, x, p), x.copy()
        balance = self._balance if held else self._balance_under(command)
        self._advance(self._servo_saturation)
        if balance and (rest.is_balance_kept(balance, before, x) if held else rest.is_slow(x)):
            x[:n], x[n : 2 * n] = before[:n], 0.0
            self._balance, self._now.hold = balance, SERVOS

    def _balance_under(self, command: JointCommand) -> Balance | None:
        """The balance of the arm where it is, at rest under its servos."""
        servo, rest, stepper = self.compiled.servo, self.compiled.rest, self._stepper
        x = rest.rest_state(self._x)
        torques = servo.command(command, x, stepper.p, self.step_count)
        return rest.balance(x, torques, stepper.p, stepper.slope)

    def _advance(self, notice: SaturationNotice) -> None:
        if self._tick() != 1:
            raise self.diverged()
        self._finish_tick(None, notice)

    def _finish_tick(self, state: State | None, notice: SaturationNotice) -> None:
        self._count(1, FREE, state)
        notice.check(self._command, self._effort)
        self._sense()

    def _count(self, ticks: int, hold: int, state: State | None = None) -> None:
        """Register ticks, what held the arm in them, and the state after them if it is known."""
        now = self._now
        now.step_count, now.state, now.hold = now.step_count + ticks, state, hold

    def share(self, now: Any) -> None:
        """Keep ``step_count``, ``hold`` and ``state`` in an object of other code.

        That ticks by ``pointers``, counts the ticks, and calls ``passed`` where it matters.
        """
        now.step_count, now.hold, now.state = self.step_count, self.hold, None
        self._now = now

    def passed(self) -> None:
        """After a tick of other code: sample the sensors, and warn of a clipped command, once."""
        if self.hold == FREE:
            self._saturation.check(self._command, self._effort)
        self._sense()

    def stand(self) -> None:
        """Advance by a tick in which closed brakes hold every joint, see ``lock``."""
        self._count(1, BRAKES)
        self._sense()

    def _sense(self) -> None:
        if self.sensors is not None:
            self.sensors.sample(self.step_count, self._q, self._v, self._drive_torque)

    def roll(
        self, stepper: Stepper, command: Array, trace: Array, effort: Array, notes: Array
    ) -> int:
        """Advance by ticks of a stepper in one call, see ``Stepper.ticks``.

        Commands are sent as by ``step``. If a signal breaks it off, what was done is registered.
        """
        start, line, ticks = self._x.copy(), deepcopy(self.line), -1
        rows = np.broadcast_to(command, (len(trace), command.shape[-1]))
        trace[:, 0] = np.nan  # equals no state, where no tick is made
        try:
            command = command if line is None else self._send_rows(rows)
            ticks = stepper.ticks_function(self._x, command, trace, effort, notes)()
        finally:
            if ticks < 0:  # the handler of a signal raised an exception when they were made
                matches = np.flatnonzero((trace == self._x).all(axis=1))
                ticks = int(matches[-1]) + 1 if len(matches) else 0
                self._x[:] = trace[ticks - 1] if ticks else start
            if line is not None and ticks < len(trace):  # nothing is sent in ticks not made
                _set_sealed(self, "line", line)
                self._send_rows(rows[:ticks])
            if ticks:
                self._count(ticks, FREE)
                self._effort[0], self._notes[0] = effort[ticks - 1], notes[ticks - 1]
                if stepper is self._stepper:  # else the command is a controller's reference
                    commands = command[:ticks] if command.ndim == 2 else command
                    self._saturation.check(commands, effort[:ticks])
        return ticks

    def lock(self) -> None:
        """Close the brakes: joints and motors stop at once, and drives are switched off."""
        self._x[self.n : 2 * self.n] = 0.0
        for kind in (StateKind.MOTOR_VELOCITY, StateKind.CURRENT):
            places, _ = self.plant.laws.places(kind)
            self._x[places] = 0.0
        self._effort[:], self._now.state = 0.0, None

    @property
    def is_clipping_unreported(self) -> bool:
        """Whether no command has been clipped at its limit yet, which would be logged."""
        return not self._saturation.logged

    @property
    def _drive_torque(self) -> Array:
        return self._effort[0] if self.plant.torques is None else self.effort

    def diverged(self) -> SimulationDiverged:
        """The error that the next tick cannot be computed."""
        state, choice = self.state, self.compiled.choice
        hint = constraint_hint(self.plant, state.q, state.v, self.held_constraints)
        return SimulationDiverged(
            f"time step {state.step + 1} (t = {state.time:.6g} s) cannot be computed with "
            f"{choice.method.name}{choice.remark}; the state before it is kept: largest |v| = "
            f"{abs(state.v).max():.3g}{hint}{trouble_message(self._stepper.report)}"
        )

    # --- changes between ticks -----------------------------------------------------------------

    def place(self, x: Array) -> None:
        """Set the state, shape (nx,), without changing the time."""
        self._x[:], self._now.state = x, None
        self._restart_sensors()
        if self.compiled.has_servo:
            self.compiled.servo.restart()

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
        x, p = check_row("x", x, self.plant.nx), check_row("p", p, len(self._stepper.p))
        check_whole("step", step, 0)
        self.compiled.restart()
        self._x[:], self._stepper.p[:], self._stepper.substep = x, p, substep
        self._effort[:], self._notes[:] = 0.0, 0.0
        self._now.step_count, self._now.state, self._now.hold = step, None, FREE
        self._restart_imperfections()

    def imperfect(self, scene: Scene) -> None:
        """Use the sensors and commands of another scene with the same joints, and restart them.

        Raises:
            SceneError: If a filter's cut-off frequency is too high for this rate.
        """
        sensors = sensors_of(scene, self.joint_names, self.dt)
        _set_sealed(self, "sensors", sensors)
        _set_sealed(self, "line", command_line(scene, self.dt))
        self._restart_imperfections()

    def use(self, compiled: CompiledScene, **parameters: Any) -> None:
        """Continue with another compiled scene of the same states.

        Tunable quantities keep their values, except those given by name.

        Raises:
            InvalidInput: If a quantity is not tunable; nothing changes.
        """
        current, p = self.plant.parameters, self._stepper.p
        values = {name: current.of(name, p) for name in current.names} | parameters
        merged = compiled.plant.parameters.merged(values, compiled.stepper.p)
        compiled.stepper.p[:] = merged
        compiled.stepper.report = self._stepper.report
        self._tick, arm = self._tick_of(compiled)
        _set_sealed(self, "compiled", compiled)
        _set_sealed(self, "pointers", arm)
        self._stepper, self._step, self._balance = compiled.stepper, None, None

    def _restart_imperfections(self) -> None:
        """Restart without commands in transit, and with settled sensors."""
        if self.line is not None:
            self.line.restart()
        self._restart_sensors()

    def _restart_sensors(self) -> None:
        if self.sensors is not None:
            self.sensors.restart(self.step_count, self._q, self._v, self._drive_torque)
