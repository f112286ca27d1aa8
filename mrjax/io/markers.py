"""Small files of JSON by which mrjax knows what it made: read only as what they should be."""

import stat
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

MOST_BYTES = 2**26

M = TypeVar("M", bound=BaseModel)


class Strict(BaseModel):
    """A table with these keys and no others; numbers are finite, and of the kind that is said."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, extra="forbid")


class ForeignError(Exception):
    """A file that mrjax did not write so; the message says why."""


def read(path: Path, model: type[M]) -> M | None:
    """Reads a file as a model; None where nothing has its name.

    Raises:
      ForeignError: it is no file, or does not say that.
      OSError: it cannot be read.
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
    return parsed(text, model)


def parsed(text: str | bytes, model: type[M]) -> M:
    """Parses JSON as a model.

    Raises:
      ForeignError: it is something else.
    """
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = "".join(f"{key}: "[:60] for key in first["loc"])
        raise ForeignError(f"{place}{first['msg'][:100]}") from None
