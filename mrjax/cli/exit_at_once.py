"""Ctrl-C at a command line ends the process, even while Python cannot answer it.

JAX compiles outside Python, at times for half a minute, and a user's own model may run for longer.
A thread sees the signal all the same, gives the command some time to end by itself, and then ends
the process. The content of a checkpoint is whole at any moment.
"""

import os
import signal
import threading
import time
from collections.abc import Callable
from typing import NoReturn

GRACE = 1.5
"""Time that a command has to end by itself, s."""


def watch(end: Callable[[], NoReturn]) -> None:
    """Has the process ended some time after Ctrl-C, unless it has done so before.

    Args:
      end: ends the process, from any thread.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def waiting() -> None:
        while signal.SIGINT not in os.read(reading, 1):
            pass
        time.sleep(GRACE)
        end()

    threading.Thread(target=waiting, daemon=True).start()
