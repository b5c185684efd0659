# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot, and where it is."""

import numpy as np
import pinocchio as pin
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.model import Robot
from arm_sim.view.shapes import Visual, visuals_of

ROD = """<robot name="rod">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0 0 0.4"/><mass value="2"/>
      <inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial>
    {visual}
  </link>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/>
    <axis xyz="1 0 0"/></joint>
</robot>"""
RADIUS, LENGTH, MASS = 0.03, 0.8, 2.0


def rod(visual: str = "") -> Robot:
    """A cylinder on a hinge: moments of a solid one, as in any table."""
    along, across = MASS * RADIUS**2 / 2, MASS * (3 * RADIUS**2 + LENGTH**2) / 12
    return Robot(load_scene(ROD.format(across=across, along=along, visual=visual)))


def visual(geometry: str, material: str = "") -> str:
    origin = '<origin xyz="0 0 0.4" rpy="0 0 1"/>'
    return f"<visual>{origin}<geometry>{geometry}</geometry>{material}</visual>"


def test_a_link_without_visuals_is_the_cylinder_of_its_inertia() -> None:
    capsule, bone, _ = visuals_of(rod())  # and its pivot
    assert capsule.kind == "capsule" == bone.kind
    assert capsule.size == pytest.approx((2 * RADIUS, 2 * RADIUS, LENGTH))
    np.testing.assert_allclose(capsule.placement.translation, [0.0, 0.0, 0.4])
    np.testing.assert_allclose(abs(capsule.placement.rotation[:, 2]), [0.0, 0.0, 1.0], atol=1e-12)
    assert bone.joint == capsule.joint == 1


def test_point_masses_are_balls_and_hinges_between_bodies_pins() -> None:
    drawn = visuals_of(ArmModel(load_scene("double_pendulum")))
    lower = [x for x in drawn if x.joint == 2]
    assert [x.kind for x in lower] == ["sphere", "cylinder", "capsule"]  # mass, pin, rod
    assert abs(lower[1].placement.rotation[:, 2] @ [0.0, 1.0, 0.0]) == pytest.approx(1.0)


@pytest.mark.parametrize(("geometry", "size"), [
    ('<box size="1 2 3"/>', (1.0, 2.0, 3.0)),
    ('<capsule radius="0.1" length="2"/>', (0.2, 0.2, 2.0)),
    ('<sphere radius="0.3"/>', (0.6, 0.6, 0.6)),
])  # fmt: skip
def test_visuals_of_the_description_are_drawn(geometry: str, size: tuple[float, ...]) -> None:
    drawn, _ = visuals_of(rod(visual(geometry, '<material name="blue"/>')))
    assert (drawn.kind, drawn.size) == (geometry[1:].split()[0], size)
    np.testing.assert_allclose(np.ptp(drawn.corners, axis=0)[2], size[2])
    assert drawn.colour == (0.0, 0.0, 1.0, 1.0)
    np.testing.assert_allclose(drawn.placement.rotation, pin.utils.rotate("z", 1.0))
    np.testing.assert_allclose(drawn.placement.translation, [0.0, 0.0, 0.4])


@pytest.mark.parametrize(("geometry", "told"), [
    ('<mesh filename="package://nowhere/arm.stl"/>', "no file 'package://nowhere/arm.stl'"),
    ("<pyramid/>", "<pyramid>; allowed: mesh, box"),
    ("<sphere/>", "the size of its <sphere> is not known"),
])  # fmt: skip
def test_a_visual_that_cannot_be_drawn_is_reported_and_replaced(
    geometry: str, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    drawn = visuals_of(rod(visual(geometry)))
    assert told in caplog.text and "link 'rod'" in caplog.text
    assert drawn[0].kind == "capsule"


def test_payloads_planes_and_contact_points_are_drawn() -> None:
    scene = {
        "robot": {"urdf": rod().scene.robot.urdf},
        "payloads": [{"frame": "rod", "mass": 2.0, "com": [0.1, 0.0, 0.0],
                      "inertia": [1e-3, 0, 0, 1e-3, 0, 1e-3]}],
        "constraints": [{"type": "contact", "frame": "rod", "radius": 0.03,
                         "plane": {"point": [0, 0, -3], "normal": [0, 1, 0]}}],
    }  # fmt: skip
    drawn: dict[str, Visual] = {v.name: v for v in visuals_of(Robot(load_scene(scene)))}
    radius = drawn["payload_0"].size[0] / 2
    assert 4 / 3 * np.pi * radius**3 * 1000.0 == pytest.approx(2.0)
    assert (drawn["contact_0"].kind, drawn["contact_0"].size[0]) == ("sphere", 0.06)
    plane = drawn["contact_0_plane"]
    assert plane.joint == 0
    np.testing.assert_allclose(plane.placement.rotation[:, 2], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(plane.placement.translation, [0.0, 0.0, -3.0])
