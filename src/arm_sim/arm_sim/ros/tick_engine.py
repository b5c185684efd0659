# SPDX-License-Identifier: Apache-2.0
"""Ticks of a running simulation, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.background import Background
from arm_sim.exceptions import SimulationDiverged
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.imperfections import Line, command_line
from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.latest import BRAKE, SERVO, ZERO, Command, LatestCommand, Stop
from arm_sim.ros.commands.stopping import Servos, Stopping
from arm_sim.ros.tick_queue import TickQueue
from arm_sim.servo import JointCommand
from arm_sim.simulation.compiled_scene import EXTERNAL
from arm_sim.simulation.energy_meter import Account, EnergyMeter
from arm_sim.simulation.runtime_changes import external_change
from arm_sim.simulation.simulator import Simulator

MAX_STEPS = 10_000  # of one call
_SILENCE = 1.0  # [s] after which a silent source is gone; a busy machine may delay one

Listeners = list[Callable[[], None]]


class TickEngine:
    """A simulation that accepts commands, wrenches and requests, and advances tick by tick.

    All methods are for the ticking thread; other threads use ``queue``. Only ``push`` and
    ``account`` are for any thread.

    Attributes:
        simulator: The simulation.
        commands: The slot for the newest command.
        arbiter: Decides which source may command.
        queue: Actions of other threads, run between ticks.
        paused: Whether time stands still.
        failure: Why the simulation paused itself, else empty.
        stale_policy: What acts without a command or with a stale one.
        stopping: Stops and holds the arm if the policy requires it.
        share: Returns the part of a tick by which the next one makes commands older.
        read_commands: Called before a tick, to fill the slot.
        arriving: Returns whether messages may have arrived that cannot be read yet.
        note_ticks: Called before the account is evaluated, to note ticks executed elsewhere.
        on_tick: Called after each tick.
        on_idle: Called instead of a tick while time stands still.
        on_jump: Called when state or model changed other than by a tick.
        on_pause: Called when the simulation was paused or resumed.
        on_failure: Called when the simulation has paused itself.
        on_staleness: Called when the stale policy starts or stops acting.
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
        line: Line[Command] | None = command_line(simulator.model.scene, simulator.dt)
        self.commands = LatestCommand(simulator.dynamics, line)
        self.arbiter, self.queue = Arbiter(self.ticks(_SILENCE)), TickQueue()
        self.paused, self.failure, self._was_stale = paused, "", False
        self._self_running, self._wait_for_command = self_running, wait_for_command
        self._servos = Servos(self._arm, background)
        self.stopping = Stopping(self._arm, self._servos)
        self._wrenches = ExternalWrenches(simulator.dynamics, wrench_reference)
        self._wrench_ticks = self.ticks(wrench_timeout)
        self._pushable = self._pushing = False
        self._in_background = background is not None
        self._meter: EnergyMeter | None = None
        self.share: Callable[[], float] = lambda: 1.0
        self.read_commands: Callable[[], None] = lambda: None
        self.arriving: Callable[[], bool] = lambda: False
        self.note_ticks: Callable[[], None] = lambda: None
        self.on_tick, self.on_idle, self.on_jump = Listeners(), Listeners(), Listeners()
        self.on_pause, self.on_failure, self.on_staleness = Listeners(), Listeners(), Listeners()
        self.configure(0.0, ZERO)

    def configure(self, command_timeout: float, stale_policy: str) -> None:
        """Set the simulated time in [s] after which a command is stale, 0: never, and the policy.

        The policy is one of ``commands.latest.POLICIES``, see ``LatestCommand``.
        """
        ticks = self.ticks(command_timeout)
        self.commands.configure(ticks, stale_policy)
        self.arbiter.patience = max(ticks, self.ticks(_SILENCE))
        self.stale_policy = stale_policy
        self.queue.ring()

    def ticks(self, duration: float) -> int:
        """Number of ticks in a duration in [s], at least one unless it is zero."""
        return max(round(duration / self.simulator.dt), 1) if duration > 0.0 else 0

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
        stopping = self.stopping
        return "no" if not stopping.acts else "brakes" if stopping.locked else "servos"

    # --- ticking -------------------------------------------------------------------------------

    def tick(self) -> None:
        """Run the queue and read commands; then advance by one tick unless time stands still."""
        self.queue.serve()
        share = self.share()
        self.arbiter.tick(share)
        if not self.paused:
            self.read_commands()
            if not (self._wait_for_command and self.commands.empty):
                self.commands.arrive(self._arm.step_count)
                self._advance(self.commands.take(self._q, share, self._may_come(share)))
                if self.commands.stale is not self._was_stale:
                    self._was_stale = self.commands.stale
                    _call(self.on_staleness)
                return
        _call(self.on_idle)

    def _may_come(self, share: float) -> bool:
        """Whether a command that expires may have a successor that has arrived already.

        What has arrived on this machine is in time, although busy processors keep the middleware
        from handing it over; but not for ever, so that an arm without commands stops.
        """
        commands = self.commands
        if not commands.expires(share):
            return False
        arriving = self.arriving()
        self.read_commands()  # all that had arrived, unless more is arriving
        commands.arrive(self._arm.step_count)
        late = commands.age - commands.timeout
        return arriving and commands.expires(share) and late < self.ticks(_SILENCE)

    def tick_unattended(self) -> None:
        """Tick in a thread without a caller: an exception pauses the simulation."""
        try:
            self.tick()
        except Exception as error:
            self._fail(f"paused after an unexpected failure: {error!r}")

    @property
    def ordinary(self) -> bool:
        """Whether efforts act in the next tick and nothing else is due, also in ``commands``."""
        pushed = self._pushing or bool(self._wrenches.active)
        still = self.paused or self.stopping.acts or self._was_stale
        return not (still or pushed)

    @property
    def accounted(self) -> bool:
        """Whether the energy account is kept."""
        return self._meter is not None

    def note(self, x: Array, u: Array, step: int) -> None:
        """Note ticks executed elsewhere in the account, see ``EnergyMeter.note_all``."""
        if (meter := self._meter) is not None:
            meter.note_all(x, u, step)

    def tell_unattended(self) -> None:
        """Notify listeners of a tick that was executed elsewhere, as ``tick_unattended``."""
        try:
            _call(self.on_tick)
        except Exception as error:
            self._fail(f"paused after an unexpected failure: {error!r}")

    @property
    def may_step(self) -> bool:
        """Whether ``step`` is allowed: nothing else executes ticks."""
        return self.paused or not self._self_running

    def step(self, steps: int) -> None:
        """Execute some ticks with the newest command, which does not age.

        Raises:
            InvalidInput: If the number is not allowed, or the simulation is running.
            SimulationDiverged: If it diverges; the last good state is kept.
        """
        if not 1 <= steps <= MAX_STEPS:
            raise InvalidInput(f"steps = {steps}; allowed: 1 to {MAX_STEPS}")
        if not self.may_step:
            raise InvalidInput("the simulation is running; allowed only while it is paused")
        self.read_commands()
        for done in range(steps):
            self.commands.arrive(self._arm.step_count)
            command = self.commands.held(self._q)
            if isinstance(command, JointCommand):
                self._servos.build()  # time waits
            if not self._advance(command):
                raise SimulationDiverged(f"after {done} of {steps} steps; that state is kept")

    def _advance(self, command: Command | Stop) -> bool:
        """Execute a tick; on divergence pause at the last good state and return False."""
        if self._pushable:
            self._push()
        try:
            moved = self._make(command)
        except SimulationDiverged as error:
            self._fail(
                f"paused, the last good state is kept; reset or set the joint state: {error}"
            )
            return False
        if self._meter is not None:
            self._meter.note(moved)
        _call(self.on_tick)
        return True

    def _make(self, command: Command | Stop) -> bool:
        """Execute a tick under a command; return whether the arm was free to move."""
        arm, stopping = self._arm, self.stopping
        if isinstance(command, Stop):
            led = stopping.command(command)
            if led is None:
                self._stand()
                return False
            arm.follow(led)
            return True
        if isinstance(command, JointCommand):
            if not self._servos.ready:
                self._stand()
                return False
            if stopping.acts:
                stopping.release()
            arm.follow(command)
            return True
        if stopping.acts:
            self._release()
        arm.advance(command)
        return True

    def _release(self) -> None:
        """Release the arm, and prepare the servos that may have to stop it."""
        self.stopping.release()
        if self._in_background and self.stale_policy in (BRAKE, SERVO):
            self._servos.ready  # noqa: B018 - begins to build them

    def _stand(self) -> None:
        """Execute a tick in which brakes hold the arm; the energy they absorb is a change."""
        if not self.stopping.locked:
            self._accounted(self._arm.lock)
            self.stopping.locked = True
        self._arm.stand()

    def _fail(self, why: str) -> None:
        self.paused, self.failure = True, why
        _call(self.on_failure)

    # --- requests ------------------------------------------------------------------------------

    def pause(self, stop: bool) -> None:
        """Pause or resume the simulation."""
        self.paused = stop
        if not stop:
            self.failure = ""
        _call(self.on_pause)

    def reset(self, *state: Any) -> None:
        """Reset to time zero, without commands, sources and wrenches.

        Args:
            *state: q, v and z, see ``Simulator.reset``; none for the initial ones.
        """
        self.commands.clear()
        self.arbiter.forget()
        self._wrenches.clear()
        self.failure, self._was_stale = "", False
        self._meter = None
        self.stopping.hold()
        self.change(lambda: self.simulator.reset(*state))

    def change(self, action: Callable[[], Any]) -> None:
        """Run a function that changes state or model, and note its energy in the account."""
        self._accounted(action)
        if self.stopping.acts:
            self.stopping.hold()  # where it is now
        _call(self.on_jump)

    def _accounted(self, action: Callable[[], Any]) -> None:
        if self._meter is None:
            action()
        else:
            self._meter.change(action)
        self.commands.dynamics = self.simulator.dynamics  # gravity may have changed

    # --- wrenches ------------------------------------------------------------------------------

    @property
    def pushed_frames(self) -> tuple[str, ...]:
        """Frames on which a wrench acts."""
        return self._wrenches.active

    def push(self, frame: str, wrench: ArrayLike) -> None:
        """Apply a wrench to a frame from the next tick on, replacing the previous one.

        Code for wrenches is built with the first one, which takes a second in the calling thread.

        Args:
            frame: A frame that moves.
            wrench: Force in [N] and moment in [N m], shape (6,).

        Raises:
            InvalidInput: If the frame is unknown or fixed, or a number is not finite.
        """
        simulator = self.simulator
        if not self._pushable:
            ExternalWrenches(simulator.dynamics).push(frame, wrench, 0)  # refuses at once
            pushable = external_change(simulator)
            self.queue.run(lambda: self._accounted(pushable))
            self._pushable = True
        last = self._wrench_ticks - 1
        self.queue.run(lambda: self._wrenches.push(frame, wrench, self._arm.step_count + last))

    def _push(self) -> None:
        """Apply the wrenches in the next tick."""
        if self._wrenches.active or self._pushing:
            tau = self._wrenches.torque(self._q, self._arm.step_count)
            self.simulator.set_parameter(EXTERNAL, tau)
            self._pushing = bool(self._wrenches.active)

    # --- energy --------------------------------------------------------------------------------

    def keep_account(self, wanted: bool) -> None:
        """Open the energy account if it is needed, or close it if it is not."""
        if not wanted:
            self._meter = None
        elif self._meter is None:
            self._meter = EnergyMeter(self._arm)

    def account(self) -> Account | None:
        """Energies since the account was opened; None while it is closed."""
        self.note_ticks()
        meter = self._meter
        return None if meter is None else meter.account()

    @property
    def energy_error(self) -> float:
        """Unexplained energy of the last account, relative to the energy that moved; else 0."""
        return 0.0 if self._meter is None else self._meter.error


def _call(listeners: Listeners) -> None:
    for listener in listeners:
        listener()
