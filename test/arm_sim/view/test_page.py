# SPDX-License-Identifier: Apache-2.0
"""What a real browser draws, and what its buttons do."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Page, needed, opened
from samples import sampled

from arm_dynamics import Dynamics
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.exceptions import ViewError
from arm_sim.view import Chart, Film, View, show
from arm_sim.view.interactive import NOTHING
from arm_sim.view.player import Player

SHARP = 1e-5  # [rad] of what single precision and the renderer's matrices leave


pytestmark = pytest.mark.group("view")


@pytest.fixture(scope="module", autouse=True)
def _browser() -> None:
    needed()


@pytest.fixture(scope="module")
def panda() -> Simulator:
    return Simulator("panda")


@pytest.fixture
def touched(panda: Simulator) -> Iterator[tuple[View, Page]]:
    """A simulation in a page."""
    panda.reset()
    with (
        show(panda, port=0) as view,
        opened(view.url, "/panda/panda_joint7", size=(1300, 560)) as page,
    ):
        yield view, page


def let_fall(view: View) -> None:
    """Choose no controller, as the menu of the page does."""
    view.source.loop.order(lambda: view.source._choose(NOTHING))


def assert_drawn(page: Page, simulator: Simulator, name: str = "panda") -> None:
    """The page comes to show the state, and shows it to rounding."""
    q = simulator.state.q

    def drawn() -> bool:
        off = page.angles(name, simulator.model) - q
        return bool(abs(np.angle(np.exp(1j * off))).max() < SHARP)  # whole turns look alike

    page.until(drawn, f"q = {q}")


def test_a_scene_runs_pauses_steps_and_resets(
    touched: tuple[View, Page], panda: Simulator
) -> None:
    view, page = touched
    assert_drawn(page, panda)
    page.click("Step")
    page.until(lambda: panda.state.step == 1, "a tick")
    page.click("Run")
    page.until(lambda: panda.state.time > 0.2, "time to pass")
    assert abs(panda.state.q - panda.model.q0).max() < 1e-6  # its weight is carried
    weight = f"{panda.dynamics.gravity(panda.model.q0)[3]:.4g}"
    page.until(lambda: page.handle.get_by_text(weight).count(), "its torque in the legend")
    fall = panda.state.time
    let_fall(view)
    page.until(lambda: panda.state.time > fall + 0.2, "time to pass")
    page.click("Pause")
    page.until(lambda: page.handle.get_by_text("paused").is_visible(), "the pause")
    stopped = panda.state.step
    assert_drawn(page, panda)
    assert panda.state.step == stopped
    assert abs(panda.state.q - panda.model.q0).max() > 0.05
    page.click("Reset")
    page.until(lambda: panda.state.step == 0, "the start")
    assert_drawn(page, panda)
    np.testing.assert_array_equal(panda.state.q, panda.model.q0)


def test_a_slider_places_a_joint(touched: tuple[View, Page], panda: Simulator) -> None:
    _, page = touched
    box = page.handle.get_by_role("textbox").filter(visible=True)
    fields = [f for f in box.all() if f.input_value().startswith(f"{panda.model.q0[3]:.3f}"[:5])]
    fields[0].fill("-1.5")
    fields[0].press("Enter")
    page.until(lambda: abs(panda.state.q[3] + 1.5) < 2e-3, "joint 4 at -1.5")
    assert_drawn(page, panda)


# Values of the boxes of the page that are wider than their box.
_CUT = """() => [...document.querySelectorAll('input')].filter(
  box => box.offsetParent && box.scrollWidth > box.clientWidth).map(box => box.value)"""


@pytest.mark.parametrize("size", sampled([[420, 800], [1400, 900]], 1))
def test_a_page_has_the_name_of_the_robot_a_legend_and_boxes_that_hold_their_numbers(
    size: list[int],
) -> None:
    sim = Simulator("panda_table")
    with show(sim, port=0) as view, opened(view.url, "/panda/panda_joint7", size=size) as page:
        assert page.handle.title() == "panda"
        assert page.handle.get_by_text("panda", exact=True).count() == 1  # the heading
        for what in ("friction cone: inside, the contact sticks", "pull of the mouse"):
            assert page.handle.get_by_text(what).is_visible()
        page.handle.get_by_text("Push panda").dispatch_event("click")
        forces = page.handle.get_by_label("force y [N]")
        page.until(forces.is_visible, "the forces")
        forces.fill("-1250")
        wide = sim.model.q0 - [2.8124999, 0.0, 0.1111, 0.0, 0.1234, 0.0, 2.7777]
        view.source.loop.order(lambda: (view.source.rigs[0].place(wide), view.source.draw()))
        first = page.handle.locator("input[type=text][value='-2.812']")
        page.until(first.count, "its sliders")
        assert page.handle.evaluate(_CUT) == []
        first.evaluate("box => box.style.width = '2em'")
        assert page.handle.evaluate(_CUT) == ["-2.812"]  # the test would see it


def test_a_push_pushes(touched: tuple[View, Page], panda: Simulator) -> None:
    view, page = touched
    let_fall(view)
    alone = Dynamics(panda.model)  # which nothing pushes
    page.handle.get_by_text("Push panda").dispatch_event("click")
    page.until(lambda: page.handle.get_by_role("button", name="Push", exact=True).count(), "it")
    page.click("Push")
    rig = view.source.rigs[0]
    page.until(lambda: rig.wrenches.active, "the push")
    page.click("Step")
    page.until(lambda: panda.state.step == 1, "a tick")
    q, v = panda.model.q0, panda.model.v0
    pushed = alone.forward(q, v, 20.0 * _sideways(panda))  # 20 N along y, as offered
    assert abs(pushed - alone.forward(q, v, np.zeros(7))).max() > 10.0
    np.testing.assert_allclose(panda.state.v / panda.dt, pushed, rtol=5e-2, atol=0.5)
    view.close()
    outside = panda.arm.plant.parameters.of("external", panda.arm.parameters)
    assert not outside.any()  # a page takes its pushes along


class Touch:
    """A finger on a page, with the methods of playwright's mouse."""

    def __init__(self, page: Page) -> None:
        self._session = page.handle.context.new_cdp_session(page.handle)
        self._at, self._down = (0.0, 0.0), False

    def move(self, x: float, y: float, steps: int = 1) -> None:
        begin = np.array(self._at)
        for k in range(1, steps + 1):
            self._at = tuple(begin + k / steps * (np.array([x, y]) - begin))
            if self._down:
                self._send("touchMove")

    def down(self) -> None:
        self._down = True
        self._send("touchStart")

    def up(self) -> None:
        if self._down:
            self._send("touchEnd")
        self._down = False

    def _send(self, kind: str) -> None:
        x, y = self._at
        points = [] if kind == "touchEnd" else [{"x": x, "y": y}]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.mark.parametrize("by", sampled(["mouse", "touch"], 1))
def test_a_link_is_pulled_until_released(panda: Simulator, by: str) -> None:
    panda.reset()
    alone = Dynamics(panda.model)  # which nothing pushes
    with (
        show(panda, port=0) as view,
        opened(view.url, "/panda/panda_joint7", size=(1600, 900)) as page,
    ):
        let_fall(view)
        rig, finger = view.source.rigs[0], Touch(page) if by == "touch" else page.handle.mouse

        def pulled() -> bool:
            """Drag the elbow sideways, wherever the camera is by now."""
            finger.up()
            base, elbow = page.places("/panda/base", "/panda/panda_joint4")
            ends = np.array([elbow[:3, 3], elbow[:3, 3] + 0.3 * base[:3, 1]])
            (x, y), (beside, _) = page.pixels(ends)
            finger.move(x, y)
            finger.down()
            finger.move(beside, y, steps=8)
            page.handle.wait_for_timeout(200)
            return rig._pull is not None

        page.until(pulled, "the pull")
        page.click("Step")
        page.until(lambda: panda.state.step == 1, "a tick")
        q, v = panda.model.q0, panda.model.v0
        frame, *_ = rig._pull
        task = TaskSpace(alone, frame, "local_world_aligned")
        gained = panda.state.v / panda.dt - alone.forward(q, v, np.zeros(7))
        assert (task.jacobian(q) @ gained)[1] > 1.0  # to where the finger is, in m/s²
        finger.up()
        page.until(lambda: rig._pull is None, "its end")


def _sideways(panda: Simulator) -> np.ndarray:
    """How the hand moves sideways with each joint, by differences, shape (7,)."""
    from arm_sim.view.marks import Marker

    marker, q, h = Marker(panda.model), panda.model.q0, 1e-6
    ways = marker.path(np.vstack([q + h * np.eye(7), q - h * np.eye(7)]))
    return np.asarray((ways[:7] - ways[7:])[:, 1] / (2 * h))


def test_two_arms_are_drawn_beside_each_other(panda: Simulator) -> None:
    panda.reset()
    other = Simulator("ur10")
    with (
        show(panda, other, name=["left", "right"], port=0) as view,
        opened(view.url, "/left/panda_joint7", "/right/wrist_3_joint") as page,
    ):
        page.click("Run")
        page.until(lambda: other.state.time > 0.1, "time to pass")
        page.click("Pause")
        page.until(lambda: not view.source.running, "the pause")
        assert_drawn(page, panda, "left")
        assert_drawn(page, other, "right")
        assert panda.state.time == pytest.approx(other.state.time)
        left, right = page.places("/left/base", "/right/base")[:, :3, 3]
        assert np.linalg.norm(left - right) > 1.0


@pytest.fixture(scope="module")
def long_film(panda: Simulator) -> Film:
    """Ten minutes at 1 kHz."""
    time = np.arange(600_001) * 1e-3
    q = panda.model.q0 + 0.3 * np.sin(0.5 * time[:, None] + np.arange(7))
    return Film("arm", panda.model, time, q)


def test_ten_minutes_are_scrubbed_played_and_repeated(long_film: Film, panda: Simulator) -> None:
    with show(long_film, port=0) as view, opened(view.url, "/arm/panda_joint7") as page:
        player = view.source

        def drawn(row: int) -> bool:
            return bool(abs(page.angles("arm", panda.model) - long_film.q[row]).max() < SHARP)

        page.until(lambda: drawn(0), "the beginning")
        track = page.handle.locator(".mantine-Slider-track").first.bounding_box()
        middle = track["x"] + track["width"] / 2, track["y"] + track["height"] / 2
        page.handle.mouse.click(*middle)
        page.until(lambda: abs(player.time - 300.0) < 20.0, "the middle")
        page.until(lambda: drawn(round(1e3 * player.time)), "its positions")
        page.handle.wait_for_timeout(100)
        assert page.handle.evaluate(_CUT) == []
        page.click("Play")
        begun = player.time
        page.until(lambda: player.time > begun + 0.5, "time to pass")
        page.click("Pause")
        page.until(lambda: page.handle.get_by_role("button", name="Play").is_visible(), "a stop")
        page.until(lambda: drawn(int(1e3 * player.time + 1e-6)), "where it stopped")
        player.loop.order(lambda: player.seek(player.end - 0.05))
        page.click("Play")
        page.until(lambda: player.time < 10.0, "the beginning again")


def test_a_page_without_a_server_plays(panda: Simulator, tmp_path: Path) -> None:
    time = np.linspace(0.0, 2.0, 201)
    q = panda.model.q0 + 0.4 * time[:, None]
    with show(Film("arm", panda.model, time, q), port=0) as view:
        file = view.page(tmp_path / "arm.html", rate=10.0)
    with opened(file.as_uri(), "/arm/panda_joint7") as page:
        seen = [q[0]]

        def look() -> float:
            seen.append(page.angles("arm", panda.model))
            return float(abs(q - seen[-1]).max(axis=1).min())

        def moved() -> bool:
            look()
            return bool(abs(seen[-1] - seen[0]).max() > 0.1)

        page.until(lambda: look() < 1e-2, "all links")  # the browser adds one after the other
        seen = seen[-1:]
        page.until(moved, "the motion")
        for angles in seen:  # each is one of the states
            assert abs(q - angles).max(axis=1).min() < 1e-2


# Of every chart: how far along its first curve the cursor stands, and how many curves there are.
_CURVES = """() => [...document.querySelectorAll('#curves svg')].map(svg => {
  const curves = [...svg.querySelectorAll('.curve')];
  const [first, cursor] = [curves[0], svg.querySelector('.cursor')].map(x => x.getBBox());
  return [(cursor.x - first.x) / first.width, curves.length, first.height];
})"""


def test_beside_a_page_without_a_server_a_cursor_follows_the_player(
    panda: Simulator, tmp_path: Path
) -> None:
    time = np.linspace(0.0, 2.0, 201)
    q = panda.model.q0 + 0.4 * time[:, None]
    curves = Chart("position [rad]", panda.joint_names, time, q)
    flat = np.column_stack([np.full(201, 3.0), np.full(201, np.nan)])
    still = Chart("torque [N m]", ("known", "unknown"), time, flat)
    film = Film("arm", panda.model, time, q, charts=(curves, still))
    with show(film, port=0) as view:
        file = view.page(tmp_path / "arm.html", rate=8.0, speed=0.5)
    with opened(file.as_uri(), "/arm/panda_joint7") as page:
        half_a_second = q[50]  # at half the speed

        def at_rest() -> bool:
            page.handle.locator("#root input").first.fill(
                "1.0"
            )  # the player's time; it stops there
            off = page.angles("arm", panda.model) - half_a_second
            at = [along for along, *_ in page.handle.evaluate(_CURVES)]
            return bool(abs(off).max() < SHARP and np.allclose(at, 0.25, atol=2e-3))

        page.until(at_rest, "the picture and the cursor at half a second")
        charted = page.handle.evaluate(_CURVES)
        assert [count for _, count, _ in charted] == [7, 2]
        assert charted[0][2] > 10.0  # it rises
        texts = page.handle.locator("#curves h2").all_text_contents()
        assert texts == ["position [rad]", "torque [N m]"]


def test_the_file_of_a_recording_is_shown_and_a_closed_page_refuses(tmp_path: Path) -> None:
    path = Simulator("two_link", backend="vm").run(0.01).save(tmp_path / "run.mcap")
    with show(path, port=0) as page:  # a film, which plays
        assert isinstance(page.source, Player)
    for write in (page.picture, page.film, page.page):
        with pytest.raises(ViewError, match="the page is closed"):
            write(tmp_path / "a.png")
