"""Reading and validation of TOML sheets; each fault is reported in one line with its remedy."""

import difflib
import math
import os
import tomllib
from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from mrjax.core.errors import LONGEST, InputError, shown, shown_key
from mrjax.core.text import shortened
from mrjax.io import reading
from mrjax.recipe import toml_limits

MOST_BYTES = 10**6
"""Largest size of a sheet in bytes."""
SMALLEST, LARGEST = 1e-30, 1e30
"""Bounds of the magnitude of nonzero numbers, in any unit; others overflow or underflow."""
LONGEST_NAME, LONGEST_PATH = 200, 1000
"""Largest numbers of characters."""

UNSTATED: Any = None
"""Default of a key that is not optional: `Sheet.assume` fills it in if it is not stated."""


class Sheet(BaseModel):
    """A table of a TOML file with known keys and finite numbers; frozen once it is read.

    In Python, None stands for a missing key.

    The description of a field says what to give, and is the remedy in error messages.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _none_is_not_stated(cls, table: Any) -> Any:
        if not isinstance(table, dict):
            return table
        return {
            key: value
            for key, value in table.items()
            if value is not None or key not in cls.model_fields
        }

    @field_validator("*")
    @classmethod
    def _measurable(cls, value: Any) -> Any:
        parts = value.values() if isinstance(value, dict) else value
        for part in parts if isinstance(value, dict | list) else [value]:
            if isinstance(part, float) and part and not SMALLEST <= abs(part) <= LARGEST:
                raise PydanticCustomError("beyond", "must be 0, or between 1e-30 and 1e30 in size")
        return value

    @property
    def stated(self) -> dict[str, Any]:
        """The stated keys with their values, without assumed ones."""
        return {key: getattr(self, key) for key in self.model_fields_set}

    def changed(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Returns the stated keys with some changed."""
        return self.stated | changes

    def assume(self, **values: Any) -> None:
        """Sets keys that are not stated, while a sheet is read."""
        self.__dict__.update(values)


def above_zero(key: str, value: object, remedy: str = "a number") -> float:
    """Checks a number above zero and returns it as a float.

    Raises:
      ValueError: `value` is no such number.
    """
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < math.inf:
        raise ValueError(f"{key} = {shown(value)}: must be {remedy} above zero, finite")
    if not SMALLEST <= value <= LARGEST:
        raise ValueError(f"{key} = {shown(value)}: must be {remedy} between 1e-30 and 1e30")
    return float(value)


def _line_check(most: int) -> Callable[[str], str]:
    def check(text: str) -> str:
        if not text.strip() or not text.isprintable():
            raise PydanticCustomError("line", "must be one line of text")
        if len(text) > most:
            raise PydanticCustomError("long", f"must be at most {most} characters long")
        return text

    return check


Name = Annotated[str, AfterValidator(_line_check(LONGEST_NAME))]
"""The name of a recipe, an experiment, a sample or a parameter; messages repeat it."""
FileName = Annotated[str, AfterValidator(_line_check(LONGEST_PATH))]
"""A path, or the name of a bundled sheet."""


OTHER_SHEETS = {
    "sample": "an experiment, not a recipe; give it to mrjax-calibrate",
    "particle": "a recipe, not an experiment; give it to mrjax simulate",
}

SheetType = TypeVar("SheetType", bound=Sheet)


def bundled(package: str) -> dict[str, Path]:
    """Returns the TOML files of a package, by name."""
    return {
        Path(entry.name).stem: Path(str(entry))
        for entry in resources.files(package).iterdir()
        if entry.name.endswith(".toml")
    }


def read(source: str | Path, package: str, kind: str) -> tuple[dict[str, Any], Path]:
    """Reads a TOML file by path, or a bundled one of `package` by name.

    Args:
      source: path or name.
      package: package with bundled sheets.
      kind: word for such a sheet in messages.

    Returns:
      The tables, and the path of the file.

    Raises:
      InputError: there is no such file, or it cannot be read, or it is not TOML.
    """
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"{source!r}: is no file name; give a {kind}'s name or a path")
    name = str(source)
    if not name.isprintable():
        raise InputError(f"{shown(name)}: is no file name; give a {kind}'s name or a path")
    bundled_sheets = bundled(package)
    path = bundled_sheets.get(name, Path(source))
    names = ", ".join(sorted(bundled_sheets))
    if not name:
        raise InputError(f"'': is no file name; give a TOML file or one of {names}")
    try:
        content = reading.text(path, MOST_BYTES)
    except FileNotFoundError:
        hint = did_you_mean(name.lower(), bundled_sheets)
        raise InputError(
            f"{source}: no such file, and no bundled {kind}; {hint}give a TOML file or one of "
            f"{names}"
        ) from None
    except IsADirectoryError:
        raise InputError(
            f"{source}: is a directory; give a TOML file in it, or one of {names}"
        ) from None
    except UnicodeDecodeError:
        raise InputError(f"{source}: is not UTF-8 text; save the {kind} as UTF-8 TOML") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{source}: cannot be read ({reason}); check the path") from None
    return _tables(content, str(source)), path


def _tables(content: str, source: str) -> dict[str, Any]:
    try:
        toml_limits.refuse_excess(content)
        return tomllib.loads(content)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        message = shortened(" ".join(str(error).split()), 2 * LONGEST)  # its end has the line
        raise InputError(f"{source}: is not TOML: {message}; mend that line") from None
    except ValueError as error:  # an integer of thousands of digits
        raise InputError(f"{source}: cannot be read ({error}); check the path") from None


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """Returns the question "did you mean ...?" with the closest candidate, or an empty text."""
    close = difflib.get_close_matches(name, list(candidates), n=1) if len(name) <= LONGEST else []
    return f"did you mean {close[0]}? " if close else ""


def validated(model: type[SheetType], table: dict[str, Any], source: str) -> SheetType:
    """Validates a table as a `model`.

    Raises:
      InputError: there is a fault; the message has the key, its value, the fault and the remedy.
    """
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise InputError(f"{source}: {first_fault(model, error)}") from None


def first_fault(model: type[Sheet], error: ValidationError) -> str:
    """Returns the first fault in one line: the key, its value, the fault and the remedy."""
    faults = error.errors(include_url=False)
    # A misspelt key is reported as missing, too: unknown keys come first.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    path, kind = list(fault["loc"]), fault["type"]
    if kind != "extra_forbidden":
        path = [part for part in path if not _is_branch(part)]
    key = ".".join(map(shown_key, path))
    field = _field(model, path)
    description = field.description if field is not None else None
    match kind:
        case "missing":
            return f"{key} is missing; give {description}"
        case "extra_forbidden":
            valid = _valid_keys(model, path[:-1])
            hint = did_you_mean(str(path[-1]), valid) or f"known here: {', '.join(valid)}"
            if len(path) == 1 and path[0] in OTHER_SHEETS:
                return f"{key}: this is {OTHER_SHEETS[path[0]]}"
            return f"{key} = {shown(fault['input'])}: unknown key; {hint.rstrip()}"
        case "value_error":
            message = str(fault["ctx"]["error"])
            return message if key.split(".")[0] in message else f"{key}: {message}"
        case _:
            return f"{key} = {shown(fault['input'])}: {_problem(fault)}; give {description}"


def _problem(fault: ErrorDetails) -> str:
    match fault["type"]:
        case "model_type" | "dict_type" | "model_attributes_type":
            return "must be a table"
        case "float_type" | "float_parsing" | "int_type":
            return "must be a finite number"
        case "list_type":
            return "must be a list"
        case _:
            problem = fault["msg"].replace("Input should", "must", 1)
            return problem.replace("must be a valid", "must be a")


def _is_branch(part: Any) -> bool:
    """True if a part of an error's location names a branch of a union, not a key."""
    return isinstance(part, str) and ("[" in part or part in {"float", "str", "int"})


def _model_at(model: type[BaseModel], path: list) -> type[BaseModel] | None:
    for part in path:
        field = model.model_fields.get(part) if isinstance(part, str) else None
        if field is None:
            continue
        inner = [
            candidate
            for candidate in (field.annotation, *getattr(field.annotation, "__args__", ()))
            if isinstance(candidate, type) and issubclass(candidate, BaseModel)
        ]
        if not inner:
            return None
        model = inner[0]
    return model


def _field(model: type[BaseModel], path: list) -> FieldInfo | None:
    names = [part for part in path if isinstance(part, str)]
    if not names:
        return None
    owner = _model_at(model, names[:-1])
    return owner.model_fields.get(names[-1]) if owner else None


def _valid_keys(model: type[BaseModel], path: list) -> list[str]:
    owner = _model_at(model, path)
    return list(owner.model_fields) if owner else []
