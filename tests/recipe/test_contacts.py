"""What only particles in contact use is asked for where they are run, and nowhere else."""

import numpy as np
import pytest

import mrjax
from mrjax.recipe import contacts
from mrjax.recipe.materials import MATERIALS

CHALK = {
    "name": "chalk",
    "particle": {"density": 2150.0, "diameter": 2e-5},
    "fluid": {"density": 1000.0, "viscosity": 0.001},
    "composition": {"volume_fraction": 0.04},
}
MODULI = {"elastic_modulus": 70e9, "poisson_ratio": 0.25}


def chalk(**of_particle) -> mrjax.Recipe:
    return mrjax.Recipe(**{**CHALK, "particle": {**CHALK["particle"], **of_particle}})


def coated(**of_coating) -> mrjax.Recipe:
    return chalk().replace(coating={"density": 1100.0, "radius_factor": 1.1, **of_coating})


def test_without_moduli_a_suspension_settles_and_its_particles_do_not_touch():
    bare, parameters = chalk(), chalk().parameters()
    assert np.isnan(parameters.elastic_modulus) and np.isnan(parameters.wall_poisson_ratio)
    known = chalk(**MODULI).parameters()
    assert mrjax.terminal_velocity(parameters) == mrjax.terminal_velocity(known)
    assert contacts.missing(chalk(**MODULI)) is None
    with pytest.raises(mrjax.InputError) as refusal:
        mrjax.disperse(bare)
    assert str(refusal.value) == (
        "recipe 'chalk': particle.elastic_modulus is missing, which particles in contact need; "
        "give the elastic modulus in Pa, above zero, or particle.material = "
        '"metal" or "mineral" or "polymer"'
    )


@pytest.mark.parametrize(
    "recipe, key",
    [
        (chalk(poisson_ratio=0.25), "particle.elastic_modulus"),
        (chalk(elastic_modulus=70e9), "particle.poisson_ratio"),
        (coated(), "coating.elastic_modulus"),
        (coated(elastic_modulus=1e9), "coating.poisson_ratio"),
    ],
)
def test_the_modulus_that_is_missing_is_named(recipe, key):
    """Of what touches: the coating, where there is one."""
    assert contacts.missing(recipe).startswith(f"{key} is missing, which particles in contact need")


@pytest.mark.parametrize("material", MATERIALS)
def test_a_material_gives_the_moduli_that_are_not_stated(material):
    modulus, ratio, of = MATERIALS[material]
    recipe = chalk(material=material)
    parameters = recipe.parameters()
    assert (parameters.elastic_modulus, parameters.poisson_ratio) == (modulus, ratio)
    assert contacts.missing(recipe) is None
    note = recipe.contact_notes[0]
    for words in (f"elastic_modulus = {modulus:.3g}", f"poisson_ratio = {ratio}", "assumed", of):
        assert words in note
    stated = chalk(material=material, elastic_modulus=70e9)
    assert stated.particle.elastic_modulus == 70e9 and stated.particle.poisson_ratio == ratio
    assert "elastic_modulus" not in stated.contact_notes[0]
    assert len(chalk(material=material, **MODULI).contact_notes) == 1  # the chosen box


def test_moduli_follow_a_material_that_is_replaced():
    metal = chalk(material="metal")
    polymer = metal.replace(particle={"material": "polymer"})
    assert polymer == chalk(material="polymer")
    assert chalk(**MODULI).replace(particle={"material": "polymer"}) == polymer
    unstated = {"elastic_modulus": None, "poisson_ratio": None}
    assert chalk(material="polymer", **unstated).stated == polymer.stated
    again = mrjax.Recipe(**{**CHALK, "particle": {**CHALK["particle"], "elastic_modulus": None}})
    assert again.particle.stated == chalk().particle.stated
    assert metal.replace(particle={"elastic_modulus": 1e9}).particle.poisson_ratio == 0.30


def test_a_coating_has_a_material_of_its_own():
    recipe = coated(material="polymer")
    assert recipe.parameters().elastic_modulus == MATERIALS["polymer"].elastic_modulus
    assert contacts.missing(recipe) is None
    assert recipe.contact_notes[0].startswith("coating.elastic_modulus = 2.8e+09 and coating.pois")


def test_a_material_that_nobody_knows_gets_one_line():
    with pytest.raises(mrjax.InputError) as refusal:
        chalk(material="wood")
    message = str(refusal.value)
    assert message.startswith("particle.material = 'wood': must be 'metal', 'mineral' or 'polymer'")


@pytest.mark.parametrize(
    "diameter", [2e-5, [1e-5, 2e-5], {"median": 2e-5, "geometric_standard_deviation": 1.5}]
)
def test_a_box_that_holds_no_particle_is_refused_where_particles_are_run(diameter):
    recipe = chalk(**MODULI).replace(
        particle={"diameter": diameter},
        composition={"volume_fraction": 1e-6},
        box={"size": [1.2e-4, 1.2e-4, 2.4e-4]},
    )
    assert recipe.particle_count == 0
    assert np.isfinite(mrjax.terminal_velocity(recipe.parameters())).all()
    with pytest.raises(mrjax.InputError) as refusal:
        mrjax.disperse(recipe)
    message = str(refusal.value)
    for words in ("box.size = [0.00012, 0.00012, 0.00024]", "1e-06", "less than one", "larger box"):
        assert words in message
    without = {key: value for key, value in recipe.stated.items() if key != "box"}
    assert contacts.missing(mrjax.Recipe(**without)) is None


def test_a_box_as_large_as_a_tube_is_refused_where_particles_are_run():
    """0.04 of 2e-4 m^3 in particles of 4e-15 m^3."""
    recipe = chalk(**MODULI).replace(box={"size": [0.02, 0.02, 0.5]})
    several = recipe.replace(particle={"diameter": [1e-5, 2e-5]})
    for one in (recipe, several):
        assert np.isfinite(mrjax.terminal_velocity(one.parameters())).all()
        with pytest.raises(mrjax.InputError) as refusal:
            mrjax.disperse(one)
        message = str(refusal.value)
        for words in ("box.size = [0.02, 0.02, 0.5]: holds", "particles, more than can", "25e-6"):
            assert words in message
    assert "holds 1.91e+09 particles" in contacts.missing(recipe)


@pytest.mark.parametrize("leaf", ["elastic_modulus", "poisson_ratio", "wall_elastic_modulus"])
def test_a_run_of_particles_refuses_moduli_that_are_not_known(leaf, case2):
    state = mrjax.place(np.array([[1e-5, 1e-5, 1e-5], [2e-5, 1e-5, 1e-5]]))
    unknown = case2.parameters().replace(**{leaf: np.nan})
    for run in (
        lambda: mrjax.simulate(state, unknown, case2.box, duration=1e-6),
        lambda: mrjax.settle(state, unknown, case2.box),
        lambda: mrjax.softened(unknown, case2.box, 2, 0.02),
    ):
        with pytest.raises(mrjax.InputError, match=rf"^{leaf} is not known \(nan\), and particles"):
            run()


def test_a_column_does_without_moduli():
    recipe = chalk()
    tube = dict(height=0.1, volume_fraction=0.04, bed_fraction=0.5, times=np.array([60.0, 120.0]))
    known = mrjax.column(chalk(**MODULI).parameters(), **tube, cells=20)
    found = mrjax.column(recipe.parameters(), **tube, cells=20)
    np.testing.assert_array_equal(found.mudline, known.mudline)
    with pytest.raises(mrjax.InputError, match=r"^viscosity = nan must be"):
        mrjax.column(recipe.parameters().replace(viscosity=np.nan), **tube, cells=20)


def test_attraction_becomes_leaves_with_the_walls_last():
    sheet = mrjax.Recipe.load("case2")
    plain = sheet.parameters()
    leaves = ("hamaker", "layer_thickness", "wall_layer_thickness", "attraction_range")
    assert all(getattr(plain, name) is None for name in leaves)
    bare = sheet.replace(attraction={"hamaker": 1e-19}).parameters()
    assert [getattr(bare, name) for name in leaves] == [1e-19, 2e-10, None, None]
    stated = sheet.replace(
        attraction={"hamaker": 1e-19, "layer_thickness": 2e-9, "range": 0.05},
        wall={"hamaker": 0.0, "layer_thickness": 1e-9},
    ).parameters()
    np.testing.assert_array_equal(stated.hamaker, [[1e-19, 0.0], [0.0, 0.0]])
    assert [float(getattr(stated, name)) for name in leaves[1:]] == [2e-9, 1e-9, 0.05]


@pytest.mark.parametrize(
    "tables, words",
    [
        ({"attraction": {"hamaker": 100.0}}, "100 zJ are 1e-19"),
        ({"attraction": {"layer_thickness": 1e-9}}, "attraction.hamaker is missing"),
        ({"wall": {"hamaker": 0.0}}, r"there is no table \[attraction\]"),
    ],
)
def test_attraction_that_cannot_be_is_refused(tables, words):
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.Recipe.load("case2").replace(**tables)


def test_no_bare_surface_is_assumed_on_a_coating(case3):
    with pytest.raises(mrjax.InputError, match=r"attraction\.layer_thickness is missing, though"):
        case3.replace(attraction={"hamaker": 1e-19})
    coated = case3.replace(attraction={"hamaker": 1e-19, "layer_thickness": 2e-7})
    assert float(coated.parameters().layer_thickness) == 2e-7


def test_walls_that_attract_without_being_stated_are_noted():
    sheet = mrjax.Recipe.load("case2").replace(attraction={"hamaker": 1e-19})
    assert any("wall.hamaker = 0" in note for note in sheet.contact_notes)
    for changes in ({"wall": {"hamaker": 0.0}}, {"attraction": {"hamaker": 0.0}}):
        assert not any("wall" in note for note in sheet.replace(**changes).contact_notes)
