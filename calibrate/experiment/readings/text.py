"""Text of a file, in any encoding of instruments and spreadsheets."""

import codecs
from pathlib import Path
from typing import NamedTuple

from mrjax import InputError
from mrjax.core.errors import shown

MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""Encodings by the mark at the beginning of a file."""
NAMES = {
    "utf-8-sig": "UTF-8",
    "utf-8": "UTF-8",
    "utf-16": "UTF-16",
    "utf-16-le": "UTF-16",
    "utf-16-be": "UTF-16",
    "cp1252": "Latin-1",
    "latin-1": "Latin-1",
    "iso8859-1": "Latin-1",
    "ascii": "ASCII",
}
"""Encodings as people call them."""


OF_ESCAPES = ("unicode-escape", "raw-unicode-escape", "utf-7", "punycode", "idna")
"""Encodings that no instrument writes, and in which plain text means something else."""


class Decoded(NamedTuple):
    """Text, and the encoding it was in."""

    text: str
    encoding: str


def decoded(content: bytes, path: Path, stated: str | None) -> Decoded:
    """The text of a file.

    A mark at the beginning means UTF-8 or UTF-16, and zeros in every other byte mean UTF-16. Other
    text is UTF-8 if it can be read so, and else Latin-1.

    Args:
      content: content of the file.
      path: path of the file, for messages.
      stated: encoding that the experiment file states; None to find it.

    Raises:
      InputError: the encoding is not known or contradicts the file, or the file is no text.
    """
    mark = next((name for mark, name in MARKS.items() if content.startswith(mark)), None)
    if stated is not None:
        candidates = [_stated_codec(stated, mark, content, path)]
    elif mark is not None:
        candidates = [mark]
    else:
        candidates = [*_codec_without_mark(content), "utf-8", "cp1252", "latin-1"]
    for name in candidates:
        try:
            text = content.decode(name)
        except (UnicodeError, ValueError):
            continue
        if "\0" in text:
            raise InputError(f"{path}: is no text; save the readings as CSV or .xlsx")
        return Decoded(text.removeprefix("\ufeff"), NAMES.get(name, name))
    raise InputError(
        f"{path}: is not text in {NAMES.get(candidates[0], candidates[0])}; state its encoding"
    )


def _stated_codec(stated: str, mark: str | None, content: bytes, path: Path) -> str:
    """The codec of a stated encoding."""
    try:
        name = codecs.lookup(stated).name
        "".encode(name)  # refuses encodings that are not for text, such as base64
        if name in OF_ESCAPES:
            raise LookupError
    except (LookupError, ValueError):
        raise InputError(
            f"{path}: encoding = {shown(stated)} is not known; give utf-8, utf-16 or latin-1"
        ) from None
    family = mark and NAMES[mark].lower()
    if mark and family and not name.startswith(family):
        raise InputError(
            f"{path}: encoding = {shown(stated)} is stated, and the file begins with the mark of "
            f"{NAMES[mark]}; take encoding away"
        )
    if name.startswith(("utf-16", "utf-32")) and b"\0" not in content:
        raise InputError(
            f"{path}: encoding = {shown(stated)} is stated, and the file does not have 2 bytes a "
            "letter; take encoding away"
        )
    return mark or name


def _codec_without_mark(content: bytes) -> list[str]:
    """UTF-16 whose mark is missing: half of the bytes of plain numbers are zero."""
    beginning = content[: 2 * (min(len(content), 400) // 2)]
    for name, zeros in (("utf-16-le", beginning[1::2]), ("utf-16-be", beginning[0::2])):
        if zeros and zeros.count(0) > 0.7 * len(zeros):
            return [name]
    return []
