# SPDX-License-Identifier: Apache-2.0
"""Messages that are corrupted at random."""

import struct

import numpy as np

_LENGTHS = (0, 1, 3, 4, 2**16, 2**24 + 1, 2**31 - 1, 2**31, 2**32 - 8, 2**32 - 1)


def bent(rng: np.random.Generator, raw: bytes) -> bytes:
    """A message with damaged bytes, hostile lengths, pieces too few or too many, or all of it."""
    made = bytearray(raw)
    for way in rng.integers(5, size=rng.integers(1, 4)):
        at = int(rng.integers(len(made) + 1)) if made else 0
        if way == 0 and at < len(made):
            made[at] ^= int(rng.integers(1, 256))
        elif way == 1:
            made = made[:at]
        elif way == 2:
            made[at:at] = rng.bytes(int(rng.integers(1, 9)))
        elif way == 3:
            at -= at % 4
            made[at : at + 4] = struct.pack("<I", int(rng.choice(_LENGTHS)))
        else:
            made += made[at:]
    return bytes(made)
