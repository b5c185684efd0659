# SPDX-License-Identifier: Apache-2.0
"""Functional mock-up units of an exported library."""

from arm_sim.export.fmu.archive import build_fmus

__all__ = ["build_fmus"]
