# SPDX-License-Identifier: Apache-2.0
"""Films from pictures."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import needed
from PIL import Image, ImageSequence

from arm_sim.exceptions import ViewError
from arm_sim.view import films, pictures

FRAMES = [np.full((31, 33, 3), shade, dtype=np.uint8) for shade in (0, 80, 160, 240)]


def test_without_ffmpeg_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", "")
    formats = ".gif", ".mp4"
    with pytest.raises(ViewError, match=r"\.mp4 needs ffmpeg .*apt install ffmpeg\); \.gif does"):
        films.check_format(tmp_path / "film.mp4", formats)
    films.check_format(tmp_path / "film.gif", formats)
    with pytest.raises(ViewError, match=r"unknown format; allowed: \.gif, \.mp4"):
        films.check_format(tmp_path / "film.avi", formats)


@pytest.mark.group("view")
def test_a_page_that_a_browser_cannot_open_is_named() -> None:
    needed()
    with (
        pytest.raises(ViewError, match="does not show http://localhost:9/: "),
        pictures.page_in_browser("http://localhost:9/", (64, 64)),
    ):
        pass


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_a_film_holds_its_pictures(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    films.write_film(film, iter(FRAMES), 25.0)
    read = ["ffmpeg", "-v", "error", "-i", film, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    shown = np.frombuffer(subprocess.run(read, capture_output=True, check=True).stdout, np.uint8)
    shades = shown.reshape(len(FRAMES), 30 * 32).mean(axis=1)  # to even sizes
    np.testing.assert_allclose(shades, [frame.mean() for frame in FRAMES], atol=4.0)
    with pytest.raises(ViewError, match="ffmpeg failed"):
        films.write_film(tmp_path / "none" / "film.mp4", iter(FRAMES), 25.0)


def test_a_gif_holds_its_pictures_and_is_repeated(tmp_path: Path) -> None:
    bars = [np.full((31, 33, 3), (10, 20, 160), dtype=np.uint8) for _ in range(4)]
    for k, bar in enumerate(bars):
        bar[:, 8 * k : 8 * k + 8] = (200, 30, 60)  # where it is
    films.write_film(tmp_path / "film.gif", iter(bars), 8.0)
    with Image.open(tmp_path / "film.gif") as film:
        shown = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
        assert film.info["loop"] == 0 and film.info["duration"] == 120  # [ms], whole hundredths
    np.testing.assert_allclose(np.array(shown, int), np.array(bars, int), atol=12)
