# SPDX-License-Identifier: Apache-2.0
"""A page that shows arms: its address, its thread, pictures and films."""

from __future__ import annotations

import html
import logging
import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import ArmError
from arm_dynamics.writing import warn_if_replaced
from arm_sim.exceptions import ViewError
from arm_sim.view import films, pictures
from arm_sim.view.drawn_arm import DrawnArm, Row, around, legend
from arm_sim.view.framing import fitted
from arm_sim.view.server import address, close_server

if TYPE_CHECKING:
    import viser

SIZE = 960, 600  # of pictures, in pixels
RATE = 25.0  # [Hz] frame rate of a film
MOST_PICTURES = 3000  # pictures of a page or film; of long motions they are farther apart
UPDATES = 60.0  # [Hz] at which pictures change at most
ENDLESS_ERROR = "a simulation has no end; films and times require a recording"

_log = logging.getLogger(__name__)


@sealed
class View(AbstractContextManager["View"]):
    """A page that shows arms until it is closed.

    Its own thread draws, and runs the requests of visitors, which wait while pictures are written.

    Args:
        server: The page.
        actors: The arms.
    """

    _begin = _end = np.nan  # [s] of a motion
    _own_marks: Sequence[Row] = ()  # in the legend, besides those of the arms

    def __init__(self, server: viser.ViserServer, actors: Sequence[DrawnArm]) -> None:
        self._server, self.actors = server, tuple(actors)
        self._orders = queue.SimpleQueue[Callable[[], object]]()
        self._ended, self._drawing = threading.Event(), threading.RLock()
        self._thread = threading.Thread(target=self._run, name="arm view", daemon=True)

    @property
    def url(self) -> str:
        """URL of the page."""
        return address(self._server)

    def draw(self) -> None:
        """Draw the current state of simulations, in a loop of your own."""

    def wait(self) -> None:
        """Show until it is closed from elsewhere, or Ctrl-C."""
        self._ended.wait()

    def close(self) -> None:
        """End the page."""
        self._ended.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)
        close_server(self._server)

    def __exit__(self, *_: object) -> None:
        """End the page."""
        self.close()

    def __repr__(self) -> str:
        """Where it is."""
        return f"<View of {', '.join(actor.name for actor in self.actors)} at {self.url}>"

    def _repr_html_(self) -> str:
        """The page inside a notebook."""
        return (
            f'<iframe src="{html.escape(self.url)}" width="100%" height="{SIZE[1]}" '
            'style="border:1px solid #ddd"></iframe>'
        )

    # --- pictures ------------------------------------------------------------------------------

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
        films.check_format(path, (".png", ".jpg"))
        with self._drawing:
            if time is not None:
                self._seek(time)
            with self._camera(size) as shoot:
                Image.fromarray(shoot()).save(path)
        return path

    def film(
        self, path: str | Path, size: tuple[int, int] = SIZE, rate: float = RATE,
        speed: float = 1.0, progress: Callable[[str], None] = lambda text: None,
    ) -> Path:  # fmt: skip
        """Write a motion as a film (.gif, or .mp4 where ffmpeg is installed).

        Args:
            path: Path of the file.
            size: Width and height in pixels.
            rate: Frames per second; fewer of motions of more than 3000, and at most 50 of a GIF.
            speed: Playback speed: 2 for twice as fast.
            progress: Called with a description of each step.

        Raises:
            ViewError: If it is not a motion, a number is not positive, there is no browser, or
                writing fails.
        """
        path = self._writable(path)
        films.check_format(path, (".gif", ".mp4"))
        times, pause = self._times(rate, speed, path.suffix == ".gif")
        with self._drawing, self._camera(size) as shoot:

            def frames() -> Iterator[np.ndarray]:
                for i, now in enumerate(times, 1):
                    progress(f"picture {i} of {len(times)}")
                    self._seek(now)
                    yield shoot()
                progress("writing the file")

            films.write_film(path, frames(), 1.0 / pause)
        return path

    def page(self, path: str | Path, rate: float = RATE, speed: float = 1.0) -> Path:
        """Write a standalone page that plays without a server, beside the figure of its motion.

        Arguments are those of ``film``.

        Raises:
            ViewError: If a number is not positive, or the file cannot be written.
        """
        path = self._writable(path)
        times, pause = self._times(rate, speed) if np.isfinite(self._end) else ([], 0.0)
        with self._drawing:
            for now in times[:1]:
                self._seek(now)
            recorder = self._server.get_scene_serializer()
            for now in times:
                self._seek(now)
                recorder.insert_sleep(pause)
        path.write_text(self._with_figures(recorder.as_html()), encoding="utf-8")
        return path

    def _camera(self, size: tuple[int, int]) -> AbstractContextManager[Callable[[], np.ndarray]]:
        points, nearest, from_arms = around(self.actors)
        pose = fitted(points, nearest, size[0] / size[1], from_arms)
        return pictures.camera(self._server, size, *pose)

    def _with_figures(self, page: str) -> str:
        return page

    def _writable(self, path: str | Path) -> Path:
        if self._ended.is_set():
            raise ViewError("the page is closed; write pictures and films before close()")
        path = Path(path)
        if not path.parent.is_dir():
            raise ViewError(f"'{path}': there is no folder '{path.parent}'")
        warn_if_replaced(path)
        return path

    def _times(self, rate: float, speed: float, gif: bool = False) -> tuple[list[float], float]:
        """Times of the pictures, and for how long each of them is shown in [s]."""
        if not np.isfinite(self._end):
            raise ViewError(ENDLESS_ERROR)
        if not (0.0 < rate < np.inf and 0.0 < speed < np.inf):
            raise ViewError(f"rate = {rate:g}, speed = {speed:g}; more than 0 is expected")
        length = (self._end - self._begin) / speed
        pause = max(1.0 / rate, length / (MOST_PICTURES - 1))
        if gif:  # counts hundredths of a second, and browsers show no picture for less than two
            pause = max(2.0, np.ceil(100.0 * pause - 1e-6)) / 100.0
        count = max(2, round(length / pause) + 1)
        return np.linspace(self._begin, self._end, count).tolist(), pause

    def _seek(self, time: float) -> None:
        """Stop playing, and draw a time of the motion immediately."""
        raise ViewError(ENDLESS_ERROR)

    # --- for pages of simulations, recordings or robots ---------------------------------------

    def start(self) -> None:
        """Add what all pages have to the controls of this one, and begin."""
        gui, rows = self._server.gui, [row for actor in self.actors for row in actor.legend()]
        with gui.add_folder("Legend"):
            gui.add_html(legend(dict.fromkeys([*rows, *self._own_marks])))
        with gui.add_folder("Show", expand_by_default=False):
            for kind in ("links", "axes", "path", "springs", "contact forces", "friction cones",
                         "constraint forces"):  # fmt: skip
                box = gui.add_checkbox(kind, kind != "axes")
                for actor in self.actors:
                    self._on_change(box, partial(actor.show, kind))
        self._thread.start()

    def _order(self, action: Callable[[], object]) -> None:
        """Run a function in the page's thread; for any thread."""
        self._orders.put(action)

    def _on_change(self, control: Any, action: Callable[[Any], object]) -> None:
        """Order an action when a visitor changes the value of a control, which is its argument."""

        def changed(event: Any) -> None:
            if event.client is not None:  # and not when the program does
                self._order(lambda: action(event.target.value))

        control.on_update(changed)

    def _update(self, passed: float) -> None:
        """Draw, in the page's thread; ``passed`` is the time in [s] since the last call."""

    def _report(self, trouble: str) -> None:
        """Show why a request was refused."""

    def _run(self) -> None:
        """Update the page and execute orders until it is closed."""
        last = time.monotonic()
        while not self._ended.is_set():
            now = time.monotonic()
            passed, last = now - last, now
            self._order(partial(self._update, passed))
            with self._drawing:
                while not self._orders.empty():
                    self._try(self._orders.get())
            self._ended.wait(max(0.0, now + 1.0 / UPDATES - time.monotonic()))

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except ArmError as error:
            self._report(str(error))
        except Exception as error:  # otherwise the page would stop without a message
            _log.exception("the view met a failure")
            self._report(f"{type(error).__name__}: {error}")
