# SPDX-License-Identifier: Apache-2.0
"""How well an arm is identified: known truth under noise, and recordings of real robots."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as ``./arm identify`` does; before NumPy
