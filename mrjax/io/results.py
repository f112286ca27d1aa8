"""The list of files that mrjax wrote in a folder; a command overwrites and deletes only these.

A JSON file in the folder lists their names with digests of their content. During a replacement the
list has the digests of the old and of the new content, so that a process may be killed at any time.
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
    """The files that mrjax wrote in a folder."""

    folder: Path
    files_list: _List

    @classmethod
    def load(cls, folder: Path) -> "Results":
        """Reads the list of a folder; the list is empty if there is no such file.

        Raises:
          InputError: the file is not a list that mrjax wrote.
        """
        path = folder / LIST
        try:
            return cls(folder, markers.read(path, _List) or _List(kind="mrjax results", digests={}))
        except ForeignError as error:
            raise InputError(
                f"{path}: is not a list that mrjax wrote, or is damaged ({error}); nothing is "
                "written beside it: give another --out, or take it away"
            ) from None

    def refuse_foreign(self, names: Iterable[str]) -> None:
        """Refuses names of files that mrjax did not write.

        Raises:
          InputError: mrjax did not write one of the files, or it has changed since.
        """
        for name in names:
            path = self.folder / name
            if os.path.lexists(path) and not self._written_by_mrjax(name):
                raise InputError(
                    f"{path}: was not written by mrjax, or has changed since; it is not "
                    "overwritten: give another --out, or take it away"
                )

    def discard(self, name: str) -> None:
        """Deletes a file of an earlier command, if it exists; raises as `refuse_foreign` does."""
        self.refuse_foreign([name])
        (self.folder / name).unlink(missing_ok=True)

    def replace(self, path: Path, scratch: Path) -> None:
        """Lists the new content of a file before it is replaced; raises as `refuse_foreign` does.

        Args:
          path: path of the file.
          scratch: path of the scratch file that is about to replace it.
        """
        if path.parent.absolute() != self.folder.absolute() or path.name == LIST:
            return
        self.refuse_foreign([path.name])
        before = [_digest(path)] if path.exists() else []
        self.files_list.digests[path.name] = [*before, _digest(scratch)]
        files.write_json(self.folder / LIST, self.files_list.model_dump())

    def _written_by_mrjax(self, name: str) -> bool:
        path = self.folder / name
        if not stat.S_ISREG(path.lstat().st_mode) or name not in self.files_list.digests:
            return False
        return _digest(path) in self.files_list.digests[name]


@contextmanager
def guarded(folder: Path, names: Iterable[str] = ()) -> Iterator[Results]:
    """Context in which files of a folder are replaced only if mrjax wrote them.

    Args:
      folder: folder of the results.
      names: names of files that will be written; they are checked at once.

    Raises:
      InputError: mrjax did not write one of the files, or it has changed since.
    """
    own_files = Results.load(folder)
    own_files.refuse_foreign(names)
    before = files.WATCHING.set(own_files.replace)
    try:
        yield own_files
    finally:
        files.WATCHING.reset(before)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
