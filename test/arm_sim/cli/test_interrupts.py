# SPDX-License-Identifier: Apache-2.0
"""Signals that end a command arrive between its calls of ROS, not within them."""

from __future__ import annotations

import os
import signal
from threading import Thread

import pytest

from arm_sim.cli.interrupts import interruptible, postponed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_while_ros_is_at_work_waits_until_it_is_done(number: int) -> None:
    done = []
    with interruptible(), pytest.raises(KeyboardInterrupt, match=signal.Signals(number).name):
        with postponed():
            signal.raise_signal(number)
            done.append("ROS")
        done.append("more")
    assert done == ["ROS"]


def test_threads_which_signals_do_not_reach_need_not_wait() -> None:
    done = []

    def work() -> None:
        with postponed():
            done.append("ROS")

    thread = Thread(target=work)
    thread.start()
    thread.join()
    assert done == ["ROS"]


@pytest.mark.ros
def test_a_command_that_listens_ends_after_the_message_it_receives() -> None:
    from arm_dynamics.ros.interfaces import JOINT_STATES
    from arm_sim.cli.robot.listener import Listener

    topic, heard = f"/joint_states_{os.getpid()}", []

    def interrupted(message: object) -> None:
        signal.raise_signal(signal.SIGINT)
        heard.append(message)

    with interruptible(), Listener() as listener:
        publisher = listener.publisher(JOINT_STATES, topic)
        listener.hear(JOINT_STATES, topic, interrupted)
        assert listener.until(lambda: publisher.get_subscription_count() > 0, 10.0)
        publisher.publish(JOINT_STATES.type())
        with pytest.raises(KeyboardInterrupt):
            listener.until(lambda: False, 10.0)
    assert len(heard) == 1
