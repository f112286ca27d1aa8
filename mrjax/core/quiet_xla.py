"""Silences XLA's log messages in the two commands.

Whenever XLA loads a program from the cache it logs a long error: tuning options such as
`prefer-no-gather` are missing among the processor's features, even on the machine that compiled the
program. An environment variable, set before the import of XLA, is the only way to silence it. Other
programs that import mrjax keep all messages.
"""

import os
import sys
from pathlib import Path

SCRIPTS = ("mrjax", "mrjax-calibrate")
MODULES = ("mrjax", "calibrate")


def _is_command() -> bool:
    """True if this process was started as one of the two commands."""
    program = sys.argv[0] if sys.argv else ""
    if program == "-m":  # Python does not know the module's path yet
        return sys.orig_argv[-len(sys.argv)].removeprefix("-m") in MODULES
    return Path(program).stem in SCRIPTS


if _is_command():
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # fatal errors only
