# SPDX-License-Identifier: Apache-2.0
"""Ticks of a running simulation, without ROS."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from ctypes import addressof, byref, c_double, c_void_p, cast
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.threads.background import Background
from arm_sim.exceptions import SimulationDiverged
from arm_sim.imperfections import Line, command_line
from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.latest import BRAKE, SERVO, ZERO, Command, LatestCommand
from arm_sim.ros.commands.servos import Servos
from arm_sim.ros.commands.stopping import Stopping
from arm_sim.ros.commands.wrenches import AppliedWrenches
from arm_sim.ros.energy_trail import EnergyTrail
from arm_sim.ros.node_library import library
from arm_sim.ros.tick_queue import TickQueue
from arm_sim.ros.ticks import Ticks
from arm_sim.ros.timing.round_trip import RoundTrip
from arm_sim.servo import JointCommand
from arm_sim.simulation.simulator import Simulator

MAX_STEPS = 10_000  # of one call
_SILENCE = 1.0  # [s] after which a silent source is gone; a busy machine may delay one


class Listeners(list[Callable[[], None]]):
    """Functions that are called together."""

    def __call__(self) -> None:
        """Call them in the order in which they were added."""
        for listener in self:
            listener()


@dataclass(frozen=True)
class Events:
    """Who listens to an engine.

    Attributes:
        tick: Called after each tick.
        slow_tick: Called after every so many ticks, see ``Ticks.slow_period``.
        idle: Called instead of a tick while time stands still.
        jump: Called when state or model changed other than by a tick.
        pause: Called when the simulation was paused or resumed.
        failure: Called when the simulation has paused itself.
        staleness: Called when the stale policy starts or stops acting.
    """

    tick: Listeners = field(default_factory=Listeners)
    slow_tick: Listeners = field(default_factory=Listeners)
    idle: Listeners = field(default_factory=Listeners)
    jump: Listeners = field(default_factory=Listeners)
    pause: Listeners = field(default_factory=Listeners)
    failure: Listeners = field(default_factory=Listeners)
    staleness: Listeners = field(default_factory=Listeners)


class TickEngine:
    """A simulation that accepts commands, wrenches and requests, and advances tick by tick.

    C executes the ticks, see ``native/ticks.h``; here is what it asks for, and what happens
    between ticks. All methods but ``push`` are for the ticking thread; other threads use
    ``queue``.

    Attributes:
        simulator: The simulation.
        ticks: What C needs, and its questions.
        commands: The slot for the newest command.
        arbiter: Decides which source may command.
        queue: Actions of other threads, run between ticks.
        energy: The energy account.
        round_trip: Time from a state to its command.
        wrenches: What acts on the frames.
        on: Who is told of ticks, jumps, pauses and failures.
        failure: Why the simulation paused itself, else empty.
        stale_policy: What acts without a command or with a stale one.
        stopping: Stops and holds the arm if the policy requires it.
        guard: Held while C executes ticks; a recorder sets it.
        arriving: Returns whether messages may have arrived that cannot be read yet; the node sets
            it, since it knows the middleware.
    """

    def __init__(
        self, simulator: Simulator, *, wrench_timeout: float, wrench_reference: str,
        paused: bool = False, self_running: bool = False, wait_for_command: bool = False,
        background: Background | None = None,
    ) -> None:  # fmt: skip
        """Prepare; the policy ``zero`` acts until ``configure`` changes it.

        Args:
            simulator: The simulation.
            wrench_timeout: Simulated time for which a wrench acts in [s].
            wrench_reference: Axes of wrenches, see ``ExternalWrenches``.
            paused: Whether to start paused.
            self_running: Whether a clock or a partner triggers ticks, rather than a caller.
            wait_for_command: Whether time stands still until the first command.
            background: Builds functions without blocking the loop; None: in the loop.
        """
        self.simulator, self._arm = simulator, simulator.arm
        self._q = self._arm.x[: simulator.n]
        line: Line[tuple[Command]] | None = command_line(simulator.model.scene, simulator.dt)
        self.commands = LatestCommand(simulator.dynamics, line)
        self.arbiter, self.queue = Arbiter(self.duration(_SILENCE)), TickQueue()
        self.failure = ""
        self._self_running = self_running
        self.stopping = Stopping(self._arm, Servos(self._arm, background))
        self.wrenches = AppliedWrenches(simulator, wrench_reference)
        self._wrench_ticks = self.duration(wrench_timeout)
        self.guard: AbstractContextManager[Any] = nullcontext()
        self.arriving: Callable[[], bool] = lambda: False
        self.on = Events()
        self.ticks = ticks = Ticks()
        self.energy, self.round_trip = EnergyTrail(self._arm, ticks), RoundTrip()
        for listeners in (self.on.jump, self.on.pause, self.on.staleness):
            listeners.append(self.round_trip.forget)
        self._share(ticks)
        ticks.paused, ticks.waits_for_command = paused, wait_for_command
        self.configure(0.0, ZERO)

    def _share(self, ticks: Ticks) -> None:
        """Let C know the parts of the engine, and who answers its questions."""
        arm = self._arm
        ticks.bell, ticks.trip = addressof(self.queue.bell), addressof(self.round_trip)
        ticks.arbiter, ticks.slot = addressof(self.arbiter), addressof(self.commands)
        ticks.x, ticks.effort, ticks.dt = arm.x.ctypes.data, arm.acted.ctypes.data, arm.dt
        arm.share(ticks)
        ticks.joints, ticks.states = arm.n, arm.plant.nx
        ticks.take = cast(library().joint_state_take, c_void_p).value
        ticks.answer(
            serve=self.queue.serve, idle=self.on.idle, prepare=self._prepare,
            expire=self._check_expiry, move=self._move, sense=arm.passed, ticked=self._ticked,
        )  # fmt: skip
        ticks.before_ticks.append(self._refresh)

    def _refresh(self) -> None:
        arm, ticks, stopping = self._arm, self.ticks, self.stopping
        ticks.arm = None if arm.pointers is None else addressof(arm.pointers)
        ticks.stopping, ticks.locked = stopping.is_active, stopping.is_locked
        ticks.needs_cut_notice = arm.is_clipping_unreported
        ticks.has_sensors = arm.sensors is not None
        ticks.needs_preparation = self.wrenches.need_torques or self.commands.line is not None
        ticks.has_listeners = bool(self.on.tick)

    def configure(self, command_timeout: float, stale_policy: str) -> None:
        """Set the simulated time in [s] until commands are stale, 0: never, and the policy."""
        ticks = self.duration(command_timeout)
        self.commands.configure(ticks, stale_policy)
        self.arbiter.patience = max(ticks, self.duration(_SILENCE))
        self.stale_policy = stale_policy

    def duration(self, seconds: float) -> int:
        """Number of ticks in a duration in [s], at least one unless it is zero."""
        return max(round(seconds / self.simulator.dt), 1) if seconds > 0.0 else 0

    @property
    def paused(self) -> bool:
        """Whether time stands still."""
        return bool(self.ticks.paused)

    @property
    def stamp(self) -> int:
        """Simulated time in [ns]."""
        return self.time_of(self._arm.step_count)

    def time_of(self, step: int) -> int:
        """Simulated time after so many ticks in [ns]."""
        return round(1e9 * (step * self.simulator.dt))

    @property
    def held(self) -> str:
        """What stops or holds the arm without a command: ``brakes``, ``servos``, or ``no``."""
        if not self.stopping.is_active:
            return "no"
        return "brakes" if self.stopping.is_locked else "servos"

    # --- ticking -------------------------------------------------------------------------------

    def tick(self) -> None:
        """Run the queue and read commands; then advance by one tick unless time stands still."""
        self._run(library().ticks_tick)

    def run(self, function: Any, *arguments: Any) -> None:
        """Execute ticks by a function of ticks.h; an exception pauses the simulation."""
        try:
            self._run(function, *arguments)
        except Exception as error:
            self._fail(f"paused after an unexpected failure: {error!r}")

    def _run(self, function: Any, *arguments: Any) -> Any:
        ticks = self.ticks
        with self.guard:
            ticks.refresh()
            result = function(byref(ticks), *arguments)
        if ticks.broken:
            error, ticks.error, ticks.broken = ticks.error, None, 0
            if error is not None:
                raise error
            advice = "the last good state is kept; reset or set the joint state"
            self._fail(f"paused, {advice}: {self._arm.diverged()}")
        return result

    def step(self, steps: int) -> None:
        """Execute some ticks with the newest command, which does not age.

        Raises:
            InvalidInput: If the number is not allowed, or the simulation is running.
            SimulationDiverged: If it diverges; the last good state is kept.
        """
        if not 1 <= steps <= MAX_STEPS:
            raise InvalidInput(f"steps = {steps}; allowed: 1 to {MAX_STEPS}")
        if self._self_running and not self.paused:
            raise InvalidInput("the simulation is running; allowed only while it is paused")
        self._run(library().ticks_read_commands)
        completed = self._run(library().ticks_advance, steps)
        if completed < steps:
            raise SimulationDiverged(f"after {completed} of {steps} steps; that state is kept")

    def _fail(self, reason: str) -> None:
        self.ticks.paused, self.failure = True, reason
        self.on.failure()

    # --- what C asks for -----------------------------------------------------------------------

    def _prepare(self) -> None:
        """Put the delayed command that has arrived, and apply the wrenches in the next tick."""
        self.commands.deliver(self._arm.step_count)
        if self.wrenches.need_torques:
            self.wrenches.apply(self.energy.note)

    def _check_expiry(self) -> bool:
        """Read what has arrived; return whether a command that expires goes on acting.

        What has arrived on this machine is in time, although busy processors keep the middleware
        from handing it over; but not for ever, so that an arm without commands stops.
        """
        commands, arriving = self.commands, self.arriving()
        # All that had arrived is read, unless more is arriving.
        library().ticks_read_commands(byref(self.ticks))
        commands.deliver(self._arm.step_count)
        expires = library().slot_expires(byref(commands), c_double(self.ticks.share))
        return arriving and expires and commands.age - commands.timeout < self.duration(_SILENCE)

    def _choose_command(self) -> Command | None:
        """Release or stop the arm as what acts requires; return the command, None for brakes."""
        stopping, command = self.stopping, self.commands.command(self.ticks.actor, self._q)
        if isinstance(command, str):
            return stopping.stop(command)
        if isinstance(command, JointCommand) and not stopping.servos.request(wait=self.paused):
            return None
        if stopping.is_active:
            stopping.release()
            if stopping.servos.in_background and self.stale_policy in (BRAKE, SERVO):
                stopping.servos.request()  # which may have to stop the arm
        return command

    def _move(self) -> bool:
        """Execute a tick that C does not compute; return whether it can be computed."""
        arm, command = self._arm, self._choose_command()
        try:
            if command is None:
                if not self.stopping.is_locked:  # the energy that brakes absorb is a change
                    self._run_accounted(arm.lock)
                    self.stopping.is_locked = True
                arm.stand()
            elif isinstance(command, JointCommand):
                arm.follow(command)
            else:
                arm.advance(command)
        except SimulationDiverged:
            return False
        return True

    def _ticked(self) -> None:
        ticks = self.ticks
        self.energy.note_before_full()
        if self._arm.step_count % ticks.slow_period == 0:
            self.on.slow_tick()
        self.on.tick()
        if self.commands.stale != ticks.was_stale:
            ticks.was_stale = self.commands.stale
            self.on.staleness()

    # --- requests ------------------------------------------------------------------------------

    def pause(self, stop: bool) -> None:
        """Pause or resume the simulation."""
        self.ticks.paused = stop
        if not stop:
            self.failure = ""
        self.on.pause()

    def reset(self, *state: Any) -> None:
        """Reset to time zero and a state, see ``Simulator.reset``, without commands."""
        self.commands.clear()
        self.arbiter.forget()
        self.wrenches.clear()
        self.failure, self.ticks.was_stale = "", False
        self.energy.set_open(False)
        self.stopping.hold()
        self.change(lambda: self.simulator.reset(*state))

    def change(self, action: Callable[[], Any]) -> None:
        """Run a function that changes state or model, and note its energy in the account."""
        self._run_accounted(action)
        if self.stopping.is_active:
            self.stopping.hold()  # where it is now
        self.on.jump()

    def _run_accounted(self, action: Callable[[], Any]) -> None:
        self.energy.change(action)
        self.commands.dynamics = self.simulator.dynamics  # gravity may have changed

    def push(self, frame: str, wrench: ArrayLike) -> None:
        """Apply a wrench to a frame from the next tick on, replacing the previous one.

        Code for wrenches is built with the first one, which takes a second in the calling thread.
        A wrench is force in [N] and moment in [N m], shape (6,).

        Raises:
            InvalidInput: If the frame is unknown or fixed, or a number is not finite.
        """
        wrenches = self.wrenches
        if not wrenches.is_enabled:
            change = wrenches.build_change(frame, wrench)
            self.queue.run(lambda: self._run_accounted(change))
            wrenches.enable()
        last = self._wrench_ticks - 1
        self.queue.run(lambda: wrenches.push(frame, wrench, self._arm.step_count + last))
