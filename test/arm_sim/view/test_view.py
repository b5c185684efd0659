# SPDX-License-Identifier: Apache-2.0
"""What a page shows, without a browser."""

from __future__ import annotations

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
from arm_sim.view import Film, View, pictures, show
from arm_sim.view.player import Player

pytestmark = pytest.mark.group("view")


@pytest.fixture
def playing(monkeypatch: pytest.MonkeyPatch) -> Iterator[View]:
    """A motion of two seconds; the later it is, the more of a picture of it is white."""
    model = models.dynamics("two_link").model
    film = Film("arm", model, np.linspace(0.0, 2.0, 21), np.linspace(0.0, 1.0, 42).reshape(21, 2))

    @contextmanager
    def camera(server: Any, size: tuple[int, int]) -> Iterator[Any]:
        def shoot() -> np.ndarray:
            source = view.source
            assert isinstance(source, Player)
            picture = np.zeros((size[1], size[0], 3), dtype=np.uint8)
            picture[:, : round(20 * source.time)] = 255
            return picture

        yield shoot

    monkeypatch.setattr(pictures, "camera", camera)
    with show(film, port=0) as view:
        yield view


def look(path: Path) -> tuple[list[float], tuple[int, int], float]:
    """Times of the pictures of a file, their size, and for how long each is shown in [ms]."""
    with Image.open(path) as film:
        frames = ImageSequence.Iterator(film)
        white = [np.asarray(frame.convert("L"))[0] > 128 for frame in frames]
        return [float(line.sum()) / 20 for line in white], film.size, film.info.get("duration", 0)


def test_a_picture_is_of_the_time_that_is_asked_for(playing: View, tmp_path: Path) -> None:
    path = playing.picture(tmp_path / "a.png", (64, 40), time=1.5)
    assert path == tmp_path / "a.png" and look(path) == ([1.5], (64, 40), 0)
    assert look(playing.picture(tmp_path / "b.png"))[:2] == ([1.5], (960, 600))  # as it is shown
    assert look(playing.picture(str(tmp_path / "c.png"), time=9.0))[0] == [2.0]  # its end
    with pytest.raises(ViewError, match="unknown format"):
        playing.picture(tmp_path / "a.pdf")
    with pytest.raises(ViewError, match="there is no folder"):
        playing.picture(tmp_path / "none" / "a.png")
    playing.close()
    with pytest.raises(ViewError, match="the page is closed"):
        playing.picture(tmp_path / "a.png")


def test_a_film_goes_from_the_begin_to_the_end_at_its_speed(playing: View, tmp_path: Path) -> None:
    path = playing.film(tmp_path / "a.gif", (60, 20), rate=2.0)
    assert look(path) == ([0.0, 0.5, 1.0, 1.5, 2.0], (60, 20), 500)
    slow = look(playing.film(tmp_path / "b.gif", (60, 20), rate=2.0, speed=0.5))
    assert (len(slow[0]), slow[2]) == (9, 500)
    assert look(playing.film(tmp_path / "c.gif", (60, 20), rate=2.0, speed=50.0))[0] == [0.0, 2.0]
    with pytest.raises(ViewError, match="0 pictures per second"):
        playing.film(tmp_path / "d.gif", rate=0.0)
    with pytest.raises(ViewError, match="unknown film format"):
        playing.film(tmp_path / "d.avi")


def test_it_plays_pauses_and_begins_again(playing: View) -> None:
    player = playing.source
    assert isinstance(player, Player)
    player.loop.stop()  # the beats below are the only ones
    seen = []
    for change in (
        lambda: player._beat(0.5), player.play, lambda: player._beat(0.5),
        lambda: player._beat(1.6), lambda: setattr(player._loop, "value", False),
        lambda: player._beat(2.5), lambda: player._beat(0.5), player.play,
    ):  # fmt: skip
        change()
        seen.append((player.time, player._playing))
    assert seen == [(0.0, False), (0.0, True), (0.5, True), (0.0, True), (0.0, True),
                    (2.0, False), (2.0, False), (0.0, True)]  # fmt: skip


def test_a_simulation_has_no_film(tmp_path: Path) -> None:
    with show(models.simulator("two_link"), port=0) as view:
        for call in (lambda: view.film(tmp_path / "a.gif"), lambda: view._seek(1.0)):
            with pytest.raises(ViewError, match="a simulation has no end"):
                call()
        before = view.source
        view.draw()
        assert view.source is before and repr(view) == f"<View of two_link at {view.url}>"
        assert f'src="{view.url}"' in view._repr_html_()


def test_what_does_not_go_together_is_refused() -> None:
    model, sim = models.dynamics("two_link").model, models.simulator("two_link")
    film = Film("a", model, np.arange(3.0), np.zeros((3, 2)))
    for what, more in (
        ((), {}), ((film, sim), {}), ((film, film), {"name": ["a"]}), ((sim,), {"together": True}),
    ):  # fmt: skip
        with pytest.raises(ViewError, match="things to show with"):
            show(*what, **more)
    with pytest.raises(ViewError, match="a simulator is given twice"):
        show(sim, Simulator("pendulum"), sim)
