# SPDX-License-Identifier: Apache-2.0
"""Events that begin and end within a tick: random scenes against ticks a hundred times shorter.

cases         random scenes and drives
judge         one run against the motion of short ticks
second_truth  the same scenes by the simulator of test/reference/independent
blind         the engine with one of its guards switched off, to test what notices it
cli           the command
"""
