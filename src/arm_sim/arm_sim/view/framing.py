# SPDX-License-Identifier: Apache-2.0
"""The camera of each visitor: the whole arm in what the panels of a page leave free."""

from __future__ import annotations

from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array

if TYPE_CHECKING:
    import viser

FIELD = 0.7  # [rad] vertical field of view of the camera
WAY = np.array([1.1, -0.8, 0.5])  # from the arm to the camera
TALL = 0.75  # width over height below which a page is that of a telephone
WHOLE = (-0.85, 0.85, -0.85, 0.85)
"""Part of the picture that the arm fills at most: left, right, bottom, top, of -1 to 1."""
ABOVE_SHEET = (-0.85, 0.85, 0.27, 0.92)
"""The same above the controls of a telephone, which cover up to 60 % of the page."""
SAME = 1e-3  # of a distance: a camera there was not moved by the visitor


def area(aspect: float) -> tuple[float, float, float, float]:
    """What is free of a picture of this width over height."""
    return ABOVE_SHEET if aspect < TALL else WHOLE


def seen(points: Array, position: Array, look_at: Array, aspect: float) -> Array:
    """Where points, shape (k, 3), are in the picture: right and up, -1 to 1, shape (k, 2)."""
    right, up, forward = _axes(position - look_at)
    ways = (points - position) @ np.stack([right, up, forward], axis=1)
    return np.asarray(ways[:, :2] / ways[:, 2:] / np.tan(FIELD / 2) / [aspect, 1.0])


def orientation(position: Array, look_at: Array) -> Array:
    """Quaternion w, x, y, z of a camera, whose axes are right, down and forward, shape (4,)."""
    right, up, forward = _axes(position - look_at)
    turned = pin.Quaternion(np.stack([right, -up, forward], axis=1))
    return np.asarray(np.roll(turned.coeffs(), 1))


def fitted(points: Array, aspect: float) -> tuple[Array, Array]:
    """The nearest camera from which all points are in the free area, and in its middle.

    Each edge of the area is a plane through the camera behind which no point may be: an inequality
    that is linear in the camera's position. Those of opposite edges determine how near it may be.

    Args:
        points: In [m], shape (k, 3).
        aspect: Width over height of the picture.

    Returns:
        Its position, and a point that it looks at, at the distance of the points' middle.
    """
    left, right, bottom, top = np.array(area(aspect)) * np.tan(FIELD / 2)
    axes = np.stack(_axes(WAY))
    x, y, depth = axes @ points.T
    sides = (x, left * aspect, right * aspect), (y, bottom, top)
    bounds = [(np.max(low * depth - s), np.max(s - high * depth)) for s, low, high in sides]
    near = min(
        -(below + above) / (high - low)
        for (below, above), (_, low, high) in zip(bounds, sides, strict=True)
    )
    place = [
        (above + high * near + low * near - below) / 2
        for (below, above), (_, low, high) in zip(bounds, sides, strict=True)
    ]
    position = np.array([*place, near]) @ axes
    distance = (depth.min() + depth.max()) / 2 - near
    return position, position + distance * axes[2]


def keep_framed(server: viser.ViserServer, points: Array) -> None:
    """Frame the arms for everybody who opens a page, until they move the camera themselves.

    Args:
        server: The page, with an initial camera.
        points: Points around the arms in [m], shape (k, 3).
    """
    camera = server.initial_camera
    first = np.array(camera.position), np.array(camera.look_at)

    def welcome(client: viser.ClientHandle) -> None:
        framed = _Framed(client, points, first)
        client.camera.on_update(lambda _: framed.adapt())
        framed.adapt()

    server.on_client_connect(welcome)


class _Framed:
    """The camera of one visitor."""

    def __init__(
        self, client: viser.ClientHandle, points: Array, first: tuple[Array, Array]
    ) -> None:
        self._client, self._points = client, points
        self._ours, self._aspect = [first], 0.0
        self._one_at_a_time = Lock()  # the library calls from several threads

    def adapt(self) -> None:
        """Frame the arms if the size of the picture has changed and the camera is still ours."""
        with self._one_at_a_time:
            self._adapt()

    def _adapt(self) -> None:
        camera = self._client.camera
        here, aspect = (np.array(camera.position), np.array(camera.look_at)), camera.aspect
        ours = any(_same(here, pose) for pose in self._ours)
        if not ours or abs(aspect - self._aspect) < SAME * aspect:
            return
        self._aspect = aspect
        pose = self._ours[0]
        low_x, high_x, low_y, high_y = area(aspect)
        x, y = seen(self._points, *pose, aspect).T
        if min(x) < low_x or max(x) > high_x or min(y) < low_y or max(y) > high_y:
            pose = fitted(self._points, aspect)
        if _same(pose, here):
            return
        self._ours.append(pose)
        with self._client.atomic():
            camera.position, camera.look_at = pose


def _same(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    size = float(np.linalg.norm(one[0] - one[1]))
    return all(float(np.linalg.norm(a - b)) < SAME * size for a, b in zip(one, other, strict=True))


def _axes(way: Array) -> tuple[Array, Array, Array]:
    """To the right, up and forward of a camera at ``way`` from what it looks at."""
    forward = -way / np.linalg.norm(way)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward
