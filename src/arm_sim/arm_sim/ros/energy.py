# SPDX-License-Identifier: Apache-2.0
"""The energy account on the topic ``~/energy``."""

from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from typing import Any

from arm_msgs.msg import Energy
from rclpy.node import Node

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.interfaces import Topic
from arm_sim.ros.interfaces import ENERGY
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.simulation.energy_meter import Account

_UNPUBLISHED = 0.5  # [s] between evaluations without subscribers, for diagnostics


class EnergyTopic:
    """Keeps the energy account of an engine while it has readers, and publishes it.

    There are two ways. Ticks triggered by a caller or a partner publish it themselves, so that
    each message belongs to a tick known in advance: they call ``after_tick``. Ticks by the clock
    do not wait for it: after ``watch`` a thread of its own evaluates and publishes it, and
    ``update``, called by a timer, opens and closes it.

    Attributes:
        interval: Ticks between messages.
    """

    def __init__(
        self, node: Node, engine: TickEngine, period: float, also_read: Callable[[], bool],
        stamp: Callable[[int], int], send: Callable[[Topic, Any, Energy, int], None],
    ) -> None:  # fmt: skip
        """Advertise the topic, and build what the first account needs.

        Args:
            node: The node.
            engine: The engine.
            period: Simulated time between messages in [s].
            also_read: Returns whether anything else reads the account.
            stamp: Returns the stamp for a simulated time, both in [ns].
            send: Called with the topic, its publisher, a message, and its stamp in [ns].
        """
        self._engine, self._also_read, self._context = engine, also_read, node.context
        self._stamp, self._send = stamp, send
        self._thread: Thread | None = None
        self._ended = Event()
        self._latest: Account | None = None
        self.interval = max(1, round(period / engine.simulator.dt))
        self._publisher = advertise(node, ENERGY)
        engine.simulator.arm.compiled.energy_account.prepare()

    @property
    def has_subscribers(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._publisher.get_subscription_count())

    def after_tick(self) -> None:
        """Open or close the account as required, and publish it; in the ticking thread."""
        has_subscribers, energy = self.has_subscribers, self._engine.energy
        energy.set_open(has_subscribers or self._also_read())
        if has_subscribers and (account := energy.read()) is not None:
            self._publish(account)

    def account(self) -> Account | None:
        """The account, by the clock as evaluated last; None while it is closed."""
        if self._thread is None:
            return self._engine.energy.read()
        return self._latest if self._engine.energy.is_open else None

    def watch(self, period: float) -> None:
        """Evaluate and publish every ``period`` in [s] in a thread of its own, see ``update``."""
        self._thread = Thread(target=self._run, args=(period,), name="energy", daemon=True)
        self._thread.start()

    def update(self) -> None:
        """Open or close the account as required; not for the ticking thread."""
        needed, engine = self.has_subscribers or self._also_read(), self._engine
        if needed == engine.energy.is_open:
            return
        with suppress(InvalidInput):  # no tick has ended for long; the next update tries again
            engine.queue.run(lambda: engine.energy.set_open(needed))

    def close(self) -> None:
        """End the thread."""
        if self._thread is not None:
            self._ended.set()
            self._thread.join()

    def _run(self, period: float) -> None:
        has_subscribers, last_step = False, -1
        while not self._ended.wait(period if has_subscribers else _UNPUBLISHED):
            self._latest = account = self._engine.energy.read()
            try:
                has_subscribers = self.has_subscribers
                if has_subscribers and account is not None and account.step != last_step:
                    last_step = account.step
                    self._publish(account)
            except Exception:
                if self._context.ok():  # otherwise ROS has been shut down meanwhile
                    raise

    def _publish(self, account: Account) -> None:
        energies = account._asdict()
        stamp = self._stamp(self._engine.time_of(energies.pop("step")))
        self._send(ENERGY, self._publisher, Energy(**energies), stamp)
