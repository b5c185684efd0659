# SPDX-License-Identifier: Apache-2.0
"""Pictures of a page without a screen, drawn by a headless browser."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.exceptions import ViewError
from arm_sim.view.charts import WIDTH
from arm_sim.view.server import CONTROLS, address

if TYPE_CHECKING:
    import viser

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
INSTALL_ONE = (
    "install one (Debian: sudo apt install chromium; Ubuntu: sudo snap install chromium), or name "
    "one in ARM_BROWSER"
)
DRAWING = (  # also without a graphics card
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--hide-scrollbars", "--disable-dev-shm-usage",
)  # fmt: skip
PATIENCE = 60.0  # [s] for the page, and for each picture
MARGIN = 8  # pixels between a panel and the drawing
PERIOD, REPEATS = (0.5, 3)  # [s] between pictures, and how many in a row are equal


def browser() -> str:
    """The command of a browser, or a ViewError."""
    named = os.environ.get("ARM_BROWSER")
    if named and not shutil.which(named):
        raise ViewError(f"ARM_BROWSER = {named!r} is not a program; a Chromium is expected")
    program = named or next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise ViewError(f"no browser for pictures: none of {', '.join(BROWSERS)}; {INSTALL_ONE}")
    return program


@contextlib.contextmanager
def page_in_browser(url: str, size: tuple[int, int]) -> Iterator[Any]:
    """A page of a size in pixels in a headless browser, by playwright, or a ViewError."""
    program = browser()
    from playwright.sync_api import Error, sync_playwright

    arguments = [*DRAWING, *(["--no-sandbox"] if os.geteuid() == 0 else [])]  # it refuses root
    width, height = size
    with sync_playwright() as playwright:
        try:
            chromium = playwright.chromium.launch(executable_path=program, args=arguments)
            page = chromium.new_page(viewport={"width": width, "height": height})
            page.goto(url)
        except Error as error:
            reason = error.message.splitlines()[0]
            raise ViewError(f"{program} does not show {url}: {reason}") from None
        try:
            yield page
        finally:
            chromium.close()


@contextlib.contextmanager
def camera(
    server: viser.ViserServer, size: tuple[int, int], position: Array, look_at: Array
) -> Iterator[Any]:
    """A function without arguments that takes a picture of what a server's page shows.

    It returns an array of bytes, shape (height, width, 3).
    """
    clients_before, (width, height) = set(server.get_clients()), size
    beside = WIDTH + CONTROLS + 2 * MARGIN
    place, aim = (",".join(map(str, x.tolist())) for x in (position, look_at))
    url = f"{address(server)}/?initialCameraPosition={place}&initialCameraLookAt={aim}"
    with page_in_browser(url, (width + beside, height)) as page:
        for _ in range(round(PATIENCE / 0.1)):
            if new_clients := set(server.get_clients()) - clients_before:
                break
            page.wait_for_timeout(100)
        else:
            raise ViewError(f"the page did not open within {PATIENCE:g} s")
        client = server.get_clients()[new_clients.pop()]

        def shoot() -> Any:
            try:
                return client.get_render(height, width, timeout=PATIENCE)[..., :3]
            except (TimeoutError, RuntimeError) as error:
                raise ViewError(f"the browser returned no picture: {error}") from None

        # Until it has loaded and drawn meshes and light; what never settles is taken as it is.
        last, equal = shoot(), 0
        for _ in range(round(PATIENCE / PERIOD)):
            if equal == REPEATS:
                break
            page.wait_for_timeout(1000 * PERIOD)
            picture = shoot()
            equal, last = equal + 1 if np.array_equal(picture, last) else 0, picture
        yield shoot
