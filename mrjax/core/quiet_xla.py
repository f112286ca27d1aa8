"""Keeps from those who start a command what XLA logs whenever it loads a kept program.

On the very machine that compiled them it finds tuning options (`prefer-no-gather`) missing among
the processor's features, and says so at length, as an error. It listens to an environment variable
only, and only before it is imported. Other programs that import mrjax keep all messages.
"""

import os
import sys
from pathlib import Path

SCRIPTS = ("mrjax", "mrjax-calibrate")
MODULES = ("mrjax", "calibrate")


def _is_command() -> bool:
    """True if this process was started as one of the two commands."""
    program = sys.argv[0] if sys.argv else ""
    if program == "-m":  # until Python knows the module's path
        return sys.orig_argv[-len(sys.argv)].removeprefix("-m") in MODULES
    return Path(program).stem in SCRIPTS


if _is_command():
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # fatal errors alone
