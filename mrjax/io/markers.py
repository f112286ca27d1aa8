"""Small JSON files by which mrjax recognises its own files; each is validated by a model."""

import stat
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

MOST_BYTES = 2**26

M = TypeVar("M", bound=BaseModel)


class Strict(BaseModel):
    """A model without further keys; numbers are finite and of the declared type."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="forbid")


class ForeignError(Exception):
    """A file that mrjax did not write in this form; the message says why."""


def read(path: Path, model: type[M]) -> M | None:
    """Reads a JSON file as a model; returns None if there is no file.

    Raises:
      ForeignError: the path is no file, or its content does not fit the model.
      OSError: the file cannot be read.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(mode):
        raise ForeignError("it is no file")
    with path.open("rb") as file:
        text = file.read(MOST_BYTES + 1)
    if len(text) > MOST_BYTES:
        raise ForeignError("it is too large")
    return parse(text, model)


def parse(text: str | bytes, model: type[M]) -> M:
    """Parses JSON as a model.

    Raises:
      ForeignError: the text does not fit the model.
    """
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        keys = "".join(f"{key}: "[:60] for key in first["loc"])
        raise ForeignError(f"{keys}{first['msg'][:100]}") from None
