"""Writing of result files, whole or not at all; JSON that any parser accepts."""

import csv
import json
import math
import os
import re
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mrjax.core.refusals import refusal, writing
from mrjax.core.text import Markdown, in_markdown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 300
"""Resolution of figures as PNG."""
MOST_DOTS, MOST_DOTS_IN_ALL = 60_000, 1e8
"""Largest number of dots along a side, and of a whole figure; matplotlib's limit is 65,535 along a
side."""
Durability = Literal["name", "content", "nothing"]

SCRATCH = ".mrjax-"
"""Prefix of the names of scratch files."""
WATCHING: ContextVar[Callable[[Path, Path], None] | None] = ContextVar("watching", default=None)
"""Function called with the path of a file and of the scratch file that is about to replace it; it
may raise to refuse."""


def result_folder(path: Path) -> Path:
    """Makes the folder for results and tests that it can be written to.

    A long computation is then not lost at its end.

    Raises:
      SystemRefusal: the folder cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise refusal(f"--out {path}", error, "cannot be written to") from error
    return path


@contextmanager
def replacing(path: Path, durability: Durability = "name") -> Iterator[Path]:
    """Context that yields the path of a scratch file, which replaces the file at the end.

    A reader sees the old file or the new one, never half of it, even after a power failure. If the
    writing fails, the old file stays. The scratch file has a random name in the same folder.

    Args:
      path: path of the file.
      durability: guarantee after a power failure. `name`: the new file is there. `content`: the new
        file or the old one is there, whole. `nothing`: the file may be damaged, for files whose
        reader detects and repairs that.

    Raises:
      SystemRefusal: the file cannot be written.
    """
    with writing(path):
        # Libraries choose a format by the suffix.
        handle, name = tempfile.mkstemp(f".partial{path.suffix[:16]}", SCRATCH, path.parent)
        os.close(handle)
        scratch = Path(name)
        try:
            yield scratch
            os.chmod(scratch, 0o666 & ~_umask())
            if durability != "nothing":
                _flush(scratch)
            if (watching := WATCHING.get()) is not None:
                watching(path, scratch)
            os.replace(scratch, path)
        finally:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
    if durability == "name":
        with suppress(OSError):  # some file systems cannot flush a folder
            _flush(path.parent)


def is_scratch(name: str) -> bool:
    """True for the name of a scratch file of `replacing`, which a killed process leaves behind."""
    return re.fullmatch(rf"{re.escape(SCRATCH)}\w{{8}}\.partial(\.\w{{1,15}})?", name) is not None


def write_text(path: Path, text: str) -> None:
    """Writes a text file, which replaces an old one atomically."""
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8", newline="")


def create_text(path: Path, text: str) -> None:
    """Writes a new text file.

    Raises:
      FileExistsError: a file or a link of that name exists.
    """
    with path.open("x", encoding="utf-8", newline="") as file:
        try:
            file.write(text)
            file.flush()
        except OSError:
            path.unlink()
            raise


def as_json(value: Any, ascii_only: bool = False) -> str:
    """Returns a value as JSON; numbers of numpy and JAX are numbers, those not finite are null.

    Args:
      value: dicts, lists, text and numbers.
      ascii_only: True to escape all characters beyond ASCII; otherwise only those that are not
        printable are escaped.
    """
    lines = json.dumps(plain(value), indent=2, ensure_ascii=ascii_only).split("\n")
    return "\n".join(line if line.isprintable() else "".join(map(_in_json, line)) for line in lines)


def _in_json(character: str) -> str:
    if character.isprintable():
        return character
    return "\\u007f" if character == "\x7f" else json.dumps(character)[1:-1]


def write_json(path: Path, value: Any) -> None:
    """Writes a value as a JSON file, in the form of `as_json`."""
    write_text(path, as_json(value) + "\n")


def write_csv(path: Path, columns: dict[str, Iterable[float]]) -> None:
    """Writes columns of equal length, by name, as a CSV file with all digits."""
    rows = zip(*([float(x) for x in column] for column in columns.values()), strict=True)
    lines = [list(columns), *([repr(x) for x in row] for row in rows)]
    text = _Lines()
    csv.writer(text, lineterminator="\n").writerows(lines)
    write_text(path, "".join(text))


class _Lines(list):
    """A list that csv can write to."""

    write = list.append


def write_figure(
    folder: Path, name: str, figure: "Figure", made_by: Mapping[str, Any], pdf: bool
) -> None:
    """Writes a figure as PNG, and as PDF if requested.

    Args:
      folder: folder of the files.
      name: name of the files, without suffix.
      figure: matplotlib figure.
      made_by: recipe, seed and versions; stored as JSON in the description or subject of the files.
      pdf: True to write a PDF, too, with editable fonts.
    """
    from matplotlib import rc_context

    width, height = figure.get_size_inches()
    dots = min(
        DOTS_PER_INCH, MOST_DOTS / max(width, height), (MOST_DOTS_IN_ALL / (width * height)) ** 0.5
    )
    by, text = f"mrjax {version('mrjax')}", json.dumps(plain(made_by))
    kinds = {"png": {"Software": by, "Description": text}}
    if pdf:
        kinds["pdf"] = {"Creator": by, "Subject": text}
    for kind, metadata in kinds.items():
        with (
            replacing(folder / f"{name}.{kind}") as scratch,
            rc_context({"pdf.fonttype": 42, "text.usetex": False}),
            warnings.catch_warnings(),
        ):
            # A character that the font lacks is drawn as a box.
            warnings.filterwarnings("ignore", "Glyph ", UserWarning)
            figure.savefig(scratch, dpi=dots, metadata=metadata)


def markdown_table(header: list[str], rows: Iterable[Iterable[Any]]) -> str:
    """Returns a Markdown table; cells are escaped, unless they are Markdown already."""
    lines = [map(_cell, header), ["---"] * len(header), *(map(_cell, row) for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _cell(value: Any) -> str:
    content = value if isinstance(value, Markdown) else in_markdown(str(value))
    return content.replace("|", "\\|")


def _flush(path: Path) -> None:
    """Flushes the content of a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def plain(value: Any) -> Any:
    """Converts a value to the types of JSON; a number that is not finite becomes None."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, str | bool | int) or value is None:
        return value
    array = np.asarray(value)
    if array.ndim:
        return [plain(inner) for inner in array]
    number = array.item()
    return number if not isinstance(number, float) or math.isfinite(number) else None
