"""Arrays on disk in numpy's `.npz` format, validated by a schema when they are read; no pickle.

`write` and `read` are for results. `examined` is for callers that handle a damaged file themselves.
"""

from mrjax.io.npz.archive import MAX_BYTES as MAX_BYTES
from mrjax.io.npz.reading import examined as examined
from mrjax.io.npz.reading import read as read
from mrjax.io.npz.reading import refuse_beyond_single as refuse_beyond_single
from mrjax.io.npz.schema import SIDE_BY_SIDE as SIDE_BY_SIDE
from mrjax.io.npz.schema import DamagedError as DamagedError
from mrjax.io.npz.schema import Numbers as Numbers
from mrjax.io.npz.schema import Schema as Schema
from mrjax.io.npz.writing import named as named
from mrjax.io.npz.writing import write as write
