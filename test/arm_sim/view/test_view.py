# SPDX-License-Identifier: Apache-2.0
"""What a page shows, without a browser."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

import models
from arm_sim import Simulator
from arm_sim.exceptions import ViewError
from arm_sim.view import page, pictures, show
from arm_sim.view.player import Player, instant

pytestmark = pytest.mark.group("view")


@pytest.fixture
def playing(monkeypatch: pytest.MonkeyPatch) -> Iterator[Player]:
    """A motion of two seconds; the later it is, the more of a picture of it is white."""

    @contextmanager
    def camera(server: Any, size: tuple[int, int], *pose: Any) -> Iterator[Any]:
        def shoot() -> np.ndarray:
            picture = np.zeros((size[1], size[0], 3), dtype=np.uint8)
            picture[:, : round(20 * view.time)] = 255
            return picture

        yield shoot

    monkeypatch.setattr(pictures, "camera", camera)
    with show(Simulator("two_link").run(2.0), port=0) as view:
        assert isinstance(view, Player)
        yield view


def look(path: Path) -> tuple[list[float], tuple[int, int], float]:
    """Times of the pictures of a file, their size, and for how long each is shown in [ms]."""
    with Image.open(path) as film:
        frames = ImageSequence.Iterator(film)
        white = [np.asarray(frame.convert("L"))[0] > 128 for frame in frames]
        return [float(line.sum()) / 20 for line in white], film.size, film.info.get("duration", 0)


def test_a_picture_is_of_the_time_that_is_asked_for(playing: Player, tmp_path: Path) -> None:
    path = playing.picture(tmp_path / "a.png", (64, 40), time=1.5)
    assert path == tmp_path / "a.png" and look(path) == ([1.5], (64, 40), 0)
    assert look(playing.picture(tmp_path / "b.png"))[:2] == ([1.5], (960, 600))  # as it is shown
    assert look(playing.picture(str(tmp_path / "c.png"), time=9.0))[0] == [2.0]  # its end
    with pytest.raises(ViewError, match="there is no folder"):
        playing.picture(tmp_path / "none" / "a.png")
    playing.close()
    for write in (playing.picture, playing.film, playing.page):
        with pytest.raises(ViewError, match="the page is closed"):
            write(tmp_path / "a.png")


def test_a_film_goes_from_the_begin_to_the_end_at_its_speed(
    playing: Player, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def film(**how: float) -> tuple[list[float], float]:
        times, size, shown = look(playing.film(tmp_path / "a.gif", (60, 20), **how))
        assert size == (60, 20)
        return times, shown

    assert film(rate=2.0) == ([0.0, 0.5, 1.0, 1.5, 2.0], 500)
    assert film(rate=1.0, speed=0.5) == ([0.0, 0.5, 1.0, 1.5, 2.0], 1000)
    assert film(rate=2.0, speed=50.0)[0] == [0.0, 2.0]
    times, shown = film(rate=100.0, speed=4.0)
    assert (len(times), shown) == (26, 20)  # half a second in what a GIF can show
    monkeypatch.setattr(page, "MOST_PICTURES", 11)
    times, shown = film()
    assert (len(times), shown) == (11, 200)  # of the same length
    for numbers in ({"rate": 0.0}, {"speed": 0.0}):
        with pytest.raises(ViewError, match="more than 0 is expected"):
            film(**numbers)
    with pytest.raises(ViewError, match="unknown format"):
        playing.film(tmp_path / "d.avi")


def test_it_plays_pauses_and_begins_again(playing: Player) -> None:
    playing._ended.set()
    playing._thread.join()  # the beats below are the only ones

    def after(seconds: float) -> tuple[float, bool]:
        playing._update(seconds)
        return playing.time, playing._playing

    assert after(0.5) == (0.0, False)
    playing.play()
    assert [after(0.5), after(1.6)] == [(0.5, True), (0.0, True)]
    playing._loop.value = False
    assert [after(2.5), after(0.5)] == [(2.0, False), (2.0, False)]
    playing.play()
    assert playing.time == 0.0


def test_the_last_state_up_to_a_time_is_shown_with_its_forces() -> None:
    sim = Simulator("table_arm")
    run = sim.run(0.3)
    for time, row in ((-1.0, 0), (0.0, 0), (0.1, 100), (0.1009, 100), (9.0, 300)):
        np.testing.assert_array_equal(instant(run, time).q, run.q[row])
    (point, force, _), contact = instant(run, 0.3).contacts[0], sim.contact_forces()[0]
    np.testing.assert_allclose([point, force], [contact.point, contact.force], rtol=1e-9)


def test_a_recording_brings_its_curves_and_an_account_that_closes() -> None:
    run = Simulator("two_link").run(0.3, [1.0, 0.0])
    with show(run, run, port=0, name=["one", "other"]) as page:
        assert isinstance(page, Player)
        curves = page._panel.charts
    torque, energies = curves["one: torque [N m]"], curves["other: energy [J]"]
    np.testing.assert_array_equal(torque.time, run.time)
    np.testing.assert_array_equal(torque.values, run.tau)
    energy = dict(zip(energies.names, energies.values.T, strict=True))
    np.testing.assert_allclose(energy["total"], energy["kinetic"] + energy["potential"])
    total, flows = energy["total"], energy["supplied"] - energy["lost"] + energy["balance"]
    np.testing.assert_allclose(total - flows, total[0], rtol=1e-12)


def test_what_does_not_go_together_is_refused() -> None:
    sim = models.simulator("two_link")
    run = Simulator("two_link").run(0.01)
    for what, more in (
        ((), {}), ((run, sim), {}), ((run, run), {"name": ["a"]}), ((sim,), {"together": True}),
    ):  # fmt: skip
        with pytest.raises(ViewError, match="things to show with"):
            show(*what, **more)
    with pytest.raises(ViewError, match="a simulator is given twice"):
        show(sim, Simulator("pendulum"), sim)
