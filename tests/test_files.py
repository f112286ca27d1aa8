"""Result files: whole or not at all, without pickle, and refused in one line where damaged."""

import stat

import jax.numpy as jnp
import numpy as np
import pytest

from mrjax import InputError, files


def test_an_npz_gives_back_every_bit_and_its_metadata(tmp_path):
    arrays = {
        "position_m": jnp.linspace(0.0, 1e-5, 12).reshape(4, 3) / 3,
        "velocity_m_per_s": np.float32([[1 / 3, np.nan, np.inf]]),
        "partner": np.array([[-1, 2]], np.int32),
        "nothing": np.zeros((0, 3)),
    }
    metadata = {"seed": np.int64(3), "recipe": 'name = "größe"\n', "none": None, "x": jnp.ones(())}
    files.write_npz(tmp_path / "run.npz", arrays, metadata)
    read, told = files.read_npz(tmp_path / "run.npz")
    assert list(read) == list(arrays)
    for name, array in arrays.items():
        assert read[name].dtype == array.dtype and read[name].shape == array.shape
        assert read[name].tobytes() == np.asarray(array).tobytes()
    assert told == {"seed": 3, "recipe": 'name = "größe"\n', "none": None, "x": 1.0}


def test_what_only_pickle_could_write_is_not_written(tmp_path):
    path = tmp_path / "run.npz"
    for arrays in ({"state": np.array([None])}, {"metadata": np.zeros(1)}):
        with pytest.raises(TypeError, match=next(iter(arrays))):
            files.write_npz(path, arrays, {})
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_or_foreign_npz_is_refused_in_one_line(tmp_path):
    good = tmp_path / "good.npz"
    files.write_npz(good, {"a": np.arange(1000.0)}, {})
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
            files.read_npz(tmp_path / f"{name}.npz")
    with pytest.raises(InputError, match=r"none\.npz: no such file"):
        files.read_npz(tmp_path / "none.npz")
    with pytest.raises(InputError, match="cannot be read"):
        files.read_npz(tmp_path)


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    files.write_text(path, "old\n")
    with pytest.raises(KeyboardInterrupt), files.replacing(path) as scratch:
        scratch.write_text("half")
        assert scratch.parent == tmp_path and path.read_text() == "old\n"
        raise KeyboardInterrupt
    assert path.read_text() == "old\n" and list(tmp_path.iterdir()) == [path]
    files.write_text(path, "new\r\n")
    assert path.read_bytes() == b"new\r\n" and list(tmp_path.iterdir()) == [path]
    by_hand = tmp_path / "b.txt"
    by_hand.touch()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(by_hand.stat().st_mode)
