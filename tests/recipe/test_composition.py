"""The four ways of stating a composition, against each other and by hand; what is refused."""

from functools import partial

import pytest

import mrjax

near = partial(pytest.approx, rel=1e-12, abs=0.0)  # its own abs passes all within 1e-12

CHALK = {
    "name": "chalk",
    "particle": {"density": 2150.0, "diameter": 2e-5},
    "fluid": {"density": 1000.0, "viscosity": 0.001},
}
COATED = {**CHALK, "coating": {"density": 800.0, "radius_factor": 1.2}}
THIN = {**CHALK, "coating": {"density": 800.0, "radius_factor": 1.001}}
LAYER = 1.2**3 - 1.0
"""Volume of the coating over that of its particle."""


def of(composition, sheet=CHALK):
    return mrjax.Recipe(**sheet, composition=composition)


# 0.085 kg of chalk and 0.915 kg of water: 39.53 mL and 915 mL.
SOLID, LIQUID = 0.085 / 2150.0, 0.915 / 1000.0
WAYS = [
    {"particle": 0.085, "fluid": 0.915},
    {"volume_fraction": SOLID / (SOLID + LIQUID)},
    {"concentration": 0.085 / (SOLID + LIQUID)},
    {"solids_ratio": 0.085 / 0.915},
]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: next(iter(way)))
def test_one_suspension_is_stated_in_four_ways(way):
    assert of(way).volume_fraction == near(SOLID / (SOLID + LIQUID))
    assert of(way).volume_fraction == pytest.approx(0.0414180, abs=5e-8)


@pytest.mark.parametrize("way", WAYS[1:], ids=lambda way: next(iter(way)))
def test_particles_are_counted_without_their_coating(way):
    """A layer of its own adds its volume where solids and fluid are weighed apart."""
    whole = SOLID + LIQUID
    if "solids_ratio" in way:
        whole += SOLID * LAYER
    found = of(way, COATED)
    assert found.volume_fraction == near(SOLID / whole)
    assert found.coated_volume_fraction == near(SOLID / whole * 1.2**3)
    assert found.notes == []


def test_a_ratio_of_solids_is_the_weights_of_particles_fluid_and_a_full_layer():
    """0.1 kg of particles need 0.1 (f_r^3 - 1) 800 / 2150 kg for their layers."""
    layers = 0.1 * LAYER * 800.0 / 2150.0
    total = 0.1 + 1.0 + layers
    weights = {"particle": 0.1 / total, "fluid": 1.0 / total, "coating": layers / total}
    by_weight, by_ratio = of(weights, COATED), of({"solids_ratio": 0.1}, COATED)
    assert by_ratio.volume_fraction == near(by_weight.volume_fraction)


def test_what_is_replaced_may_be_stated_in_another_way():
    weights = of(WAYS[0])
    for way in WAYS:
        assert weights.replace(composition=way).volume_fraction == near(weights.volume_fraction)
        assert of(way).replace(composition=WAYS[0]) == weights
    assert weights.replace(composition={"volume_fraction": 0.3}).composition.particle is None
    assert weights.replace(composition={}) == weights


@pytest.mark.parametrize("composition", [{"volume_fraction": 0.9}, {"concentration": 2000.0},
                                         {"solids_ratio": 20.0}])  # fmt: skip
@pytest.mark.parametrize("sheet", [CHALK, THIN], ids=["bare", "coated"])
def test_what_is_denser_than_close_packing_is_told_what_would_do(composition, sheet):
    ((key, value),) = composition.items()
    with pytest.raises(mrjax.InputError) as refusal:
        of(composition, sheet)
    message = str(refusal.value)
    assert message.startswith(f"composition.{key} = {value}: a volume fraction of 0.9")
    most = float(message.split("give less than ")[1].split(" ")[0])
    assert of({key: 0.99 * most}, sheet).volume_fraction < 0.64
    with pytest.raises(mrjax.InputError, match="close packing"):
        of({key: 1.01 * most}, sheet)


WRONG = {
    "nothing": ({}, "composition: states no amount of particles; give one of"),
    "two ways": (
        {"volume_fraction": 0.04, "concentration": 89.0},
        "composition.volume_fraction = 0.04 and concentration = 89: stated in more than",
    ),
    "weights and another": (
        {"particle": 0.085, "fluid": 0.915, "solids_ratio": 0.09},
        "composition.particle = 0.085 and fluid = 0.915 and solids_ratio = 0.09: stated in",
    ),
    "coating and another": (
        {"coating": 0.01, "volume_fraction": 0.04},
        "composition.coating = 0.01 and volume_fraction = 0.04: stated in more than one way",
    ),
    "particles alone": ({"particle": 0.085}, "composition.fluid is missing; give the weight"),
    "fluid alone": ({"fluid": 0.915}, "composition.particle is missing; give the weight"),
    "coating alone": ({"coating": 0.1}, "composition.particle is missing; give the weight"),
    "per cent": (
        {"volume_fraction": 4.14},
        "composition.volume_fraction = 4.14: must be less than 1; give the volume fraction",
    ),
    "no solids": (
        {"concentration": 0},
        "composition.concentration = 0: must be greater than 0; give kg of particles per m^3",
    ),
    "text": (
        {"solids_ratio": "1:10"},
        "composition.solids_ratio = '1:10': must be a finite number; give kg of particles per kg",
    ),
    "misspelt": (
        {"volume_fracton": 0.04},
        "composition.volume_fracton = 0.04: unknown key; did you mean volume_fraction?",
    ),
}


@pytest.mark.parametrize("composition, begins", WRONG.values(), ids=WRONG)
def test_a_wrong_composition_gets_one_line(composition, begins):
    with pytest.raises(mrjax.InputError) as refusal:
        of(composition)
    message = str(refusal.value)
    assert message.startswith(begins), message
    assert "\n" not in message and len(message) <= 400
    if "one of" in message:
        for way in ("particle and fluid", "volume_fraction", "concentration (kg/m^3)", "solids_r"):
            assert way in message
