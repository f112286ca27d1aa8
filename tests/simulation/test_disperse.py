"""The dispersed suspension: no overlap, well mixed, repeatable, where random insertion fails."""

from functools import partial
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import cKDTree

import mrjax

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

CASE2 = resources.files("mrjax.recipe.bundled").joinpath("case2.toml").read_text()


def recipe_of(folder, particle: float, size: list[float], periodic=(False, False, False)):
    """Case 2 with another weight fraction of particles and another box."""
    sheet = CASE2
    for old, new in (
        ("particle = 0.80", f"particle = {particle}"),
        ("fluid = 0.20", f"fluid = {1 - particle}"),
        ("size = [25e-6, 25e-6, 50e-6]", f"size = {size}"),
        ("periodic = [false, false, false]", f"periodic = {str(list(periodic)).lower()}"),
    ):
        assert old in sheet
        sheet = sheet.replace(old, new)
    (folder / "sheet.toml").write_text(sheet)
    return mrjax.Recipe.load(folder / "sheet.toml")


def separated(recipe: mrjax.Recipe, state: mrjax.State) -> None:
    """N particles in the box, none of which touches another or a wall; at rest."""
    diameter = recipe.particle.diameter * recipe.radius_factor
    position = np.asarray(state.position, np.float64)
    size = np.array(recipe.box.size)
    assert position.shape == (recipe.particle_count, 3)
    # All pairs, to the nearest image.
    vector = position[:, None, :] - position[None, :, :]
    vector -= np.where(recipe.box.periodic, size * np.round(vector / size), 0.0)
    distance = np.linalg.norm(vector, axis=-1)
    np.fill_diagonal(distance, np.inf)
    assert distance.min() > diameter
    # The same by a tree, which knows nothing of images but its own (0: none).
    periodic = np.array(recipe.box.periodic)
    tree = cKDTree(
        np.where(periodic, position % size, position), boxsize=np.where(periodic, size, 0.0)
    )
    assert not tree.query_pairs(diameter)
    for axis in range(3):
        margin = 0.0 if periodic[axis] else diameter / 2
        assert position[:, axis].min() >= margin
        assert position[:, axis].max() <= size[axis] - margin
    assert not np.any(state.velocity) and not np.any(state.spin)


@pytest.fixture(scope="module")
def suspensions(case2):
    """Case 2 from six seeds."""
    return [mrjax.disperse(case2, seed) for seed in range(6)]


def test_314_bare_particles_do_not_touch(case2, suspensions):
    assert case2.particle_count == 314
    for state in suspensions:
        separated(case2, state)
        assert state.position.dtype == np.float64
        assert state.contact_diameter == near(4e-6, rel=1e-12)


def test_292_coated_particles_do_not_touch(case3):
    state = mrjax.disperse(case3)
    assert state.particles == 292
    separated(case3, state)
    # Contact is between coatings.
    assert state.contact_diameter == near(4.4e-6, rel=1e-12)


def test_the_same_seed_gives_the_same_suspension(case2, suspensions):
    np.testing.assert_array_equal(mrjax.disperse(case2).position, suspensions[0].position)
    np.testing.assert_array_equal(mrjax.disperse(case2, 3).position, suspensions[3].position)


def test_another_seed_gives_another_suspension(suspensions):
    first, second = (np.asarray(state.position) for state in suspensions[:2])
    # Of two independent suspensions, hardly a coordinate agrees to a tenth of a radius.
    assert np.mean(np.abs(first - second) < 0.2e-6) < 0.05


def test_the_suspension_is_uniform_along_its_height(case2, suspensions):
    height = 1e6 * np.concatenate([np.asarray(state.position)[:, 2] for state in suspensions])
    # Centres keep one radius, 2 um, from floor and lid. Independent ones would fluctuate by
    # sqrt(n p (1 - p)); hard spheres fluctuate less, and layers at the walls fill whole bins.
    counts, _ = np.histogram(height, np.linspace(2.0, 48.0, 9))
    expected = len(height) / 8
    assert len(height) == 6 * 314
    assert np.all(np.abs(counts[1:-1] - expected) < 4 * np.sqrt(expected * 7 / 8)), counts
    # First layers against a wall are denser than the bulk: up to a quarter of a bin.
    assert np.all(np.abs(counts[[0, -1]] / expected - 1) < 0.25 + 4 / np.sqrt(expected)), counts
    # The mean of independent heights: 46 / sqrt(12 n), four of them.
    assert abs(height.mean() - 25.0) < 4 * 46 / np.sqrt(12 * len(height))
    # The layers at the walls, 2 % of the particles at either end, widen the spread by 5 %; a bed
    # settled to three quarters of the height would narrow it by 25 %.
    assert height.std() == near(46 / np.sqrt(12), rel=0.08)


def test_random_insertion_fails_at_this_volume_fraction(case2):
    random = np.random.default_rng(0)
    size, diameter = np.array(case2.box.size), case2.particle.diameter
    placed = np.empty((0, 3))
    for _ in range(30_000):  # a hundred for each particle
        centre = diameter / 2 + random.uniform(size=3) * (size - diameter)
        if np.all(np.sum((placed - centre) ** 2, axis=1) >= diameter**2):
            placed = np.vstack([placed, centre])
    # About 260 of 314: far fewer, though each seed differs by some ten.
    assert 200 < len(placed) < 290 < case2.particle_count


def test_single_precision(case2):
    state = mrjax.disperse(case2, dtype=jnp.float32)
    assert {leaf.dtype for leaf in (state.position, state.velocity, state.spin)} == {
        np.dtype(np.float32)
    }
    separated(case2, state)


def test_jax_without_double_precision(case2):
    with jax.enable_x64(False):
        state = mrjax.disperse(case2)
        assert state.position.dtype == np.float32
        separated(case2, state)


@pytest.mark.parametrize("periodic", [(True, True, True), (True, False, False)], ids=str)
def test_periodic_boxes(tmp_path, periodic):
    recipe = recipe_of(tmp_path, 0.8, [20e-6, 18e-6, 24e-6], periodic)
    separated(recipe, mrjax.disperse(recipe, seed=1))


@pytest.mark.parametrize(
    "particle",
    [
        # Weight fractions of volume fractions 0.45 and 0.5.
        0.8655,
        0.8872,
    ],
)
def test_denser_suspensions(tmp_path, particle):
    recipe = recipe_of(tmp_path, particle, [22e-6, 22e-6, 32e-6], (True, True, True))
    separated(recipe, mrjax.disperse(recipe))


def test_no_seed_leaves_an_overlap(tmp_path):
    """However small: spheres that are pushed apart come to touch before they are free."""
    recipe = recipe_of(tmp_path, 0.8655, [12e-6, 12e-6, 12e-6], (True, True, False))
    for seed in range(40):
        separated(recipe, mrjax.disperse(recipe, seed))


@pytest.mark.parametrize(
    ("count", "particle", "size"),
    [
        (1, 0.8, [5e-6, 5e-6, 5e-6]),
        # 0.3/7470 / (0.3/7470 + 0.7/950) = 0.0517 of the volume.
        (2, 0.3, [10e-6, 10e-6, 13e-6]),
    ],
)
def test_one_and_two_particles(tmp_path, count, particle, size):
    recipe = recipe_of(tmp_path, particle, size)
    assert recipe.particle_count == count
    separated(recipe, mrjax.disperse(recipe))


def test_a_box_that_cannot_hold_the_particles_is_refused_in_one_line(tmp_path):
    # Two spheres of 4 um in 5 x 5 x 6 um: centres at most sqrt(1 + 1 + 4) = 2.4 um apart.
    recipe = recipe_of(tmp_path, 0.8, [5e-6, 5e-6, 6e-6])
    assert recipe.particle_count == 2
    with pytest.raises(mrjax.InputError) as error:
        mrjax.disperse(recipe)
    message = str(error.value)
    assert "\n" not in message
    for words in ("2 particles of 4 um", "5 x 5 x 6 um", "0.337", "larger box or fewer particles"):
        assert words in message
