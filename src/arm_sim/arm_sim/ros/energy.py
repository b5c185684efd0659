# SPDX-License-Identifier: Apache-2.0
"""The energy account on the topic ``~/energy``."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from arm_msgs.msg import Energy
from rclpy.node import Node

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.direct import advertise
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.interfaces import Topic
from arm_sim.recording.energy_meter import Account
from arm_sim.ros.interfaces import ENERGY
from arm_sim.ros.tick_engine import TickEngine


class EnergyTopic:
    """Keeps the energy account of an engine while it has readers, and publishes it.

    Ticks triggered by a caller or a partner publish it themselves, so that each message belongs to
    a tick known in advance. Ticks by the clock do not wait for it: a timer of the node evaluates
    and publishes it, see ``watch``.

    Attributes:
        every: Ticks between messages.
    """

    def __init__(
        self,
        node: Node,
        engine: TickEngine,
        period: float,
        wanted: Callable[[], bool],
        stamp: Callable[[int], int],
        send: Callable[[Topic, Any, Energy, int], None],
    ) -> None:
        """Advertise the topic, and build what the first account needs.

        Args:
            node: The node.
            engine: The engine.
            period: Simulated time between messages in [s].
            wanted: Returns whether anything else reads the account.
            stamp: Returns the stamp for a simulated time, both in [ns].
            send: Called with the topic, its publisher, a message, and its stamp in [ns].
        """
        self._engine, self._wanted = engine, wanted
        self._stamp, self._send, self._told = stamp, send, -1
        self.every = max(1, round(period / engine.simulator.dt))
        self._publisher = advertise(node, ENERGY)
        engine.simulator.energy_account.prepare()

    @property
    def heard(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._publisher.get_subscription_count() > 0)

    def after_tick(self) -> None:
        """Open or close the account as required, and publish it; in the ticking thread."""
        heard, engine = self.heard, self._engine
        engine.keep_account(heard or self._wanted())
        if heard and (account := engine.account()) is not None:
            self._publish(account)

    def watch(self, node: Node, period: float) -> None:
        """Publish every ``period`` in [s], in another thread than the ticking one."""
        self._timer = steady_timer(node, period, self._publish_new)
        self._timer.cancel()

    def look(self) -> None:
        """Open or close the account as required; in the thread that publishes it."""
        heard, engine = self.heard, self._engine
        wanted = heard or self._wanted()
        if wanted != engine.accounted:
            with suppress(InvalidInput):  # no tick has ended for long; it will look again
                engine.queue.run(lambda: engine.keep_account(wanted))
        if not heard:
            self._timer.cancel()
        elif self._timer.is_canceled():
            self._timer.reset()

    def _publish_new(self) -> None:
        """Publish the account unless time stands still."""
        account = self._engine.account()
        if account is not None and account.step != self._told:
            self._told = account.step
            self._publish(account)

    def _publish(self, account: Account) -> None:
        energies = account._asdict()
        stamp = self._stamp(self._engine.time_of(energies.pop("step")))
        self._send(ENERGY, self._publisher, Energy(**energies), stamp)
