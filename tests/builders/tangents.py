"""Directions in the plane of a contact, and any vectors."""

import numpy as np
from hypothesis import strategies as st

STILL = np.zeros(3)
ALONG = np.array([0.6, 0.0, -0.8])
ACROSS = np.array([0.0, 1.0, 0.0])

_component = st.floats(-1.0, 1.0)
vectors = st.tuples(_component, _component, _component).map(np.array)


def length(vector) -> float:
    return float(np.linalg.norm(vector))
