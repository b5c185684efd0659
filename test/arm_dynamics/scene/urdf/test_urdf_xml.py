# SPDX-License-Identifier: Apache-2.0
"""XML that urdfdom reads is read: what is around the robot description changes nothing."""

from pathlib import Path

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, Dynamics, ModelError, SceneError, load_scene
from arm_dynamics.scene.load import SceneSource
from arm_sim.cli.urdf import TOPICS, with_hardware
from arm_sim.view.shapes import visuals_of
from arm_studies.identification.identified_scene import urdf_with

URDF = (models.FOLDER / "planar_3r.urdf").read_text()
BODY = URDF[URDF.index("<robot") :]


def arm(source: SceneSource) -> ArmModel:
    return ArmModel(load_scene(source))


UNUSUAL = {
    "declaration after a comment": f'<!-- by hand -->\n<?xml version="1.0"?>{BODY}',
    "byte order mark before a blank line": f'\ufeff\n<?xml version="1.0"?>{BODY}',
    "encoding that the text no longer has": f'<?xml version="1.0" encoding="UTF-16"?>{BODY}',
    "unbound prefix of an attribute": BODY.replace("<link ", '<link gz:colour="red" ', 1),
    "dashes that are no comment": BODY.replace(
        "</robot>", "<note a='-->'>--> <![CDATA[ <!-- -- ]]> <?a <!-- -- ?></note></robot>"
    ),
}


@pytest.mark.parametrize("text", UNUSUAL.values(), ids=UNUSUAL)
def test_all_that_reads_descriptions_reads_it(text: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(text.replace("\n", "\r\n"), encoding="utf-8")
    model, expected = arm(text), arm(URDF)
    assert model.whole == arm(tmp_path / "arm.urdf").whole == expected.whole
    assert len(visuals_of(model)) == len(visuals_of(expected))
    theta = np.concatenate([body.toDynamicParameters() for body in list(model.pin.inertias)[1:]])
    for written in (urdf_with(model, theta), with_hardware(model, "effort", TOPICS, {})):
        q = [0.3, 0.2, -0.4]
        np.testing.assert_allclose(
            Dynamics(written).gravity(q), Dynamics(URDF).gravity(q), rtol=1e-12
        )


def test_a_file_of_another_encoding_is_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As by parsers to which names are bytes."""
    text = BODY.replace("</robot>", "<!-- \u00e9paule --></robot>").replace(
        "link3", "poign\u00e9e"
    )
    path = tmp_path / "arm.urdf"
    path.write_bytes(f'<?xml version="1.0" encoding="ISO-8859-1"?>{text}'.encode("latin-1"))
    model = arm(path)
    assert model.has_frame("poign\u00e9e")
    assert model.whole.inertias[3] == arm(URDF).whole.inertias[3]
    assert f"'{path}' is not UTF-8: read as Latin-1" in caplog.text
    path.write_text(f'<?xml version="1.0"?>{text}', "utf-16")  # as shells of Windows write it
    assert arm(path).has_frame("poign\u00e9e")
    path.write_text(text, "utf-16-le")  # without its mark
    with pytest.raises(SceneError, match=f"'{path}' is not text; a scene .* is expected"):
        load_scene(path)


def test_comments_leave_errors_where_they_are() -> None:
    text = BODY.replace("</robot>", "<!-- -- \n -- --> <b></robot>")
    line = BODY.count("\n", 0, BODY.index("</robot>")) + 2
    with pytest.raises(ModelError, match=f"mismatched tag: line {line}, column 13$"):
        load_scene(text)


def test_what_never_ends_is_refused() -> None:
    with pytest.raises(ModelError, match="not well-formed XML"):
        load_scene(BODY.replace("</robot>", "<!-- -- " * 30000))


def test_a_comment_in_a_comment_is_refused() -> None:
    """It ends at the first end, so that what follows would count."""
    text = BODY.replace("</robot>", "\n<!-- <!-- old -->\n<link name='a'/> --></robot>")
    line = BODY.count("\n", 0, BODY.index("</robot>")) + 3
    with pytest.raises(ModelError, match=f"line {line}: '-->' ends no comment"):
        load_scene(text)
