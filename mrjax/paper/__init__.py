"""Son (2018) recomputed: the runs of its cases, every printed number beside ours, its figures."""
