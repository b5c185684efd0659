# SPDX-License-Identifier: Apache-2.0
"""A page of the view in a real browser: what it drew, read back from the scene that it renders."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_sim.exceptions import ViewError
from arm_sim.view.pictures import browser, page_in_browser

PATIENCE = 60.0  # [s] on a machine that others use, without a graphics card
# What the libraries say of themselves.
NOISE = ("deprecated", "GPU stall", "WebGL", "passive event listener")

# The nodes of the scene that three.js renders, by name: they hang in the page's React tree.
_FIND = """() => {
  const root = document.getElementById('root');
  const key = Object.keys(root).find(k => k.startsWith('__reactContainer'));
  const left = [root[key]];
  while (left.length) {
    const fiber = left.pop();
    const viewer = fiber?.memoizedProps?.value?.mutable?.current;
    if (viewer?.nodeRefFromName) {
      window.viewer = viewer;
      window.drawn = viewer.nodeRefFromName;
      return true;
    }
    if (fiber?.sibling) left.push(fiber.sibling);
    if (fiber?.child) left.push(fiber.child);
  }
  return false;
}"""
_PLACES = """names => names.map(name => {
  const node = window.drawn[name];
  if (!node) return null;
  node.updateWorldMatrix(true, false);
  return Array.from(node.matrixWorld.elements);
})"""

# Ten pictures a second: without a graphics card, sixty take all processors while a page is open.
_SLOWLY = """
  window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 100);
  window.cancelAnimationFrame = clearTimeout;
"""


def needed() -> None:
    """Skip the test where there is no browser."""
    try:
        browser()
    except ViewError as error:
        pytest.skip(str(error))


class Page:
    """A page in a browser."""

    def __init__(self, handle: Any) -> None:
        self.handle, self.troubles = handle, list[str]()
        handle.on("console", self._hear)
        handle.on("pageerror", lambda error: self.troubles.append(str(error)))

    def _hear(self, message: Any) -> None:
        if message.type in ("error", "warning") and not any(x in message.text for x in NOISE):
            self.troubles.append(f"{message.type}: {message.text}")

    def click(self, name: str) -> None:
        """Press a button, wherever it is; a slow machine is not waited for to stop drawing."""
        self.handle.get_by_role("button", name=name, exact=True).dispatch_event("click")

    def choose(self, menu: str, option: str) -> None:
        """Choose from a menu."""
        self.handle.get_by_label(menu).dispatch_event("click")
        self.handle.get_by_role("option", name=option).dispatch_event("click")

    def angles(self, name: str, model: ArmModel) -> Array:
        """Joint angles that are drawn, from places of links that follow each other, (pin.nv,)."""
        tree, angles = model.pin, []
        nodes = [f"/{name}/{joint}" for joint in ("base", *list(tree.names)[1:])]
        elements = np.array(self.handle.evaluate(_PLACES, nodes), dtype=float)  # by columns
        places = elements.reshape(-1, 4, 4).transpose(0, 2, 1)
        for i in range(1, tree.njoints):
            way = np.linalg.solve(places[tree.parents[i]], places[i])
            turn = tree.jointPlacements[i].rotation.T @ way[:3, :3]
            axis = np.array(tree.joints[i].createData().S).ravel()[3:]
            angles.append(float(axis @ pin.log3(turn)))
        return np.array(angles)

    def until(self, holds: Callable[[], object], what: str) -> None:
        """Wait for something."""
        end = time.monotonic() + PATIENCE
        while not holds():
            if time.monotonic() > end:
                raise AssertionError(f"waited {PATIENCE} s for {what}; {self.troubles}")
            self.handle.wait_for_timeout(50)


@contextmanager
def slow_page(url: str, size: tuple[int, int]) -> Iterator[Any]:
    """As ``page_in_browser``, drawn slowly."""
    with page_in_browser("about:blank", size) as handle:
        handle.add_init_script(_SLOWLY)
        handle.goto(url)
        yield handle


@contextmanager
def opened(url: str, *nodes: str, size: tuple[int, int] = (640, 360)) -> Iterator[Page]:
    """A page that is open and shows some nodes; at the end its console has said nothing bad."""
    with slow_page("about:blank", size) as handle:
        page = Page(handle)
        handle.goto(url)
        page.until(lambda: handle.evaluate(_FIND), "a scene")
        page.until(lambda: None not in handle.evaluate(_PLACES, nodes), str(nodes))
        yield page
        assert page.troubles == [], page.troubles
