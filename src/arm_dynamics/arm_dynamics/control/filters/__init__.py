# SPDX-License-Identifier: Apache-2.0
"""Filters of measured signals, one for each joint: a low pass, and velocities from positions.

They depend on no controller. A scene's sensors filter by the same ones.
"""
