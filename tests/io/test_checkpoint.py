"""Checkpoints: what tells one piece of work from another, and numbers to the last bit."""

import numpy as np
import pytest

from mrjax import InputError
from mrjax.io import checkpoint
from mrjax.io.checkpoint import Checkpoint


@pytest.mark.parametrize(
    "before, now, words",
    [
        (dict(a=1), dict(a=2), "with a = .* there and"),
        (dict(a=1), dict(a=1, b=2), "with b = not given there and"),
        (dict(a=1, b=2), dict(a=1), "with b = .* there and not given here"),
    ],
    ids=["another value", "a folder that lacks a key", "a key too many"],
)
def test_other_work_is_refused_by_what_differs(tmp_path, before, now, words):
    folder = tmp_path / "kept"
    one = Checkpoint.open(folder, **before)
    one.claim()
    one.save("first", {"x": np.arange(3.0)}, {"n": 3})
    with pytest.raises(InputError, match=words) as error:
        Checkpoint.open(folder, **now)
    assert "holds other work" in str(error.value) and "to begin anew" in str(error.value)
    arrays, metadata = Checkpoint.open(folder, **before).load("first")
    np.testing.assert_array_equal(arrays["x"], [0.0, 1.0, 2.0])
    assert metadata == {"n": 3}


def test_a_digest_tells_bits_shapes_and_kinds_of_numbers():
    zeros = np.zeros((2, 3))
    others = [zeros, zeros.T, zeros.ravel(), zeros.astype(int), zeros.view(np.float32), -zeros]
    found = [checkpoint.digest(one) for one in others]
    assert len(set(found)) == len(others)
    # Bits of arrays that lie apart are read in order, and so are several arrays.
    assert checkpoint.digest(np.arange(6.0).reshape(2, 3).T) == checkpoint.digest(
        np.array([[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]])
    )
    one, other = np.zeros(2), np.ones(2)
    assert checkpoint.digest(one, other) != checkpoint.digest(other, one)
    assert checkpoint.digest(one, other) == checkpoint.digest(one.copy(), other.copy())
