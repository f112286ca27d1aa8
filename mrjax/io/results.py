"""The list of files that mrjax wrote in a folder: a command overwrites and deletes no others.

A list in the folder names them, each with digests of what it may hold: of what was there before,
and of what takes its place, so that a process may be killed between the two.
"""

import hashlib
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mrjax.core.errors import InputError
from mrjax.io import files, markers
from mrjax.io.markers import ForeignError, Strict

LIST = "mrjax-results.json"


class _List(Strict):
    kind: Literal["mrjax results"]
    digests: dict[str, list[str]]


@dataclass
class Results:
    """The files of mrjax in a folder."""

    folder: Path
    listed: _List

    @classmethod
    def of(cls, folder: Path) -> "Results":
        """Reads the list of a folder; none where there is no list.

        Raises:
          InputError: what has the name of the list is none.
        """
        path = folder / LIST
        try:
            return cls(folder, markers.read(path, _List) or _List(kind="mrjax results", digests={}))
        except ForeignError as error:
            raise InputError(
                f"{path}: is no list that mrjax wrote, or damaged ({error}); nothing is written "
                "beside it: give another --out, or take it away"
            ) from None

    def refuse_foreign(self, names: Iterable[str]) -> None:
        """Passes where none of these names is that of a file that mrjax did not write.

        Raises:
          InputError: one is, or was changed since.
        """
        for name in names:
            path = self.folder / name
            if os.path.lexists(path) and not self._written_by_mrjax(name):
                raise InputError(
                    f"{path}: is not as mrjax wrote it, or not of mrjax, and is not overwritten: "
                    "give another --out, or take it away"
                )

    def discard(self, name: str) -> None:
        """Deletes a file of a command before, if it is there. Raises as `refuse_foreign`."""
        self.refuse_foreign([name])
        (self.folder / name).unlink(missing_ok=True)

    def replace(self, path: Path, scratch: Path) -> None:
        """Lists a file that is about to replace one of the folder. Raises as `refuse_foreign`."""
        if path.parent.absolute() != self.folder.absolute() or path.name == LIST:
            return
        self.refuse_foreign([path.name])
        before = [_digest(path)] if path.exists() else []
        self.listed.digests[path.name] = [*before, _digest(scratch)]
        files.write_json(self.folder / LIST, self.listed.model_dump())

    def _written_by_mrjax(self, name: str) -> bool:
        path = self.folder / name
        if not stat.S_ISREG(path.lstat().st_mode) or name not in self.listed.digests:
            return False
        return _digest(path) in self.listed.digests[name]


@contextmanager
def guarded(folder: Path, names: Iterable[str] = ()) -> Iterator[Results]:
    """Context in which files of a folder are replaced only where mrjax wrote them.

    Args:
      folder: of the results.
      names: of files that will be written; refused at once where they are of others.

    Raises:
      InputError: one of them is.
    """
    own_files = Results.of(folder)
    own_files.refuse_foreign(names)
    before = files.WATCHING.set(own_files.replace)
    try:
        yield own_files
    finally:
        files.WATCHING.reset(before)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
