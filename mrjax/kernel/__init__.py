"""A law summed over pairs as one JAX operation: `pair_sum`, the only door of this room.

Imports nothing of mrjax: it could be published by itself. `llvm` compiles the loop for a CPU.
"""

from .summation import pair_sum

__all__ = ["pair_sum"]
