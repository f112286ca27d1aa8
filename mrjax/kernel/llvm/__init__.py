"""Compilation of a loop over pairs to machine code for the CPU: LLVM compiles the law's jaxpr."""
