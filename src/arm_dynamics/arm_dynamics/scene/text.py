# SPDX-License-Identifier: Apache-2.0
"""A scene as text, to be saved with results and read again bit for bit."""

from typing import Any

import yaml

from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.schema import Scene, validated
from arm_dynamics.scene.types import AS_CHECKED


def scene_text(scene: Scene, urdf: str) -> str:
    """A scene as the text of a scene file.

    Args:
        scene: A scene that was loaded.
        urdf: File name of its robot description, whose text is ``scene.robot.urdf``.

    Returns:
        YAML; numbers are written so that they are read back bit for bit.
    """
    content = scene.model_dump(exclude_unset=True, mode="json")
    content["robot"]["urdf"] = urdf
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True)


def scene_of(text: str, urdf: str) -> Scene:
    """The scene of ``scene_text``, with the text of its robot description.

    Raises:
        SceneError: If the text is not a scene.
    """
    try:
        content: Any = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SceneError(f"scene: the text is not well-formed YAML: {error}") from None
    if not isinstance(content, dict) or not isinstance(content.get("robot"), dict):
        raise SceneError("scene: the text is not a scene; a mapping with 'robot' is expected")
    return validated({**content, "robot": {**content["robot"], "urdf": urdf}}, AS_CHECKED)
