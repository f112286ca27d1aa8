"""Ctrl-C at a command line ends the process, also where Python does not come to answer it.

JAX compiles outside Python, for half a minute at times, and a model of the user's own may run for
longer. A thread sees the signal all the same, leaves the command some time to end by itself, and
then ends the process. What a checkpoint keeps is whole at any moment.
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
