"""Arrays on disk in numpy's `.npz` format, validated by a schema when they are read; no pickle.

`write` and `read` are for results. `read_or_damage` is for callers that handle damaged files.
"""

from mrjax.io.npz.archive import MAX_BYTES as MAX_BYTES
from mrjax.io.npz.reading import read as read
from mrjax.io.npz.reading import read_or_damage as read_or_damage
from mrjax.io.npz.reading import refuse_beyond_single as refuse_beyond_single
from mrjax.io.npz.schema import SIDE_BY_SIDE as SIDE_BY_SIDE
from mrjax.io.npz.schema import DamagedError as DamagedError
from mrjax.io.npz.schema import Numbers as Numbers
from mrjax.io.npz.schema import Schema as Schema
from mrjax.io.npz.writing import npz_path as npz_path
from mrjax.io.npz.writing import write as write
