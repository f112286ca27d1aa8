"""States put by hand, and room for what their contacts remember."""

import jax.numpy as jnp
import numpy as np

from mrjax.core.state import NOBODY, WALLS, ContactHistory, allocate_history, widened


def test_a_history_begins_with_nobody():
    history = allocate_history(3, 2, jnp.float32, sliding=True, rolling=False)
    assert (history.partner == NOBODY).all() and history.partner.shape == (3, 2)
    assert history.sliding.dtype == jnp.float32 and not history.sliding.any()
    assert history.rolling is None
    assert allocate_history(3, 2, float, sliding=False, rolling=False) is None
    assert allocate_history(3, 2, float, sliding=False, rolling=True).sliding is None


def test_wider_slots_are_empty():
    """An empty slot holds nobody, and not particle 0."""
    partner = jnp.array([[1, WALLS[4]], [0, NOBODY]], jnp.int32)
    sliding = jnp.arange(1.0, 13.0).reshape(2, 2, 3)
    wide = widened(ContactHistory(partner, sliding, None), 4)
    np.testing.assert_array_equal(wide.partner[:, :2], partner)
    np.testing.assert_array_equal(wide.partner[:, 2:], np.full((2, 2), NOBODY))
    np.testing.assert_array_equal(wide.sliding[:, :2], sliding)
    assert wide.sliding.shape == (2, 4, 3) and not wide.sliding[:, 2:].any()
    assert wide.rolling is None and widened(None, 4) is None
