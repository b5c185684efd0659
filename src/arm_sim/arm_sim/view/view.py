# SPDX-License-Identifier: Apache-2.0
"""A page that shows arms: its address, pictures and films."""

from __future__ import annotations

import html
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.attributes import sealed
from arm_dynamics.dynamics.built import arm_model
from arm_dynamics.exceptions import ModelError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene import Joint
from arm_dynamics.scene.load import SceneSource
from arm_dynamics.writing import warn_if_replaced
from arm_sim.exceptions import ViewError
from arm_sim.recording import Recording
from arm_sim.recording.files import SUFFIXES
from arm_sim.simulation.simulator import Simulator
from arm_sim.view import pictures
from arm_sim.view.access import titled
from arm_sim.view.charts import with_curves
from arm_sim.view.draw_loop import DrawLoop
from arm_sim.view.film import Film, film_of
from arm_sim.view.follower import Follower, NewsSource
from arm_sim.view.interactive import Interactive, InteractiveArm
from arm_sim.view.player import Player
from arm_sim.view.server import HERE, address, close_server, library, open_server
from arm_sim.view.stage import MOUSE, DrawnArm, lay_ground, legend

if TYPE_CHECKING:
    import viser

    Begin = Callable[[viser.ViserServer, list[DrawnArm]], Player | Interactive | Follower]

_log = logging.getLogger(__name__)
SIZE = 960, 600
RATE = 25.0  # [Hz] frame rate of a film
MOST = 3000  # pictures of a page or film
ROTOR = 1.0  # [kg m²] or [kg] at each joint of an arm that is shown though it moves no mass
GAP = 0.6  # distance between adjacent arms, relative to the reach of the larger


@sealed
class View:
    """A page that shows arms until it is closed.

    Args:
        server: The page.
        actors: The arms.
        source: Source of motion: a player of films, a bench with simulations, or running arms.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        actors: Sequence[DrawnArm],
        source: Player | Interactive | Follower,
    ) -> None:
        self._server, self.actors, self.source = server, tuple(actors), source
        self._closed = False
        rows = dict.fromkeys(row for actor in actors for row in actor.legend())
        pull = [("➔", MOUSE, "pull of the mouse")] if isinstance(source, Interactive) else []
        with server.gui.add_folder("Legend"):
            server.gui.add_html(legend([*rows, *pull]))
        with server.gui.add_folder("Show", expand_by_default=False):
            for what, on in (
                ("links", True), ("axes", False), ("path", True), ("springs", True),
                ("contact forces", True), ("friction cones", True), ("constraint forces", True),
            ):  # fmt: skip
                self._add_switch(what, on)
        self._loop.start()

    @property
    def name(self) -> str:
        """Names of the arms."""
        return ", ".join(actor.name for actor in self.actors)

    @property
    def url(self) -> str:
        """URL of the page."""
        return address(self._server)

    @property
    def _loop(self) -> DrawLoop:
        return self.source.loop

    def draw(self) -> None:
        """Draw the current state of simulations, in a loop of your own."""
        if isinstance(self.source, Interactive):
            self.source.draw()

    def wait(self) -> None:
        """Show until it is closed from elsewhere, or Ctrl-C."""
        self._loop.wait()

    def close(self) -> None:
        """End the page, and what it pushes with."""
        self._closed = True
        self._loop.stop()
        if isinstance(self.source, Interactive):
            for rig in self.source.rigs:
                rig.let_go()
        close_server(self._server)

    def __enter__(self) -> View:
        """Show within a ``with`` block."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the page."""
        self.close()

    def __repr__(self) -> str:
        """Where it is."""
        return f"<View of {self.name} at {self.url}>"

    def _repr_html_(self) -> str:
        """The page inside a notebook."""
        return (
            f'<iframe src="{html.escape(self.url)}" width="100%" height="{SIZE[1]}" '
            'style="border:1px solid #ddd"></iframe>'
        )

    # --- pictures ------------------------------------------------------------------------------

    def _writable(self, path: str | Path) -> Path:
        if self._closed:
            raise ViewError("the page is closed; write pictures and films before close()")
        return _writable(path)

    def picture(
        self, path: str | Path, size: tuple[int, int] = SIZE, time: float | None = None
    ) -> Path:
        """Write the view as a picture (.png, .jpg), drawn by a headless browser.

        Args:
            path: Path of the file.
            size: Width and height in pixels.
            time: For motions: the time in [s]; None for the one that is shown.

        Raises:
            ViewError: If the format is unknown, or there is no browser, or it fails.
        """
        from PIL import Image

        path = self._writable(path)
        pictures.refuse_picture(path)
        if time is not None:
            self._seek(time)
        with pictures.camera(self._server, size) as shoot:
            Image.fromarray(shoot()).save(path)
        return path

    def film(
        self,
        path: str | Path,
        size: tuple[int, int] = SIZE,
        rate: float = RATE,
        speed: float = 1.0,
        progress: Callable[[str], None] = lambda text: None,
    ) -> Path:
        """Write a motion as a film (.gif, or .mp4 where ffmpeg is installed).

        Args:
            path: Path of the file.
            size: Width and height in pixels.
            rate: Frames per second.
            speed: Playback speed: 2 for twice as fast.
            progress: Called with what is done next.

        Raises:
            ViewError: If it is not a motion, there is no browser, or writing fails.
        """
        path, times = self._writable(path), self._times(rate / speed)
        pictures.refuse_film(path)
        with pictures.camera(self._server, size) as shoot:

            def taken() -> Iterator[np.ndarray]:
                for i, time in enumerate(times, 1):
                    progress(f"picture {i} of {len(times)}")
                    self._seek(time)
                    yield shoot()
                progress("writing the file")

            pictures.write_film(path, taken(), rate)
        return path

    def page(self, path: str | Path, rate: float = RATE, speed: float = 1.0) -> Path:
        """Write a standalone page that plays without a server; arguments as those of ``film``.

        It has the plots of a motion.

        Raises:
            ViewError: If the file cannot be written.
        """
        path = self._writable(path)
        player = self.source if isinstance(self.source, Player) else None
        times = self._times(rate / speed) if player else []
        if player:
            self._seek(times[0])
        recorder = self._server.get_scene_serializer()
        for time in times:
            self._seek(time)
            recorder.insert_sleep(1.0 / rate)
        page = recorder.as_html()
        if player:
            page = with_curves(page, player.charts, times, rate)
        path.write_bytes(titled(page.encode(), self.name))
        return path

    def _times(self, rate: float) -> list[float]:
        if not isinstance(self.source, Player):
            raise ViewError("a simulation has no end; films and times require a recording")
        if not rate > 0.0:
            raise ViewError(f"{rate:g} pictures per second of the motion; more than 0 is expected")
        begin, end = self.source.begin, self.source.end
        count = min(MOST, max(2, round((end - begin) * rate) + 1))
        return [float(t) for t in np.linspace(begin, end, count)]

    def _seek(self, time: float) -> None:
        """Draw a time of the motion immediately: the loop draws only when it plays."""
        if not isinstance(self.source, Player):
            raise ViewError("a simulation has no end; films and times require a recording")
        self.source.play(False)
        self.source.seek(time)

    def _add_switch(self, what: str, on: bool) -> None:
        box = self._server.gui.add_checkbox(what, on)

        def switch() -> None:
            for actor in self.actors:
                if what == "links":
                    actor.show_links(box.value)
                elif what == "axes":
                    actor.show_axes(box.value)
                else:
                    actor.show(what, box.value)

        box.on_update(lambda _: self._loop.order(switch))


def show(
    *what: Any, name: str | Sequence[str] | None = None, host: str = HERE,
    port: int | None = None, folder: Path | None = None, together: bool = False,
) -> View:  # fmt: skip
    """Show arms in a browser, side by side.

    Simulators and scenes can be run, stepped, placed, pushed and pulled. The page runs them in a
    thread of its own; in a loop of your own, do not use its buttons, and call ``draw()`` of the
    page. Recordings play, at any time and speed, with their forces.

    Args:
        *what: Simulators or scenes (anything that ``load_scene`` accepts), or recordings or films.
            A recording may also be given as its file.
        name: Name of the arms on the page, or of each; None for that of the robot. Films have
            theirs.
        host: Address that the page listens on.
        port: Port; None for 8080 or the next free one.
        folder: Folder of meshes with relative names.
        together: Recordings lie on top of one another, for comparison.

    Returns:
        The page, which a notebook displays; ``close()`` ends it.

    Raises:
        ViewError: If motions and simulations are mixed, a simulator is given twice, the
            visualization library is missing, or the address cannot be used.
        InvalidInput: If a recording has no scene.
        SceneError: If a scene cannot be used.
    """
    what = tuple(Recording.load(x) if _is_recording(x) else x for x in what)
    each = [name] * len(what) if name is None or isinstance(name, str) else [*name]
    moving = [isinstance(thing, Recording | Film) for thing in what]
    if not what or len(each) != len(what) or len(set(moving)) > 1 or (together and not moving[0]):
        raise ViewError(
            f"{len(what)} things to show with {len(each)} names, {sum(moving)} of them motions; "
            "allowed: simulators and scenes, or recordings and films, which alone can lie together"
        )
    simulators = [thing for thing in what if isinstance(thing, Simulator)]
    if len(set(map(id, simulators))) < len(simulators):
        raise ViewError("a simulator is given twice; allowed: one of its own for each arm")
    library()  # before anything is computed
    if moving[0]:
        films = [
            thing if isinstance(thing, Film) else film_of(thing, label)
            for thing, label in zip(what, each, strict=True)
        ]
        names, models = [film.name for film in films], [film.model for film in films]
        begin: Begin = lambda server, actors: Player(server, films, actors)  # noqa: E731
    else:
        arms = [InteractiveArm(x if isinstance(x, Simulator) else simulator_of(x)) for x in what]
        models = [arm.simulation.model for arm in arms]
        names = [label or model.pin.name for label, model in zip(each, models, strict=True)]
        begin = lambda server, actors: Interactive(server, arms, actors)  # noqa: E731
    return _opened(begin, names, models, host, port, folder, together)


def _is_recording(thing: Any) -> bool:
    """Whether it is the file of a recording."""
    return isinstance(thing, str | os.PathLike) and Path(thing).suffix.lower() in SUFFIXES


def simulator_of(scene: SceneSource) -> Simulator:
    """A simulator to be shown; of an arm with a joint that moves no mass, one with rotors.

    Raises:
        SceneError: If the scene cannot be used.
    """
    model = arm_model(scene)
    try:
        return Simulator(model)
    except ModelError as error:
        joints = model.scene.joints
        rotors = joints.get("*", Joint()).model_copy(update={"armature": ROTOR})
        shown = model.scene.model_copy(update={"joints": {**joints, "*": rotors}})
        simulator = Simulator(shown)
        _log.warning(
            "%s; shown with an armature of %g at every joint, so its motion means nothing",
            error, ROTOR,
        )  # fmt: skip
        return simulator


def show_followed(
    told: Sequence[NewsSource], names: Sequence[str], models: Sequence[ArmModel], host: str = HERE,
    port: int | None = None,
) -> View:  # fmt: skip
    """Follow running arms side by side; raises as ``show``."""
    return _opened(
        lambda server, actors: Follower(server, told, actors), names, models, host, port
    )


def _opened(
    begin: Begin, names: Sequence[str], models: Sequence[ArmModel], host: str, port: int | None,
    folder: Path | None = None, together: bool = False,
) -> View:  # fmt: skip
    """A page with these arms, and the source of their motion that ``begin`` makes for them."""
    names = _different(names)
    server = open_server(", ".join(names), host, port)
    actors, width = _cast(server, names, models, folder, together)
    source = begin(server, actors)
    lay_ground(server, actors, width)
    return View(server, actors, source)


def _cast(
    server: viser.ViserServer, names: Sequence[str], models: Sequence[ArmModel],
    folder: Path | None, together: bool,
) -> tuple[list[DrawnArm], float]:  # fmt: skip
    """Place arms side by side about the centre, the first at the left; and their width in [m]."""
    sizes = np.array([model.reach for model in models])
    gaps = np.zeros(len(sizes) - 1) if together else GAP * (sizes[:-1] + sizes[1:])
    places = np.concatenate([[0.0], np.cumsum(gaps)])
    places -= places[-1] / 2
    actors = [
        DrawnArm(server, model, name, (0.0, -place, 0.0), folder)
        for name, model, place in zip(names, models, places.tolist(), strict=True)
    ]
    return actors, float(np.ptp(places))


def _different(names: Sequence[str]) -> list[str]:
    """The same names, numbered where two are equal."""
    return [
        name if list(names).count(name) == 1 else f"{name} {1 + list(names[:i]).count(name)}"
        for i, name in enumerate(names)
    ]


def _writable(path: str | Path) -> Path:
    path = Path(path)
    if not path.parent.is_dir():
        raise ViewError(f"'{path}': there is no folder '{path.parent}'")
    warn_if_replaced(path)
    return path
