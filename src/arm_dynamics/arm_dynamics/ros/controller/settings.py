# SPDX-License-Identifier: Apache-2.0
"""From the controller node's parameters to what the core's controllers are told."""

from __future__ import annotations

from arm_dynamics.arrays import Array
from arm_dynamics.control.factory import Settings
from arm_dynamics.ros.common.params import ControllerParams, one_or_all, task_axes


def settings_of(params: ControllerParams, limit: Array) -> Settings:
    """Settings of a controller.

    Args:
        params: The node's parameters.
        limit: Torque limits in [N m] or [N], shape (n,).
    """
    return Settings(
        dt=params.control_period,
        bandwidth=one_or_all(params.bandwidth),
        damping_ratio=one_or_all(params.damping_ratio),
        frame=params.task_frame or None,
        axes=task_axes(params),
        direction=tuple(params.force_direction),
        force=params.force,
        friction=params.friction,
        observer=params.observer or None,
        limit=limit,
        saturate=params.saturate,
    )
