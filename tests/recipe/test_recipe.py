"""The lab sheet: what follows from it, against hand calculations, and every fault it can have."""

import math
import tomllib
from functools import partial
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

CASE3 = resources.files("mrjax.recipe.bundled").joinpath("case3.toml").read_text()
CASE2 = resources.files("mrjax.recipe.bundled").joinpath("case2.toml").read_text()


def edited(text: str, *changes: tuple[str, str]) -> str:
    for old, new in changes:
        assert old in text, f"{old} is not in the sheet"
        text = text.replace(old, new, 1)
    return text


@pytest.fixture
def load(tmp_path):
    """Writes a sheet and loads it."""

    def write_and_load(text: str | bytes) -> mrjax.Recipe:
        path = tmp_path / "sheet.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return mrjax.Recipe.load(path)

    return write_and_load


@pytest.fixture
def refusal(load, tmp_path):
    """The message with which a sheet is refused, without the name of the file in front."""

    def of(text: str | bytes) -> str:
        with pytest.raises(mrjax.InputError) as error:
            load(text)
        message = str(error.value)
        assert len(message.splitlines()) == 1, message
        file = f"{tmp_path / 'sheet.toml'}: "
        assert message.startswith(file), message
        return message.removeprefix(file)

    return of


# The paper's three cases ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "volume_fraction", "coated", "count", "density", "f_w"),
    [
        # 0.8/7470 / (0.8/7470 + 0.2/950); without corrections.
        ("case1", 0.33718, 0.33718, 314, 7470.0, 1.0),
        # Eq. 14 is on its cap.
        ("case2", 0.33718, 0.33718, 314, 7470.0, 48.985),
        # 0.784/7470 / (0.784/7470 + 0.2/950 + 0.016/800); (7470 + 800 (1.1^3 - 1)) / 1.1^3.
        ("case3", 0.312845, 0.416397, 292, 5811.27, 48.985),
    ],
)
def test_what_follows_from_the_bundled_sheets(name, volume_fraction, coated, count, density, f_w):
    recipe = mrjax.Recipe.load(name)
    assert recipe.name == name
    # Half of the last digit given.
    assert recipe.volume_fraction == near(volume_fraction, abs=5e-6)
    assert recipe.coated_volume_fraction == near(coated, abs=5e-6)
    assert recipe.particle_count == count
    assert recipe.apparent_density == near(density, abs=5e-3)
    assert recipe.f_w == near(f_w, rel=1e-12)


def test_parameters_of_the_bundled_sheets():
    common = dict(
        radius=2e-6, particle_density=7470.0, fluid_density=950.0, viscosity=0.01, friction=0.3,
        restitution=0.5, dissipation=0.0, gravity=9.81,
    )  # fmt: skip
    iron = dict(elastic_modulus=211e9, poisson_ratio=0.31)
    guar = dict(elastic_modulus=3.12e9, poisson_ratio=0.25)
    expected = {
        "case1": common | iron | dict(f_w=1.0, f_s=1.0, f_v=1.0, f_r=1.0, added_mass=0.0),
        "case2": common | iron | dict(f_w=48.985, f_s=1.1, f_v=1.0, f_r=1.0, added_mass=0.5),
        "case3": common
        | guar
        | dict(f_w=48.985, f_s=1.1, f_v=1.68, f_r=1.1, added_mass=0.5, coating_density=800.0),
    }
    for name, values in expected.items():
        parameters = mrjax.Recipe.load(name).parameters()
        for quantity, value in values.items():
            found = getattr(parameters, quantity)
            assert found == near(value, rel=1e-12), (name, quantity)
            assert found.shape == ()
            assert found.dtype == np.float64
        # The walls, left out, are of the material of the surfaces.
        assert parameters.wall_elastic_modulus == parameters.elastic_modulus
        assert parameters.wall_poisson_ratio == parameters.poisson_ratio


def test_parameters_in_single_precision(case3):
    parameters = case3.parameters(jnp.float32)
    assert {leaf.dtype for leaf in jax.tree.leaves(parameters)} == {np.dtype(np.float32)}
    assert float(parameters.elastic_modulus) == near(3.12e9, rel=1e-7)


def test_bundled_boxes(case):
    assert case.box == mrjax.Box((25e-6, 25e-6, 50e-6))


def test_notes_name_a_coating_that_the_composition_cannot_hold(case2, case3, load):
    assert case2.notes == []
    (note,) = case3.notes
    # 0.784 * 800 (1.1^3 - 1) / 7470 of the weight; (1 + 0.016/0.784 * 7470/800)^(1/3).
    for words in ("radius_factor 1.1", "2.78%", "1.60%", "1.060"):
        assert words in note
    assert "\n" not in note
    largest = edited(CASE3, ("radius_factor = 1.1 ", "radius_factor = 1.0597 "))
    assert load(largest).notes == []
    beyond = edited(CASE3, ("radius_factor = 1.1 ", "radius_factor = 1.0600 "))
    assert len(load(beyond).notes) == 1


# A suspension nobody bundled --------------------------------------------------------------------

GLASS = """
name = "glass in glycerol and water, with a polymer"
gravity = 3.7
particle = {density = 2500, diameter = 50e-6, elastic_modulus = 70e9, poisson_ratio = 0.22}
fluid = {density = 1100, viscosity = 0.05}
composition = {particle = 0.5, fluid = 0.47, coating = 0.03}
contact = {friction = 0.4, restitution = 0.9, dissipation = 1e-9}
[coating]
density = 1200
elastic_modulus = 5e6
poisson_ratio = 0.45
radius_factor = 1.05
[wall]
elastic_modulus = 3e9
poisson_ratio = 0.35
[drag]
f_w = {closure = "richardson-zaki", exponent = 5.6}
f_s = [60e-6, 55e-6, 50e-6]
f_v = 2
[box]
size = [0.6e-3, 0.5e-3, 1e-3]
periodic = [true, false, false]
"""


def test_derivation_for_another_material(load):
    recipe = load(GLASS)
    # Per kg: 0.5/2500 = 2e-4 m^3 of glass, 0.47/1100 = 4.272727e-4 of fluid, 0.03/1200 = 2.5e-5
    # of polymer. Literals are from pencil and paper, to seven digits.
    assert recipe.volume_fraction == near(0.3066202, rel=1e-6)
    # times 1.05^3 = 1.157625
    assert recipe.coated_volume_fraction == near(0.3549512, rel=1e-6)
    # 0.3066202 * 3e-10 m^3 / (pi/6 * 1.25e-13 m^3) = 1405.44
    assert recipe.particle_count == 1405
    # (2500 + 1200 * 0.157625) / 1.157625
    assert recipe.apparent_density == near(2322.989, rel=1e-6)
    # (1 - 0.3549512)^-5.6, at the volume fraction of the coated particles
    assert recipe.f_w == near(11.64881, rel=1e-6)
    # (60 * 55 / 50^2)^0.09
    assert recipe.f_s == near(1.025302, rel=1e-6)
    # 0.5 * 1200 * 0.157625 / 2500 = 3.78 %; (1 + 0.03/0.5 * 2500/1200)^(1/3) = 1.0400
    (note,) = recipe.notes
    assert "3.78%" in note and "3.00%" in note and "1.040" in note

    parameters = recipe.parameters()
    expected = dict(
        radius=25e-6, particle_density=2500, fluid_density=1100, viscosity=0.05, friction=0.4,
        restitution=0.9, dissipation=1e-9, gravity=3.7, added_mass=0.5, coating_density=1200,
        elastic_modulus=5e6, poisson_ratio=0.45, wall_elastic_modulus=3e9,
        wall_poisson_ratio=0.35, f_w=11.64881, f_s=1.025302, f_v=2, f_r=1.05,
    )  # fmt: skip
    for quantity, value in expected.items():
        assert getattr(parameters, quantity) == near(value, rel=1e-6), quantity
    assert recipe.box == mrjax.Box((0.6e-3, 0.5e-3, 1e-3), (True, False, False))


def test_friction_and_walls_of_their_own(load):
    contact = (
        "dissipation = 1e-9",
        "tangential_dissipation = 2e-9, rolling_friction = 0.1, rolling_damping = 0.3",
    )
    wall = ("elastic_modulus = 3e9\npoisson_ratio = 0.35", "poisson_ratio = 0.35\nfriction = 0.6")
    parameters = load(edited(GLASS, contact, wall)).parameters()
    assert parameters.wall_elastic_modulus == 5e6  # of the polymer, as the particles
    assert parameters.wall_poisson_ratio == 0.35
    assert parameters.friction[0, 0] == 0.4
    assert parameters.friction[0, 1] == parameters.friction[1, 0] == 0.6
    assert parameters.restitution == 0.9
    assert parameters.dissipation == 0.0
    assert parameters.tangential_dissipation == 2e-9
    assert (parameters.rolling_friction, parameters.rolling_damping) == (0.1, 0.3)


def test_a_sheet_without_optional_tables(load):
    bare = GLASS[: GLASS.index("contact =")] + "box = {size = [6e-4, 5e-4, 1e-3]}"
    recipe = load(edited(bare, ("0.47, coating = 0.03", "0.5")))
    assert recipe.volume_fraction == recipe.coated_volume_fraction
    assert recipe.apparent_density == 2500
    assert recipe.box.periodic == (False, False, False)
    parameters = recipe.parameters()
    assert (parameters.f_r, parameters.f_s, parameters.f_v) == (1.0, 1.0, 1.0)
    assert (parameters.restitution, parameters.friction) == (1.0, 0.0)
    # Eq. 14, below its cap at a volume fraction of (1/2500) / (1/2500 + 1/1100) = 11/36.
    ratio = 1 / ((4 * math.pi / (3 * 11 / 36)) ** (1 / 3) - 1)
    assert recipe.f_w == near(389.153 * ratio**7.5593 + 1, rel=1e-12)
    assert recipe.f_w < 48.985


# Case 2 by hand: the volume fraction, and Eq. 15's ratio at it.
PHI = 0.8 / 7470 / (0.8 / 7470 + 0.2 / 950)
RATIO = 1 / ((4 * math.pi / (3 * PHI)) ** (1 / 3) - 1)
TUBE = (1 - 0.75857 * RATIO**5) / (
    1 - 2.105 * RATIO + 2.0865 * RATIO**3 - 1.7068 * RATIO**5 + 0.72603 * RATIO**6
)


@pytest.mark.parametrize(
    ("sheet", "f_w"),
    [
        ('"son2018"', 48.985),
        ("{closure = 'son2018', cap = 30}", 30.0),
        ("{closure = 'son2018', coefficient = 100, exponent = 2.0}", 48.985),
        ("{closure = 'son2018', coefficient = 50, exponent = 2.0}", 50 * RATIO**2 + 1),
        ('"son2018-smooth"', ((389.153 * RATIO**7.5593 + 1) ** -4 + 48.985**-4) ** -0.25),
        ('"haberman-sayre"', TUBE),
        ('"richardson-zaki"', (1 - PHI) ** -4.65),
        ("{closure = 'richardson-zaki', exponent = 4.48}", (1 - PHI) ** -4.48),
        ("17.5", 17.5),
        ("40", 40.0),
    ],
)
def test_f_w_by_name_table_or_number(load, sheet, f_w):
    recipe = load(edited(CASE2, ('f_w = "son2018"', f"f_w = {sheet}")))
    # Rounding; JAX evaluates the closures, in double precision here.
    assert recipe.f_w == near(f_w, rel=1e-12)
    assert recipe.parameters().f_w == near(f_w, rel=1e-12)


@pytest.mark.parametrize(
    ("sheet", "f_s"),
    [("1.25", 1.25), ("2", 2.0), ("[4e-6, 4e-6, 4e-6]", 1.0), ("[3, 2, 1]", 6**0.09)],
)
def test_f_s_by_number_or_dimensions(load, sheet, f_s):
    recipe = load(edited(CASE2, ("f_s = 1.10", f"f_s = {sheet}")))
    assert recipe.f_s == near(f_s, rel=1e-12)


def test_a_byte_order_mark_is_accepted(load):
    assert load(b"\xef\xbb\xbf" + CASE3.encode()) == mrjax.Recipe.load("case3")


def test_a_path_may_be_a_string(load, tmp_path):
    (tmp_path / "mine.toml").write_text(CASE2)
    assert mrjax.Recipe.load(str(tmp_path / "mine.toml")) == mrjax.Recipe.load("case2")


# Sheets that are refused ------------------------------------------------------------------------

SIZE = "size = [25e-6, 25e-6, 50e-6]"
PERIODIC = "periodic = [false, false, false]"

FAULTS = {
    # id: (old, new, [what the message must say: key, value, remedy])
    "fractions": ("particle = 0.784", "particle = 0.7", ["composition", "0.916", "sum to 1"]),
    "fraction in percent": (
        "particle = 0.784",
        "particle = 78.4",
        ["composition.particle = 78.4", "less than 1", "0 to 1"],
    ),
    "negative density": (
        "density = 7470.0",
        "density = -7470.0",
        ["particle.density = -7470.0", "greater than 0", "kg/m^3, above zero"],
    ),
    "zero diameter": (
        "diameter = 4e-6",
        "diameter = 0",
        ["particle.diameter = 0", "the diameter in m above zero"],
    ),
    "nan": ("density = 7470.0", "density = nan", ["particle.density = nan", "finite", "kg/m^3"]),
    "inf": ("viscosity = 0.01", "viscosity = inf", ["fluid.viscosity = inf", "finite", "Pa s"]),
    "string": (
        "viscosity = 0.01",
        'viscosity = "0.01"',
        ["fluid.viscosity = '0.01'", "must be a finite number", "Pa s"],
    ),
    "flag": ("viscosity = 0.01", "viscosity = true", ["fluid.viscosity = True", "finite number"]),
    "list": ("viscosity = 0.01", "viscosity = [1]", ["fluid.viscosity = [1]", "finite number"]),
    "huge integer": (
        "viscosity = 0.01",
        "viscosity = 1" + 400 * "0",
        ["fluid.viscosity = 1000", "...", "must be a finite number"],
    ),
    "Poisson's ratio": (
        "poisson_ratio = 0.31",
        "poisson_ratio = 0.6",
        ["particle.poisson_ratio = 0.6", "0.5", "-1 to 0.5"],
    ),
    "restitution": (
        "restitution = 0.5",
        "restitution = 1.5",
        ["contact.restitution = 1.5", "less than or equal to 1", "0.001 to 1"],
    ),
    "friction": ("friction = 0.3", "friction = -0.3", ["contact.friction = -0.3", "at least 0"]),
    "gravity": ("[particle]", "gravity = -9.81\n[particle]", ["gravity = -9.81", "at least zero"]),
    "f_v": ("f_v = 1.68", "f_v = 0", ["drag.f_v = 0", "above zero"]),
    "name": ('"case3"', "3", ["name = 3", "must be a string", "a name for the recipe"]),
    "unknown key": (
        "viscosity = 0.01",
        "viscosity = 0.01\nvicosity = 0.02",
        ["fluid.vicosity = 0.02", "unknown key", "did you mean viscosity?"],
    ),
    "unknown key, no hint": (
        "viscosity = 0.01",
        "viscosity = 0.01\nzzz = 0.02",
        ["fluid.zzz = 0.02", "unknown key", "density, viscosity"],
    ),
    "unknown key, top": (
        "[particle]",
        "gravty = 9.8\n[particle]",
        ["gravty = 9.8", "unknown key", "did you mean gravity?"],
    ),
    "unknown table": ("[drag]", "[dragg]", ["dragg = {", "unknown key", "did you mean drag?"]),
    "misspelt key": (
        "viscosity = 0.01",
        "viscosty = 0.01",
        ["fluid.viscosty = 0.01", "did you mean viscosity?"]),
    "misspelt table": (
        "[fluid]", "[fluids]", ["fluids = {", "did you mean fluid?"]),
    "key named int": (
        "[particle]", "int = 9\n[particle]", ["int = 9", "unknown key"]),
    "nested key named str": (
        "viscosity = 0.01",
        "viscosity = 0.01\nstr = 9",
        ["fluid.str = 9", "unknown key"]),
    "key with a bracket": (
        "[particle]", '"a[0]" = 9\n[particle]', ["'a[0]' = 9", "unknown key"]),
    "key with a line break": (
        "[particle]",
        '"a\\nb" = 9\n[particle]',
        ["'a\\nb' = 9", "unknown key"]),
    "missing key": (
        "viscosity = 0.01",
        "",
        ["fluid.viscosity is missing", "give the viscosity in Pa s"],
    ),
    "missing name": ('name = "case3"', "", ["name is missing", "give a name"]),
    "table as number": ("[drag]", "[[drag]]", ["drag = [{", "give a table [drag]"]),
    "a wall that pulls": (
        "[box]",
        "[wall]\nfriction = -0.1\n[box]",
        ["wall.friction = -0.1", "Coulomb's coefficient on the walls, at least 0"],
    ),
    "thick coating": (
        "radius_factor = 1.1 ",
        "radius_factor = 1.5 ",
        # 0.31284 * 1.5^3; (0.64 / 0.31284)^(1/3)
        ["coating.radius_factor = 1.5", "1.056", "close packing (0.64)", "less than 1.269"],
    ),
    "coating without weight": (
        "fluid = 0.200\ncoating = 0.016",
        "fluid = 0.216",
        ["composition.coating is missing", "1.1", "remove [coating]"],
    ),
    "density in g/cm^3": ("7470.0", "7.47", ["particle.density = 7.47", "kg/m^3"]),
    "modulus in GPa": ("211e9", "211", ["particle.elastic_modulus = 211.0", "Pa"]),
    "diameter in um": ("diameter = 4e-6", "diameter = 4", ["particle.diameter = 4.0", "4e-6"]),
    "misspelt closure": ('"son2018"', '"son-2018"', ["drag.f_w = 'son-2018'", "mean son2018?"]),
    "thin coating": (
        "radius_factor = 1.1 ",
        "radius_factor = 0.9 ",
        ["coating.radius_factor = 0.9", "at least 1"],
    ),
    "closure": (
        '"son2018"',
        '"son2081"',
        ["drag.f_w = 'son2081'", "no such closure", "son2018, son2018-smooth, haberman-sayre"],
    ),
    "closure in a table": (
        '"son2018"',
        "{closure = 'x', cap = 3}",
        ["drag.f_w = {'closure': 'x'", "no such closure", "richardson-zaki"],
    ),
    "table without closure": (
        '"son2018"',
        "{cap = 3}",
        ["drag.f_w = {'cap': 3}", "names no closure", "one of son2018"],
    ),
    "coefficient": (
        '"son2018"',
        "{closure = 'son2018', cup = 3}",
        ["drag.f_w.cup = 3", "no such coefficient", "coefficient, exponent, cap"],
    ),
    "volume fraction as coefficient": (
        '"son2018"',
        "{closure = 'son2018', volume_fraction = 0.1}",
        ["drag.f_w.volume_fraction = 0.1", "no such coefficient", "coefficient, exponent, cap"],
    ),
    "coefficient below zero": (
        '"son2018"',
        "{closure = 'son2018', cap = -3}",
        ["drag.f_w.cap = -3", "above zero"],
    ),
    "coefficient in words": (
        '"son2018"',
        "{closure = 'son2018', cap = 'three'}",
        ["drag.f_w.cap = 'three'", "must be a number above zero, finite"],
    ),
    "coefficient nan": (
        '"son2018"',
        "{closure = 'son2018', cap = nan}",
        ["drag.f_w", "nan", "number"],
    ),
    "f_w zero": ('"son2018"', "0", ["drag.f_w = 0", "above zero"]),
    "f_w nan": ('"son2018"', "nan", ["drag.f_w = nan", "finite", "a number above zero"]),
    "f_w list": ('"son2018"', "[1, 2]", ["drag.f_w = [1, 2]", "closure's name"]),
    "haberman-sayre": (
        '"son2018"',
        '"haberman-sayre"',
        # 4 pi / 3 / (1 + 1/0.8)^3 = 0.36773
        ["drag.f_w = 'haberman-sayre'", "0.3677", "0.4164", "another closure or a number"],
    ),
    "haberman-sayre in a table": (
        '"son2018"',
        "{closure = 'haberman-sayre'}",
        ["drag.f_w = 'haberman-sayre'", "0.3677", "0.4164", "another closure or a number"],
    ),
    "f_s zero": ("f_s = 1.10", "f_s = 0", ["drag.f_s = 0", "above zero"]),
    "f_s string": ("f_s = 1.10", 'f_s = "1"', ["drag.f_s = '1'", "[d_max, d_med, d_min]"]),
    "f_s of two": (
        "f_s = 1.10",
        "f_s = [2e-6, 1e-6]",
        ["drag.f_s = [2e-06, 1e-06]", "[d_max, d_med, d_min]"],
    ),
    "f_s out of order": (
        "f_s = 1.10",
        "f_s = [1e-6, 2e-6, 1e-6]",
        ["drag.f_s = [1e-06, 2e-06, 1e-06]", "largest first"],
    ),
    "f_s negative": ("f_s = 1.10", "f_s = [2e-6, 1e-6, -1e-6]", ["drag.f_s", "above zero"]),
    "f_s nan": ("f_s = 1.10", "f_s = [2e-6, nan, 1e-6]", ["drag.f_s", "nan", "d_med"]),
    "small box": (
        SIZE,
        "size = [4e-6, 25e-6, 50e-6]",
        ["box.size = [4e-06,", "along x", "4.4e-06 m", "larger box"],
    ),
    "box of two": (SIZE, "size = [25e-6, 25e-6]", ["box", "size = [2.5e-05, 2.5e-05]", "three"]),
    "box of zero": (SIZE, "size = [25e-6, 0, 5e-5]", ["box", "size = [2.5e-05, 0", "positive"]),
    "negative box": (SIZE, "size = [25e-6, -1.0, 5e-5]", ["box", "-1.0", "positive"]),
    "box nan": (SIZE, "size = [25e-6, nan, 5e-5]", ["box", "nan", "three positive lengths in m"]),
    "box of one number": (SIZE, "size = 25e-6", ["box", "size = 2.5e-05", "three positive"]),
    "box without size": (SIZE, "", ["box.size is missing", "three lengths in m"]),
    "box in digits": (SIZE, 'size = "123"', ["box", "three"]),
    "box in strings": (
        SIZE, 'size = ["1", "2", "3"]', ["box", "three"]),
    "box of flags": (
        SIZE, "size = [true, true, true]", ["box", "three"]),
    "unknown key of the box": (
        SIZE,
        SIZE + "\nperiodc = [true, true, true]",
        ["box.periodc = [True, True, True]", "unknown key", "size, periodic"],
    ),
    "two flags": (PERIODIC, "periodic = [true, false]", ["box", "= [True, False]", "x, y"]),
    "one flag": (
        PERIODIC,
        "periodic = true",
        ["box", "periodic = True", "three flags, true or false"],
    ),
    "flag in words": (PERIODIC, "periodic = 'yes'", ["box", "periodic = 'yes'", "true or false"]),
    "flag of two": (PERIODIC, "periodic = [2, 0, 0]", ["box", "[2, 0, 0]", "true or false"]),
    "flag as a number": (
        PERIODIC, "periodic = 3", ["box", "periodic = 3", "true or false"]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        pytest.param(
            *fault,
            id=name,
        )
        for name, fault in FAULTS.items()
    ],
)
def test_a_wrong_value_is_named_with_its_remedy(refusal, old, new, says):
    message = refusal(edited(CASE3, (old, new)))
    for words in says:
        assert words in message
    # The key comes first, so that it is found at a glance.
    assert message.startswith(says[0])


def test_a_denser_suspension_than_close_packing_is_refused_with_a_fraction_that_does(refusal, load):
    dense = edited(CASE2, ("particle = 0.80", "particle = 0.95"), ("fluid = 0.20", "fluid = 0.05"))
    message = refusal(dense)
    # 0.95/7470 / (0.95/7470 + 0.05/950); 0.64*7470 / (0.64*7470 + 0.36*950)
    for words in ("composition.particle = 0.95", "0.707", "close packing (0.64)", "than 0.933"):
        assert words in message
    load(edited(dense, ("particle = 0.95", "particle = 0.932"), ("fluid = 0.05", "fluid = 0.068")))


def test_the_fraction_offered_does_with_a_coating_as_dense_as_the_particles(refusal, load):
    dense = edited(
        CASE3,
        ("density = 800.0", "density = 7000.0"),
        ("radius_factor = 1.1 ", "radius_factor = 1.0 "),
        ("particle = 0.784", "particle = 0.92"),
        ("fluid = 0.200", "fluid = 0.04"),
        ("coating = 0.016", "coating = 0.04"),
    )
    message = refusal(dense)
    most = float(message.rsplit(" ", 1)[1])
    share = (1 - most + 0.001) / 2
    load(
        edited(
            dense,
            ("particle = 0.92", f"particle = {most - 0.001}"),
            ("fluid = 0.04", f"fluid = {share}"),
            ("coating = 0.04", f"coating = {share}"),
        )
    )


def test_the_coating_offered_does(load):
    load(edited(CASE3, ("radius_factor = 1.1 ", "radius_factor = 1.268 ")))


def test_weight_of_a_coating_without_its_table_is_refused(refusal):
    message = refusal(edited(CASE2, ("fluid = 0.20", "fluid = 0.19\ncoating = 0.01")))
    for words in ("composition.coating = 0.01", "[coating]", "add one", "to 0"):
        assert words in message


def test_particles_as_dense_as_the_fluid_are_refused(refusal):
    message = refusal(
        edited(
            CASE2,
            ("density = 7470.0", "density = 950.0"),
            ("particle = 0.80", "particle = 0.3"),
            ("fluid = 0.20", "fluid = 0.7"),
        )
    )
    for words in ("fluid.density = 950.0", "950 kg/m^3", "neither sink nor rise"):
        assert words in message


def test_a_box_for_less_than_one_particle_is_refused_where_particles_are_run(load):
    # 0.01/7470 / (0.01/7470 + 0.99/950) = 0.00128 of 5^3 um^3 against 33.5 um^3.
    recipe = load(
        edited(
            CASE2,
            ("particle = 0.80", "particle = 0.01"),
            ("fluid = 0.20", "fluid = 0.99"),
            (SIZE, "size = [5e-6, 5e-6, 5e-6]"),
        )
    )
    with pytest.raises(mrjax.InputError) as refusal:
        mrjax.disperse(recipe)
    for words in ("box.size = [5e-06, 5e-06, 5e-06]", "0.00128", "less than one", "larger box"):
        assert words in str(refusal.value)


def test_a_box_may_be_missing_and_another_table_is_named(refusal, load):
    assert load(CASE3[: CASE3.index("[box]")]).particle_count == 300
    message = refusal(edited(CASE3, ("[fluid] ", "[wall] "), ("density = 950.0", ""),
                             ("viscosity = 0.01", "")))  # fmt: skip
    assert message.startswith("fluid is missing")
    assert "give a table [fluid]" in message


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", ["name is missing", "give a name"]),
        ("name = \n", ["is not TOML", "line 1", "mend that line"]),
        (CASE3 + "\n[box]\n", ["is not TOML", "box", "line", "twice"]),
        ('name = "a"\nparticle = 5\n', ["particle = 5", "[particle]"]),
        (b"name = '\xe9'", ["is not UTF-8", "save the recipe as UTF-8 TOML"]),
        (CASE3.encode("utf-16"), ["is not UTF-8", "save the recipe as UTF-8 TOML"]),
    ],
    ids=["empty", "broken", "twice", "number for a table", "latin-1", "utf-16"],
)
def test_a_file_that_is_no_sheet_is_refused(refusal, content, says):
    message = refusal(content)
    for words in says:
        assert words in message


def test_a_missing_file_is_refused_with_the_names_that_exist(tmp_path):
    for source in ("case4", tmp_path / "none.toml"):
        with pytest.raises(mrjax.InputError) as error:
            mrjax.Recipe.load(source)
        message = str(error.value)
        assert message.startswith(f"{source}: no such file")
        assert "case1, case2, case3" in message
        assert "\n" not in message


def test_a_directory_is_refused(tmp_path):
    with pytest.raises(mrjax.InputError) as error:
        mrjax.Recipe.load(tmp_path)
    message = str(error.value)
    assert message.startswith(f"{tmp_path}: is a directory")
    assert "give a TOML file in it" in message
    assert "\n" not in message


def test_a_path_that_cannot_be_opened_is_refused():
    with pytest.raises(mrjax.InputError, match=r"cannot be read .*; check the path"):
        mrjax.Recipe.load(300 * "x")
    for source in ("a\0b", "a\nb", "\udcff.toml"):  # the last: bytes that are no text
        with pytest.raises(mrjax.InputError, match=r"^'.*': is no file name; give a recipe's name"):
            mrjax.Recipe.load(source)


# Made in Python ---------------------------------------------------------------------------------


def test_a_recipe_made_in_python_is_refused_like_a_file():
    tables = tomllib.loads(CASE3)
    assert mrjax.Recipe(**tables) == mrjax.Recipe.load("case3")
    for key, value, message in (
        ("gravity", -1.0, "gravity = -1.0: must be greater than or equal to 0; give g in m/s^2, "),
        ("gravty", 1.0, "gravty = 1.0: unknown key; did you mean gravity?"),
        ("box", {"size": [1e-5, 1e-5]}, "box.size = [1e-05, 1e-05] must be three positive lengths"),
        ("fluid", {"density": 950.0}, "fluid.viscosity is missing; give the viscosity in Pa s"),
        ("self", 1.0, "self = 1.0: unknown key"),
        ("name", "two\nlines", "name = 'two\\nlines': must be one line of text"),
    ):
        with pytest.raises(mrjax.InputError) as refusal:
            mrjax.Recipe(**tables | {key: value})
        assert str(refusal.value).startswith(message)
    with pytest.raises(mrjax.InputError, match=r"^name is missing; give a name for the recipe$"):
        mrjax.Recipe()


def test_what_is_replaced_is_checked_and_the_rest_stays(case3):
    other = case3.replace(gravity=1.62, fluid={"viscosity": 0.1}, box={"periodic": (True,) * 3})
    assert (other.gravity, other.fluid.viscosity, other.fluid.density) == (1.62, 0.1, 950.0)
    assert other.box == mrjax.Box(case3.box.size, (True,) * 3)
    assert other.coating == case3.coating and case3.gravity == 9.81
    assert case3.replace() == case3
    bare = case3.replace(coating=None, composition={"particle": 0.8, "coating": 0.0})
    assert bare.coating is None and bare.radius_factor == 1.0
    again = bare.replace(
        coating=dict(vars(case3.coating)), composition={"particle": 0.784, "coating": 0.016}
    )
    assert again == case3
    with pytest.raises(mrjax.InputError, match=r"^fluid.viscosity = -1: must be greater than"):
        case3.replace(fluid={"viscosity": -1})
    with pytest.raises(mrjax.InputError, match=r"^viscosity = 1: unknown key"):
        case3.replace(viscosity=1)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "viscosity = 0.01",
            "viscosity = 1e-300",
            "fluid.viscosity = 1e-300: must be greater than",
        ),
        (
            "density = 950.0",
            "density = 1e300",
            "fluid.density = 1e+300: must be less than or equal",
        ),
        ("friction = 0.3", "friction = 1e-300", "contact.friction = 1e-300: must be 0, or between"),
        ("4e-6", "1e-300", "particle.diameter = 1e-300: must be the diameter in m between"),
        ("4e-6", "4e-12", "particle.diameter = 4e-12: smaller than an atom; give m: 4 um is 4e-6"),
        ("4e-6", "[4e-6, 4e-12]", "particle.diameter.values = 4e-12: smaller than an atom"),
        ("4e-6", "[4e-6, 1e300]", "particle.diameter.values = [4e-06, 1e+300]: must be a list"),
        (
            "25e-6, 25e-6",
            "1e300, 25e-6",
            "box.size = [1e+300, 2.5e-05, 5e-05] must be three positive lengths in m, from 1e-30",
        ),
        ("25e-6, 25e-6", "1" + "0" * 400 + ", 25e-6", "box.size = [1000000"),
        ('"son2018"', '{closure = "richardson-zaki", exponent = 1e3}', "drag.f_w = {'closure': "),
        ("f_s = 1.10", "f_s = [1e30, 1e30, 1e-30]", "drag.f_s = [1e+30, 1e+30, 1e-30]: a factor"),
        ("viscosity = 0.01", "viscosity = " + "9" * 5000, ": cannot be read (Exceeds the limit"),
        ("viscosity = 0.01", "viscosity = " + "[" * 5000, ": tables are nested more than 16 deep"),
    ],
)
def test_numbers_of_no_suspension_are_refused(old, new, says, load):
    with pytest.raises(mrjax.InputError) as refusal:
        load(edited(CASE3, (old, new)))
    message = str(refusal.value)
    assert says in message and len(message) < 400 and message.isprintable()


def test_a_file_too_large_for_a_sheet_is_not_read(load):
    with pytest.raises(mrjax.InputError, match=r"sheet.toml: is larger than 1 MB"):
        load("#" * 1_000_001)
