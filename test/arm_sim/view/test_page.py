# SPDX-License-Identifier: Apache-2.0
"""What a real browser draws, and what its buttons do."""

from pathlib import Path

import numpy as np
import pytest
from browser import Page, needed, opened, slow_page
from PIL import Image

from arm_sim import Simulator
from arm_sim.view import pictures, show

SHARP = 1e-5  # [rad] of what single precision and the renderer's matrices leave


pytestmark = pytest.mark.group("view")


@pytest.fixture(scope="module", autouse=True)
def _browser() -> None:
    needed()


def is_drawn(page: Page, simulator: Simulator, name: str, q: np.ndarray) -> bool:
    off = page.angles(name, simulator.model) - q
    return bool(abs(np.angle(np.exp(1j * off))).max() < SHARP)  # whole turns look alike


def assert_drawn(page: Page, simulator: Simulator) -> None:
    """The page comes to show the state, and shows it to rounding."""
    q = simulator.state.q
    page.until(lambda: is_drawn(page, simulator, "two_link", q), f"q = {q}")


def test_a_scene_runs_pauses_steps_and_resets() -> None:
    """In a page that is wide enough for its charts; the arm is one that is quick to draw."""
    arm = Simulator("two_link")
    with show(arm, port=0) as view, opened(view.url, "/two_link/elbow", size=(1200, 320)) as page:
        assert_drawn(page, arm)
        page.click("Step")
        page.until(lambda: arm.state.step == 1, "a tick")
        page.click("Run")
        page.until(lambda: arm.state.time > 0.2, "time to pass")
        assert abs(arm.state.q - arm.model.q0).max() < 1e-6  # its weight is carried
        height = f"{arm.dynamics.energy(arm.model.q0, arm.model.v0)[1]:.4g}"
        page.until(lambda: page.handle.get_by_text(height).count(), "its energy in the legend")
        page.choose("controller", "nothing")
        page.until(lambda: abs(arm.state.q - arm.model.q0).max() > 0.05, "the fall")
        page.click("Pause")
        page.until(lambda: page.handle.get_by_text("paused").is_visible(), "the pause")
        stopped = arm.state.step
        assert_drawn(page, arm)
        assert arm.state.step == stopped
        page.click("Reset")
        page.until(lambda: arm.state.step == 0, "the start")
        assert_drawn(page, arm)
        np.testing.assert_array_equal(arm.state.q, arm.model.q0)


def test_a_page_without_a_server_plays_beside_its_figure(tmp_path: Path) -> None:
    arm = Simulator("two_link")
    run = arm.run(1.0)
    with show(run, port=0, name="left & <right>") as view:
        file = view.page(tmp_path / "arm.html", rate=8.0, speed=0.5)
        assert file.stat().st_size < 8e6
    with opened(file.as_uri(), "/left & <right>/elbow") as page:
        half_a_second = run.q[500]  # at half the speed

        def at_rest() -> bool:
            # the player's time; it stops there
            page.handle.locator("#root input").first.fill("1.0")
            return is_drawn(page, arm, "left & <right>", half_a_second)

        page.until(at_rest, "the picture at half a second")
        assert page.handle.title() == "left & <right>"
        figure = page.handle.locator("#figures img")
        assert figure.evaluate("image => image.naturalWidth") > 300


def test_a_picture_shows_the_arm_before_the_sky(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pictures, "page_in_browser", slow_page)
    sim = Simulator("two_link")
    sim.set_state(q=[1.2, 0.8])  # upwards
    with (
        show(sim, port=0) as page,
        Image.open(page.picture(tmp_path / "a.png", (320, 200))) as file,
    ):
        above = np.asarray(file.convert("RGB"), dtype=int)[:85]  # the ground
    drawn = abs(above - above[:, :1]).max(axis=2) > 20  # of the sky at the left
    assert drawn.sum() > 100
    assert not drawn[:20].any() and not drawn[:, :20].any() and not drawn[:, -20:].any()
