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
from arm_sim.view.view import GAP

pytestmark = pytest.mark.group("view")


def test_motions_of_one_name_are_told_apart() -> None:
    model = models.dynamics("two_link").model
    films = [Film(name, model, np.arange(3.0), np.zeros((3, 2))) for name in ("a", "b", "a")]
    with show(*films, port=0) as view:
        assert [actor.name for actor in view.actors] == ["a 1", "b", "a 2"]


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


def test_a_simulation_has_no_film(tmp_path: Path) -> None:
    with show(models.simulator("two_link"), port=0) as view:
        for call in (lambda: view.film(tmp_path / "a.gif"), lambda: view._seek(1.0)):
            with pytest.raises(ViewError, match="a simulation has no end"):
                call()
        before = view.source
        view.draw()
        assert view.source is before and repr(view) == f"<View of two_link at {view.url}>"
        assert f'src="{view.url}"' in view._repr_html_()


def test_motions_lie_side_by_side_or_together() -> None:
    model = models.dynamics("two_link").model
    films = [Film(name, model, np.arange(3.0), np.zeros((3, 2))) for name in "abc"]
    apart = 2 * GAP * model.reach
    with show(*films, port=0) as view:
        places = [actor.base.tolist() for actor in view.actors]
        np.testing.assert_allclose(places, [[0, apart, 0], [0, 0, 0], [0, -apart, 0]], atol=1e-12)
    with show(*films, port=0, together=True) as view:
        assert not np.any([actor.base for actor in view.actors])


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


def test_switches_hide_what_they_name(playing: View) -> None:
    (actor,) = playing.actors
    switches = {
        handle.label: handle
        for handle in playing._server.gui._gui_input_handle_from_uuid.values()
        if isinstance(handle.value, bool)
    }
    whole = actor._lines["whole path"]
    assert whole.visible and all(link.visible for _, link in actor.links)
    for name, seen in (
        ("path", lambda: whole.visible),
        ("links", lambda: actor.links[0][1].visible),
        ("axes", lambda: actor._joints[0].show_axes),
    ):
        box, before = switches[name], seen()
        box.value = not before
        playing.source.loop._serve()
        assert seen() == box.value != before


class TestPlaying:
    """Time of a player passes as its controls say."""

    @pytest.fixture
    def player(self, server: Any) -> Player:
        from arm_sim.view.stage import DrawnArm

        model = models.dynamics("two_link").model
        film = Film("arm", model, np.linspace(1.0, 3.0, 21), np.zeros((21, 2)))
        return Player(server, [film], [DrawnArm(server, model, "arm")])

    def test_it_stands_until_it_is_started(self, player: Player) -> None:
        assert (player.begin, player.end, player.time) == (1.0, 3.0, 1.0)
        assert player._status.content == "t = 1.000 s of 3.000 s"
        player._beat(0.5)
        assert player.time == 1.0 and player._button.label == "Play"
        player._toggle()
        player._beat(0.5)
        assert player.time == 1.5 == player._slider.value and player._button.label == "Pause"
        player._toggle()
        player._beat(0.5)
        assert player.time == 1.5

    def test_it_is_repeated_or_ends(self, player: Player) -> None:
        player._speed.value = "2"
        player.play()
        player._beat(0.75)
        assert player.time == 2.5
        player._beat(0.75)
        assert player.time == 1.0 and player._playing  # again
        player._loop.value = False
        player._beat(5.0)
        assert player.time == 3.0 and not player._playing
        player.play()
        assert player.time == 1.0  # it begins anew
        player.seek(-1.0)
        assert player.time == 1.0
        player._show_status("no luck")
        assert player._status.content == "t = 1.000 s of 3.000 s\n\n**no luck**"
