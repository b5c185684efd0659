# SPDX-License-Identifier: Apache-2.0
"""Pictures of a page without a screen, drawn by a headless browser."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_sim.exceptions import ViewError
from arm_sim.view.charts import WIDTH
from arm_sim.view.framing import orientation
from arm_sim.view.server import CONTROLS, address

if TYPE_CHECKING:
    import viser

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
HOW_TO_GET_ONE = (
    "install one (Debian: sudo apt install chromium; Ubuntu: sudo snap install chromium), or name "
    "one in ARM_BROWSER"
)
DRAWING = (  # also without a graphics card
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--hide-scrollbars", "--disable-dev-shm-usage",
)  # fmt: skip
PATIENCE = 60.0  # [s] for the page, and for each picture
MARGIN = 8  # pixels between a panel and the drawing
SETTLED, STILL = (0.5, 3)  # [s] between pictures, and how many must be equal


def browser() -> str:
    """The command of a browser.

    Raises:
        ViewError: If none is found.
    """
    named = os.environ.get("ARM_BROWSER")
    if named and not shutil.which(named):
        raise ViewError(f"ARM_BROWSER = {named!r} is not a program; a Chromium is expected")
    found = named or next((path for path in map(shutil.which, BROWSERS) if path), None)
    if found is None:
        raise ViewError(
            f"no browser for pictures: none of {', '.join(BROWSERS)}; {HOW_TO_GET_ONE}"
        )
    return found


@contextlib.contextmanager
def page_in_browser(url: str, size: tuple[int, int]) -> Iterator[Any]:
    """A page in a headless browser, by playwright.

    Args:
        url: Address to open.
        size: Width and height in pixels.

    Raises:
        ViewError: If there is no browser, or it does not start.
    """
    program = browser()
    from playwright.sync_api import Error, sync_playwright

    arguments = [*DRAWING, *(["--no-sandbox"] if os.geteuid() == 0 else [])]  # it refuses root
    width, height = size
    with sync_playwright() as playwright:
        try:
            opened = playwright.chromium.launch(executable_path=program, args=arguments)
        except Error as error:
            raise ViewError(f"{program} does not start: {error.message.splitlines()[0]}") from None
        try:
            page = opened.new_page(viewport={"width": width, "height": height})
            page.goto(url)
            yield page
        finally:
            opened.close()


@contextlib.contextmanager
def camera(server: viser.ViserServer, size: tuple[int, int]) -> Iterator[Any]:
    """A function without arguments that takes a picture of a server's page.

    It returns an array of bytes, shape (height, width, 3).
    """
    known, (width, height) = set(server.get_clients()), size
    beside = WIDTH + CONTROLS + 2 * MARGIN
    with page_in_browser(address(server), (width + beside, height)) as page:
        for _ in range(round(PATIENCE / 0.1)):
            if arrived := set(server.get_clients()) - known:
                break
            page.wait_for_timeout(100)
        else:
            raise ViewError(f"the page did not open within {PATIENCE:g} s")
        client, pose = server.get_clients()[arrived.pop()], _pose(server)

        def shoot() -> Any:
            try:
                return client.get_render(height, width, timeout=PATIENCE, **pose)[..., :3]
            except (TimeoutError, RuntimeError) as error:
                raise ViewError(f"the browser returned no picture: {error}") from None

        _wait_until_still(page, shoot)
        yield shoot


def _pose(server: viser.ViserServer) -> dict[str, Any]:
    """The page's first camera, whatever its panels cover: pictures have none."""
    first = server.initial_camera
    position, look_at = np.array(first.position), np.array(first.look_at)
    wxyz = orientation(position, look_at)
    return {"wxyz": wxyz, "position": position, "fov": first.fov}


def _wait_until_still(page: Any, shoot: Callable[[], Any]) -> None:
    """Wait until the browser has loaded and drawn meshes and light."""
    last, alike = shoot(), 0
    for _ in range(round(PATIENCE / SETTLED)):
        page.wait_for_timeout(1000 * SETTLED)
        picture = shoot()
        alike = alike + 1 if np.array_equal(picture, last) else 0
        if alike == STILL:
            return
        last = picture


def refuse_picture(path: Path) -> None:
    """Reject a picture of another format before it is drawn.

    Raises:
        ViewError: If the format is another one.
    """
    if path.suffix not in (".png", ".jpg"):
        raise ViewError(f"'{path}': unknown format of pictures; allowed: .png, .jpg")


def refuse_film(path: Path) -> None:
    """Reject a film that ``write_film`` cannot write, before any picture is drawn.

    Raises:
        ViewError: If the format is unknown, or ffmpeg is missing.
    """
    if path.suffix not in (".gif", ".mp4"):
        raise ViewError(f"'{path}': unknown film format; allowed: .gif, .mp4")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ViewError(
            f"'{path}': .mp4 needs ffmpeg (Debian, Ubuntu: sudo apt install ffmpeg); .gif does not"
        )


def write_film(path: Path, pictures: Iterable[Any], rate: float) -> None:
    """Write pictures as a film.

    Args:
        path: Path of the file; .gif or .mp4.
        pictures: Arrays of bytes, shape (height, width, 3).
        rate: Frames per second.

    Raises:
        ViewError: If the format is unknown, or ffmpeg is missing or fails.
    """
    refuse_film(path)
    (_write_gif if path.suffix == ".gif" else _write_mp4)(path, pictures, rate)


def _write_gif(path: Path, pictures: Iterable[Any], rate: float) -> None:
    """Write a GIF with one palette, so that static parts are stored once and do not flicker."""
    from PIL import Image

    frames = [Image.fromarray(picture) for picture in pictures]
    height = frames[0].height
    sample = Image.new("RGB", (frames[0].width, 3 * height))
    for i, k in enumerate((0, len(frames) // 2, -1)):
        sample.paste(frames[k], (0, i * height))
    # An octree keeps the colours of few points, such as those of curves.
    palette = sample.quantize(128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    drawn[0].save(
        path, save_all=True, append_images=drawn[1:], duration=max(20, round(1000 / rate)),
        loop=0, optimize=True,
    )  # fmt: skip


def _write_mp4(path: Path, pictures: Iterable[Any], rate: float) -> None:
    frames = iter(pictures)
    first = next(frames)
    height, width = first.shape[:2]
    command = [
        "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p",
        "-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", str(path),
    ]  # fmt: skip
    coder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    assert coder.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        for frame in (first, *frames):
            coder.stdin.write(frame.tobytes())
    _, said = coder.communicate()
    if coder.returncode:
        raise ViewError(f"'{path}': ffmpeg failed: {said.decode(errors='replace').strip()}")
