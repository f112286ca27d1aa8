"""An experiment as a least-squares problem, and its solution."""
