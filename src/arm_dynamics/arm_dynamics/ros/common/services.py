# SPDX-License-Identifier: Apache-2.0
"""Answers of services: success, or an error message."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from arm_dynamics.exceptions import ArmError, plain
from arm_dynamics.logs import Throttled


@contextmanager
def answering(response: Any, log: Throttled) -> Iterator[None]:
    """Answer a service with success or with an error message; no request ends the node."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused by finite_answer
            yield
    except ArmError as error:
        response.success, response.message = False, plain(error)
    except Exception as error:
        log.error(f"a service call failed unexpectedly: {plain(repr(error))}")
        response.success, response.message = False, plain(f"unexpected failure: {error!r}")
    else:
        response.success = True
