# SPDX-License-Identifier: Apache-2.0
"""The command line of the suite; heavy imports are deferred until a command needs them."""

import os

# Matrices are small here: threads of the linear algebra would only wait for each other. This must
# be set before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
