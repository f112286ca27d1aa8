"""A command that kills itself: `python killed.py HOW NUMBER MODULE ARGUMENTS...`.

HOW is `count`, which prints how many files it wrote, or when SIGKILL comes at the writing of file
NUMBER: `before` it takes its name, with `half` of it written, or right `after`.
"""

import os
import runpy
import signal
import sys
from pathlib import Path

how, number, module, *arguments = sys.argv[1:]
written = 0
replace = os.replace


def replaced(source, target, **options):
    global written
    written += 1
    ours = how != "count" and written == int(number)
    if ours and how == "half":
        os.truncate(source, Path(source).stat().st_size // 2)
    if ours and how != "after":
        os.kill(os.getpid(), signal.SIGKILL)
    replace(source, target, **options)
    if ours:
        os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    os.replace = replaced
    sys.argv = [module, *arguments]
    try:
        runpy.run_module(module, run_name="__main__")
    finally:
        if how == "count":
            print(f"{written} files", flush=True)
