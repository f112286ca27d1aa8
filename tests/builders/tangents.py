"""Laws in the plane of a contact: directions, paths, and derivatives with their checks.

A law of a point, (K,), gives what a contact bears and what it remembers, (6,); overlap is point[6].
"""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st

STILL = np.zeros(3)
ALONG = np.array([0.6, 0.0, -0.8])
ACROSS = np.array([0.0, 1.0, 0.0])
BETWEEN = (ALONG + ACROSS) / np.sqrt(2)

_component = st.floats(-1.0, 1.0)
vectors = st.tuples(_component, _component, _component).map(np.array)

_step = st.tuples(_component, _component)
steps = st.lists(_step, min_size=24, max_size=24)


def length(vector) -> float:
    return float(np.linalg.norm(vector))


def closed_path(steps, size) -> np.ndarray:
    """From the origin along steps of this size and back, (26, 3)."""
    changes = size * np.array(steps)
    changes = np.concatenate([changes, -changes.sum(axis=0, keepdims=True)])
    return np.concatenate([np.zeros((1, 2)), np.cumsum(changes, axis=0)]) @ [ALONG, ACROSS]


def to_and_fro(farthest) -> np.ndarray:
    """Twice between +-farthest, (513,)."""
    there = np.linspace(-farthest, farthest, 129)  # a contact yields at points of this path
    return np.concatenate([there, there[-2::-1], there[1:], there[-2::-1]])


def work_of_a_cycle(borne, path) -> float:
    """Work along the last cycle of `to_and_fro`, which is steady."""
    cycle = borne[-257:]
    return 0.5 * (cycle[1:] + cycle[:-1]) @ np.diff(path)[-256:]


def derivatives(law) -> dict:
    """One number that no component of a law drops out of, and its derivatives; over points."""

    def weighed(point):
        return jnp.dot(jnp.asarray([1.0, 2.0, -3.0, 0.5, -0.7, 1.1], point.dtype), law(point))

    of_point = {
        "value": weighed,
        "reverse": jax.grad(weighed),
        "forward": jax.jacfwd(weighed),
        "forward over reverse": jax.jacfwd(jax.grad(weighed)),
        "forward over forward": jax.jacfwd(jax.jacfwd(weighed)),
    }
    return {name: jax.jit(jax.vmap(of)) for name, of in of_point.items()}


def check_finite(derivatives, at) -> None:
    """Numbers everywhere, nothing apart, and both modes the same; at points, (N, K)."""
    found = {name: of(at) for name, of in derivatives.items()}
    for name, value in found.items():
        assert value.dtype == at.dtype
        assert jnp.isfinite(value).all(), name
        assert (value[at[:, 6] < 0] == 0).all(), name
    # Rounding, a thousand times over where terms cancel.
    forward, reverse = found["forward"], found["reverse"]
    rounding = 1e3 * jnp.finfo(at.dtype).eps * jnp.max(jnp.abs(forward), axis=0, keepdims=True)
    assert (jnp.abs(forward - reverse) <= rounding).all()


def check_central_differences(derivatives, at) -> None:
    """Gradients at points away from the switches of a law, (N, K)."""
    value, gradient = derivatives["value"], derivatives["forward"](at)
    step = 1e-6 * jnp.maximum(jnp.abs(at), 1e-2)
    for axis in range(at.shape[1]):
        change = jnp.zeros_like(at).at[:, axis].set(step[:, axis])
        central = (value(at + change) - value(at - change)) / (2 * step[:, axis])
        # Rounding over the step, 1e-17 / 1e-8, and truncation.
        np.testing.assert_allclose(gradient[:, axis], central, rtol=1e-7, atol=1e-8)


def kept_share(law, at) -> np.ndarray:
    """Remembered length over the trial one, (N,), at points, (N, K)."""
    kept = np.asarray(jax.jit(jax.vmap(law))(at)[:, 3:])
    return np.linalg.norm(kept, axis=1) / np.linalg.norm(at[:, :3], axis=1)
