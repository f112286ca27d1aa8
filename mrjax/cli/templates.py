"""Writing of templates, commented files for a user to change."""

import os
from pathlib import Path

from mrjax.core import refusals
from mrjax.core.errors import InputError, shown


def write_new(texts: dict[Path, str]) -> None:
    """Writes new files for a user to change.

    Args:
      texts: content by path.

    Raises:
      InputError: a file exists already, or a path is no file name.
      SystemRefusal: a file cannot be written.
    """
    from mrjax.io import files

    for path in texts:
        if not str(path).isprintable():
            raise InputError(f"{shown(str(path))}: is no file name; give another")
        if os.path.lexists(path):
            raise InputError(f"{path}: is there already; give another name")
    for path, text in texts.items():
        with refusals.writing(path):
            files.create_text(path, text)
