"""Text of files in the encodings of instruments and spreadsheets."""

from pathlib import Path

import pytest

import mrjax
from calibrate.experiment.readings.text import decoded

TEXT = "Zeit (min);Höhe (µm)\r\n0;760\r\n1;701\r\n"


@pytest.mark.parametrize(
    "encoding, stated, named",
    [
        ("utf-8", None, "UTF-8"),
        ("utf-8-sig", None, "UTF-8"),
        ("utf-16", None, "UTF-16"),
        ("utf-16-le", None, "UTF-16"),
        ("utf-16-be", None, "UTF-16"),
        ("latin-1", None, "Latin-1"),
        ("cp1252", None, "Latin-1"),
        ("latin-1", "Latin-1", "Latin-1"),
        ("utf-8", "UTF-8", "UTF-8"),
        ("utf-8-sig", "utf8", "UTF-8"),
        ("utf-16", "utf-16", "UTF-16"),
        ("cp850", "cp850", "cp850"),
    ],
)
def test_the_text_is_the_same_in_each(encoding, stated, named):
    found = decoded(TEXT.encode(encoding), Path("f"), stated)
    assert found == (TEXT, named)


@pytest.mark.parametrize(
    "content, stated, words",
    [
        (b"\x89PNG\0\0", None, "is no text"),
        ("Höhe".encode("latin-1"), "utf-8", "not text in UTF-8"),
        (b"abc", "no-such", "encoding = 'no-such' is not known"),
        (b"abc", "hex", "encoding = 'hex' is not known"),
        (b"abc\\,", "unicode_escape", "encoding = 'unicode_escape' is not known"),
        (b"abc", "a\0b", "encoding = "),
        (b"abcd", "utf-16", "'utf-16' is stated"),
        ("abc".encode("utf-16"), "latin-1", "mark of UTF-16"),
        (b"\xef\xbb\xbfabc", "latin-1", "mark of UTF-8"),
    ],
)
def test_what_is_none_is_refused(content, stated, words):
    with pytest.raises(mrjax.InputError) as refused:
        decoded(content, Path("f"), stated)
    assert words in str(refused.value)
