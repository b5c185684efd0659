# SPDX-License-Identifier: Apache-2.0
"""Time in the sim node: the real-time loop, stamps, the clock, and latencies of answers.

Depends on the joint states' messages and on C that the node's other parts share; on no other part.
"""
