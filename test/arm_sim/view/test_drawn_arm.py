# SPDX-License-Identifier: Apache-2.0
"""The contents of a page's scene, on the server's side."""

import asyncio
import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import ArmModel, load_scene
from arm_sim import Simulator
from arm_sim.view.drawn_arm import PATH_POINTS, DrawnArm, _cones, _glb, lay_ground
from arm_sim.view.interactive import Interactive
from arm_sim.view.interactive_arm import InteractiveArm
from arm_sim.view.marks import Instant, Marker
from arm_sim.view.shapes import METAL, PIVOT, RAIL, Visual, visuals_of

pytestmark = pytest.mark.group("view")


def test_a_broken_mesh_is_reported_and_replaced(
    server: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    mesh = tmp_path / "arm.dae"
    mesh.write_bytes(b"no mesh at all \x00\xff")
    urdf = (models.SCENES / "two_link.urdf").read_text()
    visual = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>'
    broken = urdf.replace("</inertial>\n  </link>", f"</inertial>{visual}", 1)
    actor = DrawnArm(server, ArmModel(load_scene(broken)), "arm")
    assert f"link 'upper_arm' is drawn without its mesh {mesh}" in caplog.text
    assert "shoulder" in [name for name, _ in actor.links]  # its capsule


def test_a_friction_cone_holds_the_directions_of_forces_that_stick() -> None:
    mu, normal = 0.5, np.array([0.0, 0.6, 0.8])
    along = np.array([1.0, 0.0, 0.0])
    arrow = np.array([[[1.0, 2.0, 3.0], [1.0, 2.0, 3.0] + 0.2 * normal + 0.05 * along]])
    lines = _cones(arrow, mu * normal[None])
    ways = lines.reshape(-1, 3) - arrow[0, 0]
    rim = ways[np.linalg.norm(ways, axis=1) > 1e-12]
    np.testing.assert_allclose(rim @ normal, 0.2)  # as high as the normal force
    across = np.linalg.norm(rim - 0.2 * normal, axis=1)
    np.testing.assert_allclose(across, mu * 0.2)  # a force there would begin to slide
    assert len(_cones(arrow, 0.0 * normal[None])) == 0


def test_contacts_are_drawn_with_their_cones(server: Any) -> None:
    sim = Simulator("table_arm")
    sim.run(0.2)
    instant, actor = InteractiveArm(sim).instant(), DrawnArm(server, sim.model, "arm")
    ((_, contact),), (force,) = sim.model.scene.contacts, sim.contact_forces()
    np.testing.assert_array_equal(instant.contacts[0, :2], [force.point, force.force])
    np.testing.assert_allclose(instant.contacts[0, 2], [0.0, 0.0, contact.sticking], atol=1e-12)
    actor.draw(instant)
    cone = actor._marks["friction cones"].handle
    assert force.normal > 0.0 and cone.visible
    actor.show("friction cones", False)
    assert not cone.visible
    arrows = actor._marks["contact forces"].handle
    actor.draw(replace(instant, contacts=instant.contacts[:0]))
    actor.show("contact forces", True)  # what is over is not shown again
    assert not arrows.visible


def test_a_dragged_link_is_pulled_at_the_point_that_is_held(server: Any) -> None:
    sim, link = Simulator("two_link"), Mock()
    rig, actor = InteractiveArm(sim), DrawnArm(server, sim.model, "arm", base=(0.0, 2.0, 0.0))
    actor.links = [("elbow", link)]
    bench = Interactive(server, [actor], [rig])
    ((dragged,), _) = link.on_drag.call_args
    marker, h = Marker(sim.model), 1e-6
    lever = np.array([0.3, 0.0, 0.1])  # of the point that is held, from the elbow

    def held(q: np.ndarray) -> np.ndarray:
        """Where that point of the forearm is, with the arm standing at the side."""
        turn = q.sum() - sim.state.q.sum()
        c, s = np.cos(turn), np.sin(turn)  # a positive angle lifts
        x, z = c * lever[0] - s * lever[2], s * lever[0] + c * lever[2]
        elbow = marker.at(Instant(q)).position[2]
        return np.asarray(actor.base + elbow + [x, 0.0, z])

    q = sim.state.q
    start, mouse = held(q), held(q) + [0.0, 0.0, 0.2]
    event = SimpleNamespace(phase="update", start_position=start, end_position=mouse)
    asyncio.run(dragged(event))
    bench._orders.get()()
    J = np.array([(held(q + d) - held(q - d)) / (2 * h) for d in h * np.eye(2)])
    along = J[:, 2]  # the way is upward
    mass = 1.0 / (along @ np.linalg.solve(sim.dynamics.mass_matrix(q), along))
    force = 2.0 * 9.81 * mass / actor.size * (mouse - start)
    assert mass < sim.model.total_mass
    np.testing.assert_allclose(rig.external, J @ force, rtol=1e-6)
    asyncio.run(dragged(SimpleNamespace(phase="end")))
    bench._orders.get()()
    assert not rig.external.any()


def test_springs_and_the_path_are_seen_where_they_are_and_hidden_on_request(server: Any) -> None:
    model = Simulator("spring_balanced_arm").model
    actor = DrawnArm(server, model, "arm")
    marks = actor.draw(Instant(model.q0))
    springs, path = actor._marks["springs"].handle, actor._marks["path"].handle
    assert springs.visible and not path.visible
    np.testing.assert_allclose(springs.points[0, 0], marks.springs[0, 0], rtol=1e-6)
    for k in range(PATH_POINTS + 50):
        hand = actor.draw(Instant(model.q0 + 0.02 * k), leave_path=True).hand
    assert path.visible and len(path.points) == PATH_POINTS
    np.testing.assert_allclose(path.points[-1, 1], hand, rtol=1e-6, atol=1e-7)
    actor.show("path", False)
    assert not path.visible
    actor.show("path", True)
    actor.clear_path()
    assert not path.visible


def floor(server: Any, actor: DrawnArm, monkeypatch: pytest.MonkeyPatch) -> float:
    """Height of the ground under an arm."""
    laid: dict[str, Any] = {}
    monkeypatch.setattr(server.scene, "add_grid", lambda *_, **more: laid.update(more))
    lay_ground(server, [actor], 0.0)
    return float(laid["position"][2])


def test_the_ground_is_below_an_arm_with_a_base_that_hangs(
    server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    foot = '<link name="base"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>'
    urdf = (models.SCENES / "two_link.urdf").read_text().replace('<link name="base"/>', foot)
    for angle, lowest in ((0.5, 0.0), (-0.5, 0.5 * np.sin(-0.5))):  # that of the elbow
        start = {"position": {"shoulder": angle, "elbow": 0.0}}
        model = ArmModel(load_scene({"robot": {"urdf": urdf}, "initial": start}))
        actor = DrawnArm(server, model, "arm")
        below = 0.15 * actor.size if angle < 0.0 else 0.0
        assert floor(server, actor, monkeypatch) == pytest.approx(lowest - below)
    assert not {PIVOT, RAIL} & {visual.name for visual in visuals_of(model)}


@pytest.mark.parametrize("scene", ["cart_pendulum", "four_bar"])
def test_an_arm_without_a_base_has_pivots_and_is_above_the_ground_wherever_it_moves(
    scene: str, server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = Simulator(scene).model
    pivots = [visual for visual in visuals_of(model) if visual.name in (PIVOT, RAIL)]
    roots = [i for i in range(1, model.pin.njoints) if model.pin.parents[i] == 0]
    places = [model.pin.jointPlacements[i].translation for i in roots]
    np.testing.assert_array_equal([x.placement.translation for x in pivots], places)
    axis = [1.0, 0.0, 0.0] if scene == "cart_pendulum" else [0.0, -1.0, 0.0]
    np.testing.assert_allclose(pivots[0].placement.rotation[:, 2], axis, atol=1e-12)
    actor = DrawnArm(server, model, "arm")
    turns = np.stack(np.meshgrid(*[np.linspace(-3.0, 3.0, 7)] * model.n), axis=-1)
    reached = [actor.marker.extent(q) for q in turns.reshape(-1, model.n)]
    assert floor(server, actor, monkeypatch) < np.concatenate(reached)[:, 2].min()


def test_a_mesh_has_its_scale_and_a_colour_if_its_file_has_none(tmp_path: Path) -> None:
    import trimesh

    size = np.array([200.0, 100.0, 50.0])
    file, scale = tmp_path / "box.stl", (1e-3, 1e-3, 2e-3)
    trimesh.creation.box(size).export(file)
    for colour in ((0.2, 0.4, 0.6, 0.5), None):
        visual = Visual("box", 1, pin.SE3.Identity(), "mesh", scale, colour, file)
        data, drawn_scale = _glb(visual)
        assert drawn_scale == scale
        drawn = trimesh.load_scene(io.BytesIO(data), file_type="glb")
        np.testing.assert_allclose(drawn.extents, size, rtol=1e-6)
        (geometry,) = drawn.geometry.values()
        wanted = [round(255 * x) for x in colour or METAL]
        assert geometry.visual.material.baseColorFactor.tolist() == wanted
