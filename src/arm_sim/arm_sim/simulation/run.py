# SPDX-License-Identifier: Apache-2.0
"""A run of a simulator: what makes its ticks, and what breaks it off."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.actuation.command_map import gravity_compensated
from arm_dynamics.arrays import Array
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from arm_sim.exceptions import SimulationDiverged
from arm_sim.inputs import check_torque, check_torque_table
from arm_sim.plant.actuation import CompiledControl
from arm_sim.recording.recording import Recording
from arm_sim.recording.second_run import Control as RowControl
from arm_sim.servo import JointCommand
from arm_sim.simulation.simulated_arm import SimulatedArm
from arm_sim.simulation.trace import Trace
from arm_sim.state import State

FIRST_SLICE = 10  # ticks of a controller in Python

# The command at a state
Control = Callable[[State], Any]


@dataclass(frozen=True)
class Driver:
    """What makes the ticks of a run.

    Attributes:
        make_ticks: Makes the ticks of a trace; returns the control by row, if a second run can
            repeat it.
        open_loop: Whether the commands are known in advance.
    """

    make_ticks: Callable[[Trace], RowControl | None]
    open_loop: bool

    def drive(self, trace: Trace) -> tuple[Recording, BaseException | None]:
        """The motion of a trace, and what broke it off, if anything did.

        A divergence of the arm, Ctrl-C, or an error of the controller breaks a run off: also a
        divergence, if the controller simulates, too.
        """
        row_control: RowControl | None = None
        stop: BaseException | None = None
        try:
            row_control = self.make_ticks(trace)
        except BaseException as error:
            stop = error
        motion = trace.recording(self.open_loop, row_control)
        if stop is None and trace.done < trace.ticks:
            stop = trace.arm.diverged()
            stop.recording = motion
        return motion, stop


def driver_of(arm: SimulatedArm, control: Any, reference: Motion | None, ticks: int) -> Driver:
    """The driver of a run by a control, see ``Simulator.run``.

    Raises:
        InvalidInput: If an argument is not allowed.
    """
    if hasattr(control, "torque"):
        dynamics = arm.compiled.present.with_external(arm.parameters)
        control = _commands_of(control, reference, dynamics, arm.measured)
    elif reference is not None:
        raise InvalidInput("a reference is for a controller with torque(state, reference)")
    if isinstance(control, CompiledControl):
        if arm.sensors is not None or arm.line is not None:
            raise InvalidInput(
                "a compiled controller uses the true state without delay, but the scene has "
                "'sensors' or 'commands'; allowed: a controller that is a function of the state"
            )
        return Driver(partial(_run_compiled, control), open_loop=False)
    if isinstance(control, JointCommand):
        commands = control.rows(ticks, arm.n, arm.dt)
        return Driver(partial(_run_function, lambda _: next(commands)), open_loop=False)
    if callable(control):
        _check_function(control)
        return Driver(partial(_run_function, control), open_loop=False)
    table = check_torque_table(control, ticks, arm.joint_names, arm.dt)
    open_loop = not gravity_compensated(arm.plant.model.scene)
    return Driver(partial(_run_table, table), open_loop)


def _run_compiled(control: CompiledControl, trace: Trace) -> RowControl:
    """Make ticks under a compiled controller, which a second run can evaluate by row."""
    stepper = trace.arm.compiled.stepper_with(control)
    reference = control.reference(trace.time[:-1])
    trace.roll(stepper, lambda first, end: reference[first:end])
    return lambda x, k: stepper.actuated(x, reference[k])


def _run_table(table: Array, trace: Trace) -> None:
    """Make ticks under torques, a row for each tick of the run or one for all."""
    offset, held = trace.offset, table.ndim == 1
    stepper = trace.arm.compiled.stepper
    trace.roll(stepper, lambda first, end: table if held else table[offset + first : offset + end])


def _run_function(control: Control, trace: Trace) -> RowControl | None:
    """Make ticks under a function; a second run can evaluate it if it gave torques only."""
    arm, begin, stepper = trace.arm, trace.arm.step_count, trace.arm.compiled.stepper
    torques = arm.sensors is None and arm.line is None
    for first, end in trace.slices(FIRST_SLICE):
        for k in range(first, end):
            command = control(arm.measured)
            torques = torques and not isinstance(command, JointCommand)
            trace.begin(k)
            before = arm.step_count
            try:
                arm.step(command)
            except SimulationDiverged:
                return None
            finally:  # the handler of a signal may raise an exception after the tick
                if arm.step_count > before:
                    trace.end(k)

    def row_control(x: Array, k: int) -> Array:
        command = control(State.of(x, arm.n, begin + k, arm.dt, 0.0))
        return stepper.actuated(x, np.array(check_torque(command, arm.joint_names)))

    return row_control if torques else None


def _commands_of(
    controller: Any, reference: Motion | None, dynamics: Dynamics, begin: State
) -> Control:
    """Commands of a controller that follows a reference.

    Args:
        controller: An object with ``torque(state, reference)``.
        reference: The reference from the state ``begin`` on; None: stay there.
        dynamics: Dynamics of the arm, for drives with commands other than torques.
        begin: The state at the start of the run.

    Raises:
        InvalidInput: If it is a class, or the reference cannot be sampled.
    """
    if inspect.isclass(controller):
        raise InvalidInput(
            f"control is class {controller.__name__}; an instance of it is expected"
        )
    motion: Motion = hold(begin.q) if reference is None else reference
    if not hasattr(motion, "sample"):
        raise InvalidInput(
            f"reference is of type {type(motion).__name__}; an object with sample(t) is expected, "
            "such as trajectory.quintic(…)"
        )

    def command(state: State) -> Any:
        tau = controller.torque(state, motion.sample(state.time - begin.time))
        return dynamics.command_map(state.q, state.v, tau)

    return command


def _check_function(control: Control) -> None:
    """Refuse a function that does not take a state alone, unless it has no signature."""
    try:
        inspect.signature(control).bind(None)
    except TypeError:
        text = f"control = {control!r}: a function of one argument, the state, is expected"
        raise InvalidInput(text) from None
    except ValueError:
        pass
