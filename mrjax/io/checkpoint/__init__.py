"""Checkpoints: long work is saved piece by piece, so that a killed run can be resumed.

`Checkpoint` is a folder of pieces and `Sequence` a chain of them; `folder` begins, locks and
removes checkpoints.
"""

from mrjax.io.checkpoint.checkpoint import Checkpoint as Checkpoint
from mrjax.io.checkpoint.folder import MOST_NAMES as MOST_NAMES
from mrjax.io.checkpoint.folder import holds_anything as holds_anything
from mrjax.io.checkpoint.folder import locked as locked
from mrjax.io.checkpoint.folder import remove as remove
from mrjax.io.checkpoint.marker import refuse_foreign as refuse_foreign
from mrjax.io.checkpoint.sequence import Sequence as Sequence
from mrjax.io.checkpoint.work import digest as digest
