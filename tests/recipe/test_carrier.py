"""A carrier with a yield stress on a lab sheet: its keys, and what moves in it, in words."""

import pytest

import mrjax
from mrjax.recipe import carrier
from mrjax.simulation import derived

FLUID = {"density": 950.0, "viscosity": 0.01}


def oil(diameter=4e-6, **fluid):
    return mrjax.Recipe(
        name="thick",
        particle={"density": 7470.0, "diameter": diameter, "material": "metal"},
        fluid=fluid if "consistency" in fluid else FLUID | fluid,
        composition={"volume_fraction": 0.337},
    )


def said(recipe, tube_diameter=None):
    return carrier.notes(recipe.parameters(), recipe.coated_volume_fraction, tube_diameter)


def test_the_keys_of_a_sheet_are_leaves():
    parameters = oil(
        density=950.0, consistency=0.2, flow_index=0.6, yield_stress=0.003, yield_growth=1e-6
    ).parameters()
    assert parameters.viscosity == 0.2 and parameters.flow_index == 0.6
    assert parameters.yield_stress == 0.003 and parameters.yield_growth == 1e-6
    plain = oil().parameters()
    assert plain.yield_stress is plain.flow_index is plain.yield_growth is None


def test_a_consistency_stands_in_place_of_the_viscosity_of_water():
    recipe = oil(liquid="water", consistency=0.2)
    assert recipe.fluid.viscosity == 0.2 and recipe.fluid.density == pytest.approx(998.2, abs=0.1)
    assert recipe.notes == ["water at 293.15 K has density 998.204 kg/m^3"]


@pytest.mark.parametrize(
    "fluid, fault",
    [
        (
            {"viscosity": 0.01, "consistency": 0.2},
            "consistency = 0.2: stands in place of visc",
        ),
        ({"flow_index": 0.5}, "flow_index = 0.5: needs consistency, in Pa"),
        ({"yield_stress": -1.0}, "yield_stress = -1.0: .* give the yield stress in Pa, at least 0"),
        ({"consistency": 0.2, "flow_index": 3.0}, "give the flow index n, 0.1 to 2"),
    ],
)
def test_a_fluid_that_is_none_is_refused(fluid, fault):
    with pytest.raises(mrjax.InputError, match=fault):
        oil(density=950.0, **fluid)


def test_what_moves_is_said_with_the_distance_to_each_threshold():
    single, wall = said(oil(yield_stress=0.00305))
    assert single.startswith("single particles move, at ")
    assert single.endswith("0.00305 Pa, is 0.25 of the 0.0122 Pa that hold one")
    assert "can slide along the wall of a tube of 20 mm, the usual one, whose" in wall
    single, wall = said(oil(yield_stress=0.0244), tube_diameter=0.01)
    assert single == (
        "particles of 4 um stand still: the yield stress, 0.0244 Pa, is 2 times the 0.0122 Pa that "
        "hold a single one"
    )
    # 4 tau_y / (Delta rho g phi) = 4.53 um
    assert wall.endswith("threshold is 53.9 Pa: the yield stress is 0.000453 of it; the wall holds "
                         "it in tubes of up to 0.00453 mm")  # fmt: skip
    _, wall, nothing = said(oil(yield_stress=108.0), tube_diameter=0.01)
    assert "is held by the wall" in wall and nothing == "nothing moves in a tube of 10 mm"


def test_of_several_sizes_the_small_ones_stand_still():
    (some, _) = said(oil([2e-6, 4e-6], yield_stress=0.0092))
    assert some.startswith("particles of less than 3.02 um stand still in the yield stress")


def test_an_ageing_carrier_stops_all_at_a_time():
    assert said(oil(yield_stress=0.0022, yield_growth=1e-6))[-1].endswith("after 1e+04 s")
    assert said(oil()) == said(oil(yield_stress=0.0)) == []


def test_without_gravity_there_is_no_threshold():
    floating = oil(yield_stress=0.01, yield_growth=1e-6).replace(gravity=0.0)
    assert said(floating) == []
    assert "yield_number" not in {row[0] for row in derived._of_fall(floating)}


def test_check_has_the_yield_number_and_leaves_out_runs_of_particles():
    thick = oil(yield_stress=0.00305)
    keys = {one.key: one.value for one in derived.derived(thick)}
    assert keys["yield_number"] == pytest.approx(0.143 / 4, rel=1e-3)
    assert keys["critical_yield_stress"] == pytest.approx(0.0122, rel=1e-3)
    assert "time_step" not in keys and "time_step" in {one.key for one in derived.derived(oil())}
    notes = derived.notes(thick, tube_diameter=0.01)
    assert any("particles in contact are simulated in a Newtonian fluid only" in x for x in notes)
    assert "a tube of 10 mm whose" in notes[-1]
