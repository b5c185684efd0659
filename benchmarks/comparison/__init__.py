# SPDX-License-Identifier: Apache-2.0
"""Run time against error, here and in the simulators people could pick instead, in one run.

Runs the studies, holds the promises against what they found, and writes the report.
``python -m benchmarks --help`` from the project root, or
``./arm bench``.
"""
