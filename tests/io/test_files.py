"""Result files: whole or not at all."""

import stat

import pytest

from mrjax.io import files


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
