"""The loop over pairs as machine code: LLVM compiles the law's own JAX program for the CPU."""
