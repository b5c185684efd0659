# SPDX-License-Identifier: Apache-2.0
"""How long single answers of the nodes take: a controller's tick, long goals, long batches.

Each file is a command that prints a table for the documentation, ``./arm python -m
benchmarks.latency.controller_ticks`` and so on.
"""
