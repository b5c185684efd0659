# SPDX-License-Identifier: Apache-2.0
"""Joint torques that exert a wrench on the world, Jᵀ f."""

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, each, real_array
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.frame_motion import FrameMotion, check_moving
from arm_dynamics.scene.constraint import ORIGIN


def contact_torque(
    model: ArmModel, q: Array, wrench: ArrayLike, frame: str | None = None
) -> Array:
    """Joint torques that exert a wrench: Jᵀ f, equal to Aᵀλ where f is a constraint force.

    Args:
        model: The arm.
        q: Joint positions in [rad] or [m], shape (n,) or (k, n).
        wrench: Force in [N], shape (3,), or force and moment in [N m], shape (6,), that the arm
            exerts upon the world, in the world's axes; or a row for each of k.
        frame: Frame at whose origin the wrench acts; None for the scene's only contact with the
            world.

    Returns:
        Joint torques in [N m] or [N], shape of ``q``, to be added to those of the motion.

    Raises:
        InvalidInput: If a shape, value or name is not allowed, or ``frame`` is expected.
    """
    point = offset = ORIGIN
    if frame is None:
        places = [c.at_world for c in model.scene.constraints if c.at_world is not None]
        if len(places) != 1:
            raise InvalidInput(
                f"frame is expected: the scene has {len(places)} places that touch the world; "
                f"allowed: {known_names(model.frame_names)}"
            )
        ((frame, point, offset),) = places
    f = real_array("wrench", wrench)
    if f.shape[-1:] not in ((3,), (6,)) or not np.isfinite(f).all():
        raise InvalidInput(
            f"wrench = {wrench!r}: 3 finite numbers, a force, or 6, force and moment, are expected"
        )
    if f.shape[:-1] not in ((), q.shape[:-1]):
        rows = f"a row for each of {len(q)} positions" if q.ndim == 2 else f"({f.shape[-1]},)"
        raise InvalidInput(f"wrench has shape {f.shape}; {rows} is expected")
    check_moving(model, frame)
    motion = FrameMotion(model, frame, "local_world_aligned")

    def push(qi: Array, fi: Array) -> Array:
        _, J = motion.of_point(qi, point, offset)
        return np.asarray(J[: len(fi)].T @ fi)

    return each(push, q, np.broadcast_to(f, (*q.shape[:-1], f.shape[-1])))
