"""Result files: written whole or not at all, JSON that any reader takes."""

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
"""Along a side, and of a whole figure: matplotlib draws no more than 65,535 along a side."""
Lasting = Literal["name", "content", "nothing"]

SCRATCH = ".mrjax-"
"""Beginning of the names of scratch files."""
WATCHING: ContextVar[Callable[[Path, Path], None] | None] = ContextVar("watching", default=None)
"""Called with the names of a file and of the scratch file about to replace it; it may refuse."""


def result_folder(path: Path) -> Path:
    """The folder for results, made if need be and tried, so that no work is lost at its end.

    Raises:
      SystemRefusal: it cannot be made or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise refusal(f"--out {path}", error, "cannot be written to") from error
    return path


@contextmanager
def replacing(path: Path, lasting: Lasting = "name") -> Iterator[Path]:
    """Gives a name beside a file, under which to write what then replaces it at once.

    A reader sees the old file or the new, never half of it, even after the power failed; what fails
    leaves the old one. The name is one that nobody can foresee, and was not there before.

    Args:
      path: of the file.
      lasting: what survives a failing power: the file in place of the old one; its content, or else
        the old one; or perhaps nothing, where that is found and mended.

    Raises:
      SystemRefusal: it cannot be written, whatever the system raised inside.
    """
    with writing(path):
        # Libraries choose a format by the ending.
        handle, name = tempfile.mkstemp(f".partial{path.suffix[:16]}", SCRATCH, path.parent)
        os.close(handle)
        scratch = Path(name)
        try:
            yield scratch
            os.chmod(scratch, 0o666 & ~_umask())
            if lasting != "nothing":
                _flush(scratch)
            if (watching := WATCHING.get()) is not None:
                watching(path, scratch)
            os.replace(scratch, path)
        finally:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
    if lasting == "name":
        with suppress(OSError):  # some file systems cannot
            _flush(path.parent)


def is_scratch(name: str) -> bool:
    """True for the name of a file that a killed process left of `replacing`."""
    return re.fullmatch(rf"{re.escape(SCRATCH)}\w{{8}}\.partial(\.\w{{1,15}})?", name) is not None


def write_text(path: Path, text: str) -> None:
    """Replaces a file at once."""
    with replacing(path) as scratch:
        scratch.write_text(text, encoding="utf-8", newline="")


def create_text(path: Path, text: str) -> None:
    """Writes a file that is not there yet.

    Raises:
      FileExistsError: it is, or a link of that name.
    """
    with path.open("x", encoding="utf-8", newline="") as file:
        try:
            file.write(text)
            file.flush()
        except OSError:
            path.unlink()
            raise


def as_json(value: Any, ascii_only: bool = False) -> str:
    """JSON with numpy and JAX numbers as numbers, and what is not finite as null.

    What is not printable is escaped, and all that is not ASCII where asked for.
    """
    lines = json.dumps(plain(value), indent=2, ensure_ascii=ascii_only).split("\n")
    return "\n".join(line if line.isprintable() else "".join(map(_in_json, line)) for line in lines)


def _in_json(character: str) -> str:
    if character.isprintable():
        return character
    return "\\u007f" if character == "\x7f" else json.dumps(character)[1:-1]


def write_json(path: Path, value: Any) -> None:
    """A file of JSON, as `as_json` has it."""
    write_text(path, as_json(value) + "\n")


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


def write_figure(
    folder: Path, name: str, figure: "Figure", made_by: Mapping[str, Any], pdf: bool
) -> None:
    """A figure as PNG, and as PDF where asked for, each replaced at once.

    Args:
      folder, name: of the files, without their ending.
      figure: matplotlib's.
      made_by: recipe, seed, versions: kept as JSON in the description or subject of the files.
      pdf: with fonts that can be edited.
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
            warnings.filterwarnings("ignore", "Glyph ", UserWarning)  # shown as a box
            figure.savefig(scratch, dpi=dots, metadata=metadata)


def markdown_table(header: list[str], rows: Iterable[Iterable[Any]]) -> str:
    """A Markdown table, cells as text, but for those that are Markdown already."""
    lines = [map(_cell, header), ["---"] * len(header), *(map(_cell, row) for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _cell(value: Any) -> str:
    content = value if isinstance(value, Markdown) else in_markdown(str(value))
    return content.replace("|", "\\|")


def _flush(path: Path) -> None:
    """Has what was written to a file, or the names in a folder, on the disk itself."""
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
    """A value in forms that JSON has: numbers, text, lists, tables; null for what is not finite."""
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
