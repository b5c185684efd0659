# SPDX-License-Identifier: Apache-2.0
"""Formats of pictures and films, and films of pictures."""

import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim.exceptions import ViewError


def check_format(path: Path, allowed: Sequence[str]) -> None:
    """Raise a ViewError for a file that cannot be written, before anything is drawn."""
    if path.suffix not in allowed:
        raise ViewError(f"'{path}': unknown format; allowed: {', '.join(allowed)}")
    if path.suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ViewError(
            f"'{path}': .mp4 needs ffmpeg (Debian, Ubuntu: sudo apt install ffmpeg); .gif does not"
        )


def write_film(path: Path, pictures: Iterable[Any], rate: float) -> None:
    """Write pictures, of shape (height, width, 3), as a film (.gif or .mp4), or a ViewError."""
    from PIL import Image

    frames = list(pictures)
    if path.suffix == ".mp4":
        height, width = frames[0].shape[:2]
        command = [
            "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p",
            "-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", str(path),
        ]  # fmt: skip
        raw = b"".join(frame.tobytes() for frame in frames)
        ffmpeg = subprocess.run(command, input=raw, capture_output=True, check=False)
        if ffmpeg.returncode:
            message = ffmpeg.stderr.decode(errors="replace").strip()
            raise ViewError(f"'{path}': ffmpeg failed: {message}")
        return
    # One palette, so that static parts are stored once and do not flicker; an octree keeps the
    # colours of few points, such as those of curves.
    sample = np.vstack([frames[k] for k in (0, len(frames) // 2, -1)])
    octree = Image.Quantize.FASTOCTREE
    palette = Image.fromarray(sample).quantize(128, method=octree, dither=Image.Dither.NONE)
    first, *rest = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    first.save(
        path, save_all=True, append_images=rest, duration=max(20, round(1000 / rate)), loop=0,
        optimize=True,
    )  # fmt: skip
