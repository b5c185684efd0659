# SPDX-License-Identifier: Apache-2.0
"""The camera of each visitor: the whole arm in what the panels of a page leave free."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from arm_dynamics.arrays import Array

if TYPE_CHECKING:
    import viser

FIELD = 0.7  # [rad] vertical field of view of the camera
TO_CAMERA = np.array([1.1, -0.8, 0.5])  # from the arm
SLENDER = 0.7  # width over length, seen from above, of what is seen from the side
PORTRAIT_BELOW = 0.75  # width over height, of the page of a telephone
FILLED_PART = 0.85  # of the picture by the arm, at most
ABOVE_SHEET = (0.27, 0.92)  # from -1, bottom, to 1: above the controls of a telephone
MOVED_TOLERANCE = 1e-3  # of a distance: a camera nearer was not moved by the visitor


def axes(to_camera: Array) -> Array:
    """To the right, up and forward of a camera that looks back along a direction, as rows."""
    forward = -to_camera / np.linalg.norm(to_camera)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def direction(joint_axes: Array, points: Array) -> Array:
    """From arms to the camera, such that they extend across the picture.

    Almost along joint axes, shape (3, k), if all are level and one; else along that level
    direction in which points, shape (k, 3), extend least, if it is much less than across it.
    """
    directions, sizes, _ = np.linalg.svd(joint_axes)
    axis = directions[:, 0]
    if sizes[:1].sum() == 0.0 or sizes[1:].any() > 1e-6 or abs(axis[2]) > 0.7:
        level = points[:, :2] - points[:, :2].mean(axis=0)
        _, spread, ways = np.linalg.svd(level, full_matrices=False)
        if spread[1] > SLENDER * spread[0]:
            return TO_CAMERA
        axis = np.append(ways[1], 0.0)
    way: Array = np.sign(axis @ TO_CAMERA) * axis + 0.35 * TO_CAMERA + [0.0, 0.0, 0.2]
    return way


def fitted(
    points: Array, nearest: float, aspect: float, to_camera: Array = TO_CAMERA
) -> tuple[Array, Array]:
    """The nearest camera from which all points are in the free part of its picture, centred.

    Each edge of that part is a plane through the camera behind which no point may be: an
    inequality that is linear in the camera's position. Those of opposite edges determine how near
    it may be.

    Args:
        points: In [m], shape (k, 3).
        nearest: Least distance from the middle of the points in [m].
        aspect: Width over height of the picture.
        to_camera: Direction of the camera from the arm.

    Returns:
        Its position, and a point that it looks at, at the distance of the points' middle.
    """
    x, y, depth = axes(to_camera) @ points.T
    side = FILLED_PART * aspect
    edges = np.array(ABOVE_SHEET if aspect < PORTRAIT_BELOW else (-FILLED_PART, FILLED_PART))
    bounds = [
        (np.max(low * depth - s), np.max(s - high * depth), low, high)
        for s, (low, high) in (
            (x, np.tan(FIELD / 2) * np.array([-side, side])), (y, np.tan(FIELD / 2) * edges)
        )
    ]  # fmt: skip
    middle = (depth.min() + depth.max()) / 2
    near = min(-(below + above) / (high - low) for below, above, low, high in bounds)
    near = min(near, middle - nearest)
    place = [(above - below + (high + low) * near) / 2 for below, above, low, high in bounds]
    position = np.array([*place, near]) @ axes(to_camera)
    return position, position + (middle - near) * axes(to_camera)[2]


def keep_framed(
    server: viser.ViserServer, points: Array, nearest: float, to_camera: Array = TO_CAMERA
) -> None:
    """Frame points for everybody who opens a page, until they move the camera themselves."""
    first = server.initial_camera  # also of pages without a server
    first.fov = FIELD
    first.position, first.look_at = fitted(points, nearest, 1.0, to_camera)

    async def welcome(client: viser.ClientHandle) -> None:
        placed, aspect = [first.position], 0.0

        async def adapt(_: object = None) -> None:
            nonlocal aspect
            camera = client.camera
            near = MOVED_TOLERANCE * np.linalg.norm(camera.position - camera.look_at)
            moved = min(np.linalg.norm(camera.position - place) for place in placed) > near
            if moved or abs(camera.aspect - aspect) < MOVED_TOLERANCE * aspect:
                return
            aspect = camera.aspect
            position, look_at = fitted(points, nearest, aspect, to_camera)
            placed.append(position)
            with client.atomic():
                camera.position, camera.look_at = position, look_at

        client.camera.on_update(adapt)
        await adapt()

    server.on_client_connect(welcome)
