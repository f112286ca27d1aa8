"""Long work kept on disk piece by piece, so that a run that was killed goes on from there.

What is kept is what each piece gave. Work that is resumed takes the same decisions from the same
numbers again, and so ends with the same bits as work that nothing stopped.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike
from pydantic import BaseModel

from mrjax import cache, files
from mrjax.errors import InputError

OF = "of.json"
"""What work a folder belongs to."""
PACKAGES = ("mrjax", "jax", "jaxlib", "llvmlite", "numpy", "scipy")
"""Those on whose versions digits hang."""


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    """A folder of pieces of one piece of work, made with the first of them."""

    folder: Path
    of: dict[str, str]

    @classmethod
    def of_work(cls, folder: Path, **work: Any) -> "Checkpoint":
        """The one in a folder, or one to be begun there.

        Args:
          folder: need not be there yet.
          work: all that decides what the work gives, by name.

        Raises:
          InputError: the folder keeps other work; the message says what differs.
        """
        here = {**dict(_told("", work)), **_environment()}
        try:
            there = json.loads((folder / OF).read_text("utf-8"))
        except FileNotFoundError:
            there = here
        except (OSError, ValueError) as error:
            raise InputError(f"{folder}: cannot be read ({error}); take it away") from None
        for name in {**here, **there}:
            if here.get(name) != there.get(name):
                raise InputError(
                    f"{folder}: keeps other work, with {name} = {there.get(name, 'not given')} "
                    f"where it is {here.get(name, 'not given')} here; give what it began with, or "
                    "take it away to begin anew"
                )
        return cls(folder, here)

    def claim(self) -> None:
        """Makes the folder, and says there what it is of."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if not (self.folder / OF).exists():
            files.write_json(self.folder / OF, self.of)

    def kept(self, name: str) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
        """Arrays and metadata of a piece; None where it was not done yet.

        Raises:
          InputError: its file is damaged.
        """
        path = self.folder / f"{name}.npz"
        return files.read_npz(path) if path.exists() else None

    def keep(
        self, name: str, arrays: Mapping[str, ArrayLike], metadata: Mapping[str, Any] | None = None
    ) -> None:
        """Keeps a piece, in place of what went by that name."""
        self.claim()
        files.write_npz(self.folder / f"{name}.npz", arrays, metadata or {})


def holds_anything(folder: Path) -> bool:
    """Whether any piece is kept in a folder."""
    return any(folder.rglob("[!.]*.npz"))


def remove(folder: Path) -> None:
    """Takes a folder of checkpoints away, if there is one: all of it or nothing counts."""
    gone = folder.with_name(f".{folder.name}.done")
    shutil.rmtree(gone, ignore_errors=True)
    if folder.exists():
        folder.replace(gone)  # what is half removed must not be taken for a checkpoint
        shutil.rmtree(gone, ignore_errors=True)


def digest(*arrays: ArrayLike) -> str:
    """A name for numbers, to the last bit."""
    found = hashlib.sha256()
    for array in map(np.asarray, arrays):
        found.update(f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def _environment() -> dict[str, str]:
    """On what else the last digits hang."""
    versions = {f"version of {name}": importlib.metadata.version(name) for name in PACKAGES}
    return versions | {"machine": cache.machine(), "device": jax.default_backend()}


def _told(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """All that a value consists of, by name, as text; arrays by a digest."""
    if isinstance(value, jax.tree_util.Partial):
        value = {"law": value.func.__qualname__, **value.keywords}
    elif isinstance(value, BaseModel):
        value = dict(value)
    elif dataclasses.is_dataclass(value):
        value = {one.name: getattr(value, one.name) for one in dataclasses.fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, list | tuple):
        value = {str(place): one for place, one in enumerate(value)}
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _told(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, str | bool | int | float) or value is None:
        yield name, str(value)
    elif np.ndim(value):
        yield name, f"array {digest(value)}"
    else:
        yield name, str(np.asarray(value).item())
