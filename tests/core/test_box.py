"""The box: nearest images and wrapping against all images, in any mix of axes."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax import Box, InputError

SIZE = (2.0, 3.0, 5.0)
MIXES = list(itertools.product((False, True), repeat=3))
boxes = pytest.mark.parametrize("box", [Box(SIZE, mix) for mix in MIXES], ids=str)


def images(box: Box, reach: int) -> np.ndarray:
    """Offsets of all images up to `reach` boxes away, (images, 3)."""
    steps = [range(-reach, reach + 1) if flag else (0,) for flag in box.periodic]
    return np.array(list(itertools.product(*steps))) * np.array(box.size)


def somewhere(seed: int, rows: int = 200) -> np.ndarray:
    """Positions in the box and up to a box and a half beyond it, some of them on its faces."""
    random = np.random.default_rng(seed)
    inside = random.uniform(-1.5, 2.5, (rows, 3)) * SIZE
    on_faces = random.integers(-1, 3, (rows, 3)) * SIZE
    return np.where(random.uniform(size=(rows, 3)) < 0.1, on_faces, inside)


# Rounding of sums of about ten box lengths.
ROUNDING = {np.float64: 1e-14, np.float32: 5e-6}


@boxes
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_displacement_is_the_shortest_of_all_images(box, dtype):
    first, second = somewhere(0).astype(dtype), somewhere(1).astype(dtype)
    displacement, _ = box.space()
    found = displacement(jnp.asarray(first), jnp.asarray(second))
    assert found.dtype == dtype
    # Seven boxes of reach: the two are up to four apart.
    every = (first - second)[:, None, :] + images(box, 7 if sum(box.periodic) < 3 else 5)
    shortest = np.linalg.norm(every, axis=-1).min(axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(np.asarray(found), axis=-1), shortest, atol=20 * ROUNDING[dtype]
    )
    # It is one of the images, not only as long as one.
    off = np.linalg.norm(every - np.asarray(found)[:, None, :], axis=-1).min(axis=1)
    np.testing.assert_allclose(off, 0.0, atol=20 * ROUNDING[dtype])


@boxes
def test_displacement_points_from_second_to_first_and_reverses(box):
    displacement, _ = box.space()
    first, second = jnp.array([0.3, 0.2, 0.4]), jnp.array([0.1, 0.1, 0.1])
    np.testing.assert_allclose(displacement(first, second), [0.2, 0.1, 0.3], atol=1e-14)
    np.testing.assert_allclose(displacement(second, first), [-0.2, -0.1, -0.3], atol=1e-14)


@boxes
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_wrap_moves_by_whole_boxes_along_periodic_axes_only(box, dtype):
    position = somewhere(2).astype(dtype)
    wrapped = box.wrap(jnp.asarray(position))
    assert wrapped.dtype == dtype
    moved = (np.asarray(wrapped) - position) / np.array(box.size)
    np.testing.assert_allclose(moved, np.round(moved), atol=ROUNDING[dtype])
    for axis in range(3):
        if box.periodic[axis]:
            assert wrapped[:, axis].min() >= 0.0
            assert wrapped[:, axis].max() <= box.size[axis]
        else:
            np.testing.assert_array_equal(wrapped[:, axis], position[:, axis])


@boxes
def test_numpy_moves_positions_into_the_box_as_jax_does(box):
    position = somewhere(5)
    moved = box.inside(position)
    by_jax = box.wrap(jnp.asarray(position))
    np.testing.assert_allclose(moved, by_jax, rtol=0, atol=ROUNDING[np.float64])
    image = box.image(position)
    np.testing.assert_array_equal(moved, position - np.asarray(box.size) * image)
    assert (image == np.round(image)).all() and not image[:, ~np.array(box.periodic)].any()


def test_a_tree_finds_no_position_at_the_upper_end():
    """Where rounding takes a tiny negative coordinate to the whole length."""
    box = Box((1e-5, 1e-5, 1e-5), (True, False, False))
    position = np.full((1, 3), -1e-30)
    assert box.inside(position)[0, 0] == 1e-5
    np.testing.assert_array_equal(box.inside(position, below=True), [[0.0, -1e-30, -1e-30]])


@boxes
def test_shift_is_a_move_and_a_wrap(box):
    position, change = somewhere(3), somewhere(4)
    _, shift = box.space()
    shifted = shift(jnp.asarray(position), jnp.asarray(change))
    np.testing.assert_allclose(
        shifted, box.wrap(jnp.asarray(position + change)), atol=ROUNDING[np.float64]
    )


def test_a_tiny_negative_coordinate_stays_in_the_box_in_single_precision():
    box = Box(SIZE, (True, True, True))
    wrapped = np.asarray(box.wrap(jnp.full((1, 3), -1e-12, jnp.float32)))
    assert np.all((wrapped >= 0.0) & (wrapped <= np.float32(SIZE)))


def test_displacement_has_the_derivative_of_a_difference():
    displacement, _ = Box(SIZE, (True, False, True)).space()
    first, second = jnp.array([1.9, 2.9, 4.9]), jnp.array([0.1, 0.1, 0.1])
    jacobians = jax.jacobian(displacement, argnums=(0, 1))(first, second)
    np.testing.assert_array_equal(jacobians[0], np.eye(3))
    np.testing.assert_array_equal(jacobians[1], -np.eye(3))


def test_equal_boxes_are_one_compilation():
    traced = []

    @jax.jit
    def volume(box, factor):
        traced.append(box)
        return box.volume * factor

    for box in (Box(SIZE), Box([2, 3, 5], [False] * 3), Box(np.array(SIZE))):
        assert volume(box, 2.0) == 60.0
        assert hash(box) == hash(Box(SIZE))
    assert len(traced) == 1
    assert volume(Box(SIZE, (True, False, False)), 2.0) == 60.0
    assert len(traced) == 2


def test_a_box_has_no_leaves_to_trace_and_cannot_change():
    box = Box(SIZE)
    assert jax.tree.leaves(box) == []
    with pytest.raises(AttributeError):
        box.size = (1.0, 1.0, 1.0)


def test_scaled_volume_height_and_walls():
    box = Box(SIZE, (True, False, False)).scaled(0.5)
    assert box == Box((1.0, 1.5, 2.5), (True, False, False))
    assert (box.volume, box.height, box.walled_axes) == (3.75, 2.5, (1, 2))


@pytest.mark.parametrize(
    "size",
    [
        (1.0, 1.0),
        (1.0, 1.0, 1.0, 1.0),
        (1.0, 0.0, 1.0),
        (1.0, -1.0, 1.0),
        (1.0, float("nan"), 1.0),
        (1.0, float("inf"), 1.0),
        (1.0, "wide", 1.0),
        (1.0, None, 1.0),
        2.0,
        None,
    ],
)
def test_a_size_that_is_no_cuboid_is_refused(size):
    with pytest.raises(InputError) as refusal:
        Box(size)
    message = str(refusal.value)
    assert f"size = {size}" in message
    assert "three positive lengths in m" in message
    assert "\n" not in message


@pytest.mark.parametrize(
    "periodic",
    [
        (True, False),
        (True,) * 4,
        True,
        "yes",
        "xyz",
        (2, 0, 0),
        ("true", "false", "false"),
        3,
        None,
    ],
)
def test_flags_that_are_not_three_of_true_or_false_are_refused(periodic):
    with pytest.raises(InputError) as refusal:
        Box(SIZE, periodic)
    message = str(refusal.value)
    assert f"periodic = {periodic!r}" in message
    assert "true or false, for x, y and z" in message
    assert "\n" not in message
