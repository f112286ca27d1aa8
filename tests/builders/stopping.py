"""Work that is stopped as it writes its checkpoint, and results that must be the same after."""

import itertools
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import jax
import numpy as np
import pytest

from mrjax.io import npz


class Stopped(BaseException):
    """What nothing catches, as a kill."""


@contextmanager
def stopping(number: int) -> Iterator[None]:
    """The process "dies" as it writes this file, every second time before it counts.

    Its other threads die with it: they write nothing more, and have ended when this returns.
    """
    write, numbers = npz.write, itertools.count(1)
    before = set(threading.enumerate())

    def counted(*arguments):
        ours = next(numbers)
        if ours < number or (ours == number and number % 2 == 0):
            write(*arguments)
        if ours >= number:
            raise Stopped

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(npz, "write", counted)
        try:
            yield
        finally:
            for thread in set(threading.enumerate()) - before:
                if not thread.daemon:
                    thread.join()


def alike(one, other) -> None:
    """Every array of two results has the same bits."""
    first, second = (jax.tree.leaves_with_path(tree) for tree in (one, other))
    assert [path for path, _ in first] == [path for path, _ in second]
    for (path, left), (_, right) in zip(first, second, strict=True):
        assert left.dtype == right.dtype, path
        np.testing.assert_array_equal(left, right, str(path))
