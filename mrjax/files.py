"""Result files: written whole or not at all, JSON that any reader takes."""

import csv
import json
import math
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from mrjax.errors import InputError


def result_folder(path: Path) -> Path:
    """The folder for results, made if need be and tried, so that no work is lost at its end.

    Raises:
      InputError: it cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(
            f"--out {path}: cannot be written to ({error.strerror}); give another folder"
        ) from None
    return path


def write_text(path: Path, text: str) -> None:
    """Replaces a file at once: a reader sees the old one or the new, never half of it."""
    handle, scratch = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
        file.write(text)
    os.chmod(scratch, 0o666 & ~_umask())
    os.replace(scratch, path)


def write_json(path: Path, value: Any) -> None:
    """JSON with numpy and JAX numbers as numbers, and what is not finite as null."""
    write_text(path, json.dumps(_plain(value), indent=2, ensure_ascii=False) + "\n")


def write_csv(path: Path, columns: dict[str, Iterable[float]]) -> None:
    """Columns of equal length by name, with all digits."""
    rows = zip(*([float(x) for x in column] for column in columns.values()), strict=True)
    lines = [list(columns), *([repr(x) for x in row] for row in rows)]
    text = _Lines()
    csv.writer(text, lineterminator="\n").writerows(lines)
    write_text(path, "".join(text))


class _Lines(list):
    """A list that csv can write to."""

    write = list.append


def markdown_table(header: list[str], rows: Iterable[Iterable[Any]]) -> str:
    """A Markdown table, cells as text."""
    lines = [header, ["---"] * len(header), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in line] for line in lines)
    return "".join(f"| {' | '.join(line)} |\n" for line in cells)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, str | bool | int) or value is None:
        return value
    array = np.asarray(value)
    if array.ndim:
        return [_plain(inner) for inner in array]
    number = array.item()
    return number if not isinstance(number, float) or math.isfinite(number) else None
