# SPDX-License-Identifier: Apache-2.0
"""What is measured on."""

from __future__ import annotations

import platform
from pathlib import Path


def processor() -> str:
    """Its name, the number of its cores and its widest vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    wide = next((w for w in ("avx512f", "avx2") if any(w in line for line in lines)), "no AVX2")
    return f"{names[0] if names else platform.machine()}, {len(names)} cores, {wide}"
