"""What is given is accepted, with finite numbers in all that follows, or refused in one clear line.

Files that are right are changed at random, as text and as tables, and so are command lines. The
inputs are the same in every run; some hundreds of them, and ten thousand in the slow run.
"""

import math
import sys
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import calibrate.__main__
import calibrate.calibration
import mrjax.__main__
from calibrate import Experiment
from mrjax import InputError, Recipe
from mrjax.cli import environment, exit_status
from mrjax.paper import runs
from mrjax.recipe import contacts
from mrjax.simulation import derived, processes

FEW, MANY = 60, 1300
"""Inputs of each of eight kinds, in a quick and in a slow run."""
LONGEST_MESSAGE = 400
"""Characters, the path of the file included."""

sizes = pytest.mark.parametrize("inputs", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])


def holds(inputs: int, strategy: st.SearchStrategy, check) -> None:
    """Checks as many inputs, the same in every run."""
    checked = settings(
        max_examples=inputs,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )(given(strategy)(lambda given: check(given)))
    checked()


def accepted(call):
    """What a reader gives, or None where it refuses in one line."""
    try:
        return call()
    except InputError as refusal:
        message = str(refusal)
        assert message.isprintable() and 0 < len(message) <= LONGEST_MESSAGE, message
        return None


# Files that are right ---------------------------------------------------------------------------

BUNDLED = resources.files("mrjax.recipe.bundled")
TEMPLATE = resources.files("mrjax.recipe").joinpath("template.toml").read_text()
ALTERNATIVES = ("diameter = [", "diameter = {m", "diameter = {d", "volume_f", "conc", "solids_r")
"""Options of the template that exclude others."""
FEWEST = """
name = "chalk"
temperature = 298.15
particle = {density = 2150.0, material = "mineral", diameter = {d10 = 5e-6, d50 = 2e-5, d90 = 5e-5}}
fluid = {liquid = "water"}
composition = {concentration = 89.0}
"""
CASES = [
    *(BUNDLED.joinpath(f"case{i}.toml").read_text() for i in (1, 2, 3)),
    TEMPLATE,
    FEWEST,
    "\n".join(
        line.replace("#? ", "").replace("particle = 0.80", "particle = 0.784")
        for line in TEMPLATE.splitlines()
        if not line.removeprefix("#? ").startswith(ALTERNATIVES)
        if not line.startswith("diameter")
    ),
]
EXPERIMENT = """
name = "mine"
[[sample]]
name = "A"
recipe = "case2"
height = 0.1
bed_fraction = 0.55
initial_velocity = {value = 8.0, standard_deviation = 0.1, unit = "mm/day"}
curve = {file = "curve.csv", time_unit = "day", unit = "mm", standard_deviation = 1.0}
[[sample]]
name = "B"
recipe = "mine.toml"
final_ratio = {value = 78.0, standard_deviation = 1.0, unit = "%"}
viscosity_ratio = {value = 1.68, standard_deviation = 0.05}
[[parameter]]
name = "f_s"
median = 1.1
log_standard_deviation = 0.05
[[parameter]]
name = "f_w.cap"
samples = ["A"]
median = 50.0
bounds = [1.0, 100.0]
standard_deviation = 20.0
[[parameter]]
name = "f_v"
per_sample = true
median = 1.5
[[parameter]]
name = "bed_fraction"
samples = ["B"]
value = 0.6
"""
EXPERIMENTS = [
    EXPERIMENT,
    resources.files("calibrate.experiment.bundled").joinpath("fang2005.toml").read_text(),
]
CURVE = "time,mudline,standard_deviation\n" + "".join(
    f"{day},{100 - 5 * day},{0.5 + 0.1 * day}\n" for day in range(12)
)

# What is done to them ---------------------------------------------------------------------------

NUMBERS = [
    *("0", "-1", "1", "1e300", "-1e300", "1e-300", "nan", "inf", "-inf", "1e400", "0.5", "1e-6"),
    *("1e30", "1e-30", "9" * 400, "0x" + "f" * 4000, "9" * 5000, "-0.0", "1_000", "1e15", "64"),
]
WORDS = [
    *('"text"', '""', "true", "[]", "{}", "[1.0, 2.0, 3.0]", "[[[]]]", "1979-05-27T07:32:00Z"),
    *('"a\\nb"', '"\\u0000"', '"son2018"', '"haberman-sayre"', '"case1"', '"particles"', "µm"),
    *('{closure = "richardson-zaki", exponent = 1e6}', '{closure = "son2018", cap = 1e-20}'),
    *("[" + "1e-6, " * 3000 + "]", '"' + "x" * 5000 + '"', "[" * 2000, "{a=" * 2000, "#", "="),
    *(
        '"<script>alert(1)</script>"',
        '"$\\\\frac$"',
        '"\\u202e\\u001b[31m"',
        '{"\\u001b[2J" = 1}',
        '"|`*_"',
    ),
    *("{median = 4e-6, geometric_standard_deviation = 3.0}", "[4e-6, 1e-9]", "'", '"', "\\"),
]
LINES = [
    *("[particle]", "[box]", "[[sample]]", "[a." + "b." * 3000 + "c]", "key = 1", "[wall]"),
    *("gravity = 0", "local = true", "periodic = [true, true, true]", "x" * 5000 + " = 1", "\t"),
    *("[a" + ".b" * 20 + "]", ".".join("a" * 400) + " = 1", "[[x]]\n" * 3000, "," * 3000),
    *("[coating]", "=", "]", "time,mudline", "1,2,3", ",,,", '"', "# é", "name = 1", "1e308,1,1"),
]
CHANGES = ["delete", "double", "swap", "insert", "value", "value", "value", "part"]
BYTES = [b"\xff", b"\x00", b"\xef\xbb\xbf", b"\r\n", b"\r", b"\xe2\x80\xa8", b"\x1b[31m", b"\xc3"]


@st.composite
def changed_text(draw, texts: list[str]) -> bytes:
    """One of the texts with one to four changes, as bytes."""
    lines = draw(st.sampled_from(texts)).splitlines()
    for _ in range(draw(st.integers(1, 4))):
        if not lines:
            break
        place = draw(st.integers(0, len(lines) - 1))
        other = draw(st.integers(0, len(lines) - 1))
        line = lines[place]
        match draw(st.sampled_from(CHANGES)):
            case "delete":
                del lines[place]
            case "double":
                lines.insert(other, line)
            case "swap":
                lines[place], lines[other] = lines[other], line
            case "insert":
                lines.insert(place, draw(st.sampled_from(LINES) | st.text(max_size=20)))
            case "value":
                new = draw(st.sampled_from(NUMBERS + WORDS) | st.floats().map(repr))
                cells = line.replace("=", ",").split(",")
                cell = draw(st.sampled_from(cells))
                key, equals, _ = line.partition("=")
                whole = bool(equals) and draw(st.booleans())
                lines[place] = f"{key}= {new}" if whole else line.replace(cell, new, 1)
            case "part":
                cut = draw(st.integers(0, len(line)))
                lines[place] = line[:cut] + draw(st.text(max_size=3))
    content = draw(st.sampled_from(["\n", "\n", "\n", "\r\n"])).join(lines).encode()
    if draw(st.integers(0, 9)) == 0:
        cut = draw(st.integers(0, len(content)))
        content = content[:cut] + draw(st.sampled_from(BYTES) | st.binary(max_size=4))
        content += b"" if draw(st.booleans()) else b"\nname = 'again'"
    return content


def finite(recipe: Recipe) -> None:
    """Fails where anything that follows from the recipe is not a finite number."""
    unknown = ("elastic_modulus", "poisson_ratio") if contacts.missing(recipe) else ()
    stated = {name: leaf for name, leaf in vars(recipe.parameters()).items() if leaf is not None}
    for name, leaf in stated.items():
        assert np.isfinite(leaf).all() or name.removeprefix("wall_") in unknown, name
    for one in accepted(lambda: derived.derived(recipe)) or []:
        assert math.isfinite(one.value), one
    for line in [*derived.notes(recipe), *derived.warnings(recipe)]:
        assert "\n" not in line


# Files ------------------------------------------------------------------------------------------


@sizes
def test_recipe_files(inputs, tmp_path):
    path = tmp_path / "sheet.toml"

    def check(content: bytes) -> None:
        path.write_bytes(content)
        if recipe := accepted(lambda: Recipe.load(path)):
            finite(recipe)

    holds(inputs, changed_text(CASES), check)


@sizes
def test_experiment_files(inputs, tmp_path):
    path = tmp_path / "experiment.toml"
    (tmp_path / "mine.toml").write_text(CASES[0])
    (tmp_path / "curve.csv").write_text(CURVE)

    def check(content: bytes) -> None:
        path.write_bytes(content)
        experiment = accepted(lambda: Experiment.load(path))
        if experiment is None:
            return
        for one in experiment.parameters:
            x = experiment.start[one.variable]
            assert 0 < x < math.inf
            assert math.isfinite(one.value(x)) and 0 < one.per_log(x) < math.inf
            assert one.prior is None or 0 < one.prior.log_standard_deviation < math.inf
        for sample in experiment.samples:
            assert 0 < sample.height < math.inf and np.isfinite(sample.times).all()
            for one in sample.measurements:
                assert math.isfinite(one.value * one.si)
                assert 0 < one.standard_deviation * one.si < math.inf

    holds(inputs, changed_text(EXPERIMENTS), check)


@sizes
def test_curve_files(inputs, tmp_path):
    (tmp_path / "mine.toml").write_text(CASES[0])
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)

    def check(content: bytes) -> None:
        (tmp_path / "curve.csv").write_bytes(content)
        experiment = accepted(lambda: Experiment.load(tmp_path / "experiment.toml"))
        if experiment is None:
            return
        times = np.array(experiment.samples[0].times)
        assert np.isfinite(times).all() and (np.diff(times) > 0).all() and times.size >= 2
        for one in experiment.samples[0].measurements:
            assert 0 <= one.value * one.si < math.inf
            assert 0 < one.standard_deviation * one.si < math.inf

    holds(inputs, changed_text([CURVE, CURVE.replace("mudline", "sedimentation_ratio")]), check)


@pytest.mark.parametrize("reader", [Recipe.load, Experiment.load])
def test_what_is_no_file_of_text(reader, tmp_path):
    (tmp_path / "empty.toml").touch()
    (tmp_path / "large.toml").write_bytes(b"# " + b"x" * 10**6)
    (tmp_path / "folder").mkdir()
    for source in (
        *("", " ", "\0", "\udcff", "a\nb", "/", ".", "/dev/null", "/dev/zero", "x" * 300),
        *(tmp_path, tmp_path / "folder", tmp_path / "empty.toml", tmp_path / "large.toml"),
        *("/dev/tty", "/proc/self/mem", "é" * 300, "x/" * 3000, tmp_path / "x" / "\x1b[31m"),
        *(None, 3, b"case1", ["case1"], math.nan),
    ):
        assert accepted(lambda source=source: reader(source)) is None


# Tables made in Python --------------------------------------------------------------------------

THINGS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.binary(max_size=5),
    st.sampled_from([10**400, -(10**400), 1e300, 1e-300, 1j, np.float64(1.0), np.nan, object()]),
    st.sampled_from([np.array([1e-6, 2e-6]), np.zeros((2, 2)), range(3), {1: 2}, set(), Recipe]),
    st.lists(st.floats() | st.booleans(), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
    st.sampled_from(["son2018", "haberman-sayre", "case1", {"closure": "son2018"}]),
)


@st.composite
def changed_tables(draw) -> dict:
    """The tables of a recipe with one to three changes."""
    tables = tomllib.loads(draw(st.sampled_from(CASES)))
    for _ in range(draw(st.integers(1, 3))):
        owner = draw(st.sampled_from([tables, *(t for t in tables.values() if type(t) is dict)]))
        key = draw(st.sampled_from([*owner, "new", "self"]) if owner else st.just("new"))
        if draw(st.integers(0, 4)):
            owner[key] = draw(THINGS)
        else:
            owner.pop(key, None)
    return tables


@sizes
def test_recipes_made_in_python(inputs):
    def check(tables: dict) -> None:
        if recipe := accepted(lambda: Recipe(**tables)):
            finite(recipe)

    holds(inputs, changed_tables(), check)


@sizes
def test_recipes_with_some_of_them_replaced(inputs):
    case3 = Recipe.load("case3")

    def check(changes: dict) -> None:
        if recipe := accepted(lambda: case3.replace(**changes)):
            finite(recipe)

    keys = st.sampled_from(["name", "fluid", "coating", "wall", "drag", "box", "gravity", "no"])
    inner = st.dictionaries(st.sampled_from(["density", "f_w", "size", "friction"]), THINGS)
    holds(inputs, st.dictionaries(keys, THINGS | inner, max_size=3), check)


def between(least: float, most: float) -> st.SearchStrategy[float]:
    """Numbers of all sizes between two, the ends among them."""
    return st.sampled_from([least, most]) | st.floats(math.log10(least), math.log10(most)).map(
        lambda power: 10.0**power
    )


@st.composite
def strange_tables(draw) -> dict:
    """A suspension that nobody has seen, each of its numbers within what a sheet may say."""
    diameter = draw(between(1e-10, 0.1))
    density = draw(between(20.0, 1e5))
    fluid = max(10.0, density * draw(st.sampled_from([1e-3, 0.5, 1.0 - 1e-15])))
    rest = st.sampled_from([0.0, 0.0, 1e-30, 1e-9, 1.0, 1e3])
    sphere = {
        "density": density,
        "elastic_modulus": draw(between(1e3, 1e15)),
        "poisson_ratio": draw(st.sampled_from([-1.0 + 1e-15, -0.5, 0.0, 0.31, 0.5])),
    }
    heavy = draw(st.sampled_from([1e-9, 1e-6, 0.01, 0.5, 0.6]))
    closure = draw(st.sampled_from([None, None, "son2018", "richardson-zaki"]))
    edge = diameter * max(3.0, (10.0 / heavy) ** (1 / 3)) * draw(st.sampled_from([1.0, 10.0]))
    return {
        "name": "strange",
        "gravity": draw(between(1e-30, 1e9) | st.just(0.0)),
        "particle": {**sphere, "diameter": diameter},
        "fluid": {"density": fluid, "viscosity": draw(between(1e-9, 1e15))},
        "composition": {"particle": heavy, "fluid": 1.0 - heavy},
        "drag": {
            "f_w": closure or draw(between(1e-6, 1e9)),
            "f_s": draw(between(1e-6, 1e9)),
            "f_v": draw(between(1e-6, 1e9)),
            "local": closure is not None and draw(st.booleans()),
            "added_mass": draw(rest),
        },
        "contact": {
            "friction": draw(rest),
            "restitution": draw(st.sampled_from([1e-3, 0.5, 1.0])),
            "dissipation": draw(rest),
            "tangential_dissipation": draw(rest),
            "rolling_friction": draw(rest),
            "rolling_damping": draw(rest),
        },
        "box": {"size": [edge, edge, edge * draw(st.sampled_from([1.0, 100.0]))]},
    }


@sizes
def test_suspensions_that_nobody_has_seen(inputs):
    def check(tables: dict) -> None:
        if recipe := accepted(lambda: Recipe(**tables)):
            finite(recipe)

    holds(inputs, strange_tables(), check)


# Command lines ----------------------------------------------------------------------------------


class ReachedError(Exception):
    """The command line was understood; what it asks for would begin."""


@pytest.fixture
def nothing_is_computed(monkeypatch, tmp_path):
    """Commands end where their work would begin, in an empty folder with a sheet of each kind."""

    def reached(*_, **__):
        raise ReachedError

    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(CASES[0])
    Path("file").touch()
    monkeypatch.setattr(environment, "start_jax", lambda *_, **__: None)
    monkeypatch.setattr(mrjax, "disperse", reached)
    monkeypatch.setattr(processes, "join", reached)
    monkeypatch.setattr(runs, "simulated", reached)
    monkeypatch.setattr(calibrate.calibration, "fit_experiment", reached)
    monkeypatch.setattr(calibrate.comparison.compare, "fit_experiment", reached)


TOLD = st.sampled_from(
    [
        *("simulate", "check", "reproduce", "new", "case1", "case2", "case4", "mine.toml", "file"),
        *("--out", "--seed", "--frames", "--dtype", "--duration", "--time-step", "--ensemble"),
        *("--overlap", "--distributed", "--quiet", "--json", "--help", "--version", "--model"),
        *("--starts", "--robust", "--posterior", "--leave-one-out", "--predict", "--like", "-x"),
        "--compare",
        *("--begin-with", "fang2005", "synthetic", "closed-form", "column", "A", "B", "float32"),
        *("0", "1", "-1", "nan", "inf", "1e300", "1e-300", "0.02", "64", "", "--", "-", "--out="),
        *("here:1,2,0", "here:99999,2,1", "auto", "a\nb", "\0", "\udcff", "é", "9" * 5000, "."),
    ]
) | st.text(st.characters(exclude_characters="/.~", exclude_categories=["Cs"]), max_size=6)
BEGUN = {
    "mrjax": [["simulate", "case2"], ["check", "case2"], ["reproduce"], ["new", "new.toml"], []],
    "mrjax-calibrate": [["fang2005"], ["fang2005", "--model", "closed-form"], []],
}


@pytest.mark.parametrize("name", BEGUN)
@sizes
def test_command_lines(inputs, name, nothing_is_computed, monkeypatch, capsys):
    command = {"mrjax": mrjax.__main__.cli, "mrjax-calibrate": calibrate.__main__.cli}[name]

    def check(words: list[str]) -> None:
        monkeypatch.setattr(sys, "argv", [name, *words])
        try:
            exit_status.run(command, name)
        except ReachedError:
            return
        except SystemExit as end:
            out, err = capsys.readouterr()
            if end.code in (2, 3):
                assert out == "" and err.startswith(f"{name}: ") and err.count("\n") == 1, err
                assert len(err) <= LONGEST_MESSAGE + len(f"{name}: \n")
                assert err[:-1].isprintable()
            else:
                assert not end.code and "Traceback" not in err

    begun = st.sampled_from(BEGUN[name])
    holds(inputs, st.builds(lambda a, b: [*a, *b], begun, st.lists(TOLD, max_size=5)), check)
