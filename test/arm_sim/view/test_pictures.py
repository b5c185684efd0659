# SPDX-License-Identifier: Apache-2.0
"""Films from pictures."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from arm_sim.exceptions import ViewError
from arm_sim.view import pictures

FRAMES = [np.full((31, 33, 3), shade, dtype=np.uint8) for shade in (0, 80, 160, 240)]


def test_without_ffmpeg_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ViewError, match=r"\.mp4 needs ffmpeg .*apt install ffmpeg\); \.gif does"):
        pictures.refuse_film(tmp_path / "film.mp4")
    pictures.refuse_film(tmp_path / "film.gif")
    with pytest.raises(ViewError, match=r"unknown film format; allowed: \.gif, \.mp4"):
        pictures.refuse_film(tmp_path / "film.avi")


def test_pictures_of_other_formats_are_refused(tmp_path: Path) -> None:
    for name in ("view.png", "view.jpg"):
        pictures.refuse_picture(tmp_path / name)
    with pytest.raises(ViewError, match=r"view\.pdf': unknown format .* allowed: \.png, \.jpg"):
        pictures.refuse_picture(tmp_path / "view.pdf")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
def test_a_film_holds_its_pictures(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    pictures.write_film(film, iter(FRAMES), 25.0)
    read = ["ffmpeg", "-v", "error", "-i", film, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    shown = np.frombuffer(subprocess.run(read, capture_output=True, check=True).stdout, np.uint8)
    shades = shown.reshape(len(FRAMES), 30 * 32).mean(axis=1)  # to even sizes
    np.testing.assert_allclose(shades, [frame.mean() for frame in FRAMES], atol=4.0)
    with pytest.raises(ViewError, match="ffmpeg failed"):
        pictures.write_film(tmp_path / "none" / "film.mp4", iter(FRAMES), 25.0)
