"""Ctrl-C at a command line ends the process, even while Python cannot handle the signal.

JAX compiles outside Python, sometimes for half a minute, and a user's own model may run for longer.
A thread receives the signal, gives the command some time to end by itself, and then ends the
process. Checkpoints are consistent at any time.
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
    """Starts a thread that ends the process some time after Ctrl-C, if it still runs.

    Args:
      end: function that ends the process, from any thread.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def wait() -> None:
        while signal.SIGINT not in os.read(reading, 1):
            pass
        time.sleep(GRACE)
        end()

    threading.Thread(target=wait, daemon=True).start()
