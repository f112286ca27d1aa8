"""`pair_sum`, a JAX operation that sums a law over pairs of particles.

The package imports nothing else from mrjax and could be published by itself. Its subpackage `llvm`
compiles the loop over the pairs for a CPU.
"""

from .summation import pair_sum

__all__ = ["pair_sum"]
