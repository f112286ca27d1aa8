"""Readings that cannot be true of their tube are refused at load; what is odd is told."""

from importlib import resources

import pytest

import mrjax
from calibrate import Experiment, Problem
from calibrate.problem.solve import fit_experiment

SAMPLE = """
[[sample]]
name = "{name}"
recipe = "{recipe}"
height = 0.1
bed_fraction = 0.5
curve = {{file = "{file}.csv", time_unit = "day", unit = "{unit}", standard_deviation = {error}}}
"""
PARAMETER = '[[parameter]]\nname = "f_w"\nmedian = 50.0\n'
FALLING = "0,100\n1,92\n2,84\n4,70\n"


def load(folder, lines, unit="mm", error="1.0", column="mudline", recipe="case2") -> Experiment:
    (folder / "a.csv").write_text(f"time,{column}\n{lines}")
    sample = SAMPLE.format(name="A", file="a", unit=unit, error=error, recipe=recipe)
    (folder / "one.toml").write_text(f'name = "one"\n{sample}{PARAMETER}')
    return Experiment.load(folder / "one.toml")


@pytest.mark.parametrize(
    "lines, options, words",
    [
        ("0,0\n1,0\n2,0\n", {}, ["mudline = 0 mm at 0 day", "of the height", "clear layer"]),
        ("0,50\n1,55\n2,60\n", {}, ["mudline = 50 mm at 0 day is 0.5 of the height", "height"]),
        (
            "0,1000\n1,950\n",
            {},
            ["mudline = 1000 mm", "above height = 0.1 m", "its unit or height"],
        ),
        (FALLING, {"unit": "m"}, ["mudline = 100 m", "above height"]),
        (FALLING, {"unit": "um"}, ["mudline = 100 um", "0.001 of the height"]),
        (FALLING + "5,120\n", {}, ["mudline = 120 mm at 5 day", "above height"]),
        (FALLING + "5,90\n", {}, ["mudline = 90 mm at 5 day", "above mudline = 70 mm at 4 day"]),
        ("1,92\n2,80\n3,10\n", {}, ["mudline = 10 mm at 3 day", "the particles alone", "0.337"]),
        (
            "0,95\n1,90\n",
            {"unit": "1", "column": "sedimentation_ratio"},
            ["sedimentation_ratio = 95 at 0 day", "above 1"],
        ),
        (
            "0,60\n1,59\n",
            {"unit": "%", "column": "sedimentation_ratio"},
            ["sedimentation_ratio = 60 % at 0 day is 0.6 of the height"],
        ),
    ],
)
def test_readings_that_cannot_be_true_are_refused(tmp_path, lines, options, words):
    with pytest.raises(mrjax.InputError) as refusal:
        load(tmp_path, lines, **options)
    message = str(refusal.value)
    assert message.startswith(f"{tmp_path / 'one.toml'}: sample 'A': ") and "\n" not in message
    assert len(message) < 400 + len(str(tmp_path))
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    "lines, options",
    [
        (FALLING, {}),
        ("1,92\n2,84\n", {}),  # no reading at time 0
        ("0,102\n1,99\n2,101.5\n3,92\n", {}),  # above the height, and up, within their errors
        ("0,100\n1,100\n2,100\n", {}),
        ("0,98\n1,97\n", {"error": "0.7"}),
        ("0,1\n1,0.9\n", {"unit": "1", "column": "sedimentation_ratio", "error": "0.01"}),
    ],
)
def test_readings_that_may_be_true_are_taken(tmp_path, lines, options):
    assert load(tmp_path, lines, **options).warnings == ()


def test_what_may_be_right_all_the_same_is_a_warning(tmp_path):
    early = load(tmp_path, "0,99\n1,92\n", error="0.1")
    assert [one.split(" is ")[0] for one in early.warnings] == [
        "sample 'A': a.csv, line 2: mudline = 99 mm at 0 day"
    ]


@pytest.mark.parametrize(
    "lines, warned",
    [
        ("09:00,100\n10:00,98\n12:00,90\n", True),
        ("00:00,100\n10:00,98\n12:00,90\n", False),
        ("00:30,100\n10:00,98\n12:00,90\n", False),
        ("09:00,92\n10:00,90\n12:00,88\n", False),
    ],
)
def test_times_that_are_rather_those_of_the_day_are_a_warning(tmp_path, lines, warned):
    warnings = load(tmp_path, lines).warnings
    assert len(warnings) == warned
    if warned:
        assert "a.csv, line 2: mudline = 100 mm at 0.375 day" in warnings[0]
        assert "state start" in warnings[0]


def test_a_small_rise_beyond_its_errors_is_refused(tmp_path):
    bump = "0,100\n1,92\n2,93\n3,80\n"
    words = r"a.csv, line 4: mudline = 93 mm at 2 day is above mudline = 92 mm at 1 day"
    with pytest.raises(mrjax.InputError, match=words):
        load(tmp_path, bump, error="0.1")
    assert load(tmp_path, bump, error="0.2").warnings == ()


@pytest.mark.parametrize(
    "lines, refused",
    [
        ("0,100\n1,92\n2,93.9\n3,80\n", ""),
        ("0,100\n1,92\n2,94.1\n3,80\n", r"line 4: mudline = 94\.1 mm"),
        ("0,101.9\n1,92\n2,85\n3,80\n", ""),
        ("0,102.1\n1,92\n2,85\n3,80\n", r"line 2: mudline = 102\.1 mm"),
        ("0,98.1\n1,92\n2,85\n3,80\n", ""),
        ("0,97.9\n1,92\n2,85\n3,80\n", r"line 2: mudline = 97\.9 mm"),
    ],
)
def test_without_stated_errors_2_percent_of_the_height_are_allowed(tmp_path, lines, refused):
    (tmp_path / "a.csv").write_text(f"time,mudline\n{lines}")
    sample = SAMPLE.format(name="A", file="a", unit="mm", error=1.0, recipe="case2")
    sample = sample.replace(", standard_deviation = 1.0", "")
    (tmp_path / "one.toml").write_text(f'name = "one"\n{sample}{PARAMETER}')
    if refused:
        with pytest.raises(mrjax.InputError, match=refused):
            Experiment.load(tmp_path / "one.toml")
    else:
        experiment = Experiment.load(tmp_path / "one.toml")
        assert experiment.data_as_understood["A"].errors == "estimated"
        assert 0.1 <= experiment.samples[0].measurements[0].standard_deviation < 10.0


def test_a_volume_above_the_height_may_be_that_of_another_tube(tmp_path):
    with pytest.raises(mrjax.InputError, match=r"1000 mL at 0 day is above .* tube_diameter or"):
        (tmp_path / "a.csv").write_text("time,mudline\n0,1000\n1,900\n")
        sample = SAMPLE.format(name="A", file="a", unit="mL", error=1.0, recipe="case2")
        sample = sample.replace("height =", "tube_diameter = 0.05\nheight =")
        (tmp_path / "one.toml").write_text(f'name = "one"\n{sample}{PARAMETER}')
        Experiment.load(tmp_path / "one.toml")


def test_samples_may_share_a_file_of_which_each_has_its_column(tmp_path):
    (tmp_path / "a.csv").write_text("time,A,B\n0,100,100\n1,92,91\n")

    def both(second):
        samples = [
            SAMPLE.format(name=name, file="a", unit="mm", error=1.0, recipe="case2").replace(
                '"a.csv"', f'"a.csv", columns = {{time = "time", mudline = "{column}"}}'
            )
            for name, column in (("A", "A"), ("B", second))
        ]
        (tmp_path / "two.toml").write_text(f'name = "two"\n{"".join(samples)}{PARAMETER}')
        return Experiment.load(tmp_path / "two.toml")

    values = [[one.value for one in sample.measurements] for sample in both("B").samples]
    assert values == [[100.0, 92.0], [100.0, 91.0]]
    with pytest.raises(mrjax.InputError, match="count twice"):
        both("A")


def test_repeats_share_the_times_of_a_sample(tmp_path):
    sample = load(tmp_path, "0,100\n1,92\n1,93\n2,84\n").samples[0]
    times = [sample.times[one.place] for one in sample.measurements]
    assert times == [0.0, 86400.0, 86400.0, 172800.0]
    assert [one.row for one in sample.measurements] == [2, 3, 4, 5]


def test_a_mudline_of_what_rises_may_begin_at_the_floor():
    """Shells so light that the coated particle floats: nothing of them is refused."""
    recipe = mrjax.Recipe.load("case3")
    from calibrate.experiment import plausibility

    assert plausibility.sinks(recipe)
    light = recipe.coating.model_copy(update={"density": 10.0, "radius_factor": 3.0})
    assert not plausibility.sinks(recipe.model_copy(update={"coating": light}))


@pytest.mark.parametrize("value, unit", [(8.0, "mm/s"), (8.0e-6, "mm/day")])
def test_a_velocity_out_of_all_proportion_is_a_warning(tmp_path, value, unit):
    path = tmp_path / "fast.toml"
    path.write_text(
        f"""
        name = "fast"
        [[sample]]
        name = "A"
        recipe = "case2"
        initial_velocity = {{value = {value}, standard_deviation = 1e-7, unit = "{unit}"}}
        {PARAMETER}"""
    )
    (warning,) = Experiment.load(path).warnings
    assert f"initial_velocity = {value:g} {unit} is " in warning and "check unit" in warning


def test_a_curve_out_of_all_proportion_is_a_warning(tmp_path):
    (tmp_path / "a.csv").write_text("time,mudline\n0,100\n1,92\n")
    sample = SAMPLE.format(name="A", file="a", unit="mm", error=1.0, recipe="case2")
    (tmp_path / "one.toml").write_text(f'name = "one"\n{sample}{PARAMETER}'.replace("day", "s"))
    (warning,) = Experiment.load(tmp_path / "one.toml").warnings
    assert "its curve falls" in warning and "check time_unit" in warning


def test_readings_count_once(tmp_path):
    """The same file for two samples is refused, by whatever path; the same readings are told."""
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text(
            "# by eye\n" * (name == "b") + "time,mudline\n" + FALLING
        )
    (tmp_path / "sub").mkdir()

    def both(second):
        samples = [
            SAMPLE.format(name=name, file=file, unit="mm", error=1.0, recipe="case2")
            for name, file in (("A", "a"), ("B", second))
        ]
        (tmp_path / "two.toml").write_text(f'name = "two"\n{"".join(samples)}{PARAMETER}')
        return Experiment.load(tmp_path / "two.toml")

    for second in ("a", "sub/../a"):
        with pytest.raises(mrjax.InputError, match=r"sample 'B': curve.file = .* count twice"):
            both(second)
    (warning,) = both("b").warnings
    assert warning.startswith("samples 'A' and 'B': have the same readings")


@pytest.mark.parametrize("model", ["closed-form", "column"])
@pytest.mark.parametrize("lines", ["0,100\n0.0001,100\n", "0,100\n1,100\n2,100\n7,100\n"])
def test_readings_that_say_nothing_determine_nothing(tmp_path, lines, model):
    """They bound f_w from below at most; it ends where it has a meaning, without an error."""
    from calibrate import identify

    experiment = load(tmp_path, lines)
    _, found = fit_experiment(experiment, model)
    said = identify(found)
    assert 1e-6 <= found.values[0] <= 1e9
    assert said.determined == {"f_w": False} and said.status == {"f_w": "free"}
    assert said.combinations == () and said.standard_errors["f_w"] > found.values[0]


def test_a_bed_is_no_thinner_than_its_suspension(tmp_path):
    """Readings at the height, by all of their errors: the bed ends as dense as the suspension."""
    sheet = resources.files("mrjax.recipe.bundled").joinpath("case2.toml").read_text("utf-8")
    (tmp_path / "mine.toml").write_text(sheet)
    lines = "0,100\n200,101\n300,100.5\n400,101\n"
    load(tmp_path, lines, recipe="mine.toml")
    text = (tmp_path / "one.toml").read_text().replace("bed_fraction = 0.5", "")
    bed = 'name = "bed_fraction"\nmedian = 0.45\nlog_standard_deviation = 0.3'
    (tmp_path / "one.toml").write_text(text.replace('name = "f_w"\nmedian = 50.0', bed))
    problem, found = fit_experiment(Experiment.load(tmp_path / "one.toml"), "closed-form")
    solids = mrjax.Recipe.load("case2").coated_volume_fraction
    assert found.converged and solids < found.values[0] < 1.002 * solids
    assert (problem.predict(found.theta) <= 100.0).all()


def test_every_leaf_has_values_with_a_meaning():
    problem = Problem.prepare(Experiment.load("fang2005"), "closed-form")
    assert problem.bounds["f_v"] == (1e-6, 1e9)
    lower, upper = problem.bounds["bed_fraction[B]"]
    assert lower > mrjax.Recipe.load("case3").coated_volume_fraction and upper == 1.0
