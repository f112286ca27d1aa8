"""Files of arrays: every bit comes back, and what is damaged or foreign is refused in one line."""

import jax.numpy as jnp
import numpy as np
import pytest
from pydantic import ConfigDict

from mrjax import InputError
from mrjax.io import markers, npz


class Anything(markers.Strict):
    """Any table."""

    model_config = ConfigDict(extra="allow")


ANY = npz.Schema("another", Anything, None)


def test_an_npz_gives_back_every_bit_and_its_metadata(tmp_path):
    arrays = {
        "position_m": jnp.linspace(0.0, 1e-5, 12).reshape(4, 3) / 3,
        "velocity_m_per_s": np.float32([[1 / 3, np.nan, np.inf]]),
        "partner": np.array([[-1, 2]], np.int32),
        "nothing": np.zeros((0, 3)),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "other_end": np.arange(3.0).astype(">f8"),
    }
    metadata = {"seed": np.int64(3), "recipe": 'name = "größe"\n', "none": None, "x": jnp.ones(())}
    npz.write(tmp_path / "run.npz", arrays, metadata)
    read, told = npz.read(tmp_path / "run.npz", ANY)
    assert list(read) == list(arrays)
    for name, array in arrays.items():
        assert read[name].dtype == np.asarray(array).dtype.newbyteorder("=")
        np.testing.assert_array_equal(read[name], np.asarray(array), strict=False)
        assert read[name].shape == array.shape
    assert told.model_dump() == {
        "seed": 3,
        "recipe": 'name = "größe"\n',
        "none": None,
        "x": 1.0,
    }


def test_what_only_pickle_could_write_is_not_written(tmp_path):
    path = tmp_path / "run.npz"
    for arrays in ({"state": np.array([None])}, {"metadata": np.zeros(1)}):
        with pytest.raises(TypeError, match=next(iter(arrays))):
            npz.write(path, arrays, {})
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_or_foreign_npz_is_refused_in_one_line(tmp_path):
    good = tmp_path / "good.npz"
    npz.write(good, {"a": np.arange(1000.0)}, {})
    whole = good.read_bytes()
    flipped = bytearray(whole)
    flipped[600] ^= 1  # among the numbers
    np.savez(tmp_path / "foreign.npz", a=np.zeros(2))
    np.save(tmp_path / "one.npy", np.zeros(2))
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    for name, content in {
        "empty": b"",
        "text": b"name = 1\n",
        "half": whole[: len(whole) // 2],
        "flipped": bytes(flipped),
    }.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
    for name in ("empty", "text", "half", "flipped", "foreign", "one"):
        with pytest.raises(InputError, match=rf"{name}\.npz: is not a file that mrjax wrote"):
            npz.read(tmp_path / f"{name}.npz", ANY)
    with pytest.raises(InputError, match=r"none\.npz: no such file"):
        npz.read(tmp_path / "none.npz", ANY)
    with pytest.raises(InputError, match="is not a file that mrjax wrote, nor any file"):
        npz.read(tmp_path, ANY)
