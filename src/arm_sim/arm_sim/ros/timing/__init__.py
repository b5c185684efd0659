# SPDX-License-Identifier: Apache-2.0
"""Time in the sim node: the real-time loop, stamps, the clock, and latencies of answers.

Depends on the joint states' messages and on C that the node's other parts share; on no other part.
"""

from arm_sim.ros.timing.clock import SimClock
from arm_sim.ros.timing.latency import RoundTrip
from arm_sim.ros.timing.realtime_loop import RealtimeLoop
from arm_sim.ros.timing.stamps import NodeTime, SimulatedTime

__all__ = ["NodeTime", "RealtimeLoop", "RoundTrip", "SimClock", "SimulatedTime"]
