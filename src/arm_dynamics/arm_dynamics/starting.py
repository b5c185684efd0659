# SPDX-License-Identifier: Apache-2.0
"""What happens to a program that is interrupted while it starts.

Its imports take a second, and what an interruption makes of them is a traceback. Nothing that is
slow to import is imported here.
"""

import os
import signal
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def end_when_interrupted(status: int = 0, words: str = "") -> None:
    """Let SIGINT and SIGTERM end this process at once, until others handle them.

    The words are written to stderr then.

    Signals that ``./arm`` has held back while Python itself started arrive now.
    """

    def end(*_: Any) -> None:
        os.write(2, words.encode())
        os._exit(status)

    for number in SIGNALS:
        signal.signal(number, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
