# SPDX-License-Identifier: Apache-2.0
"""The arm model of a scene, with warnings of implausible values."""

import logging

from arm_dynamics.dynamics.plausibility import implausible_values
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.load import SceneSource, load_scene, naming

_log = logging.getLogger(__name__)


def arm_model(source: SceneSource | ArmModel) -> ArmModel:
    """Build the arm model of a scene, with warnings; a model is returned unchanged.

    Args:
        source: Anything ``load_scene`` takes, or a model.

    Raises:
        SceneError: If the scene is invalid; names the file, if there is one.
    """
    if isinstance(source, ArmModel):
        return source
    scene = load_scene(source)
    with naming(source):
        model = ArmModel(scene)
    for remark in implausible_values(model):
        _log.warning("scene: %s", remark)
    return model
