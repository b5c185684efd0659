# SPDX-License-Identifier: Apache-2.0
"""Hard arms on purpose: does anything fail without saying so?

``python -m benchmarks.stress --help`` from the project root, or ``./arm stress``.
"""
