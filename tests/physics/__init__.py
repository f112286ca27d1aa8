"""Physics across rooms: collisions, spin, gradients and forces of whole runs."""
