"""From nothing to a fitted result: what a newcomer is told to type, typed, and what it promises."""

import csv
import json
import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.image import imread

import mrjax
from calibrate import Experiment, Problem
from calibrate.__main__ import cli
from tests.builders import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
SECTION = README.split("## From nothing to a fit\n")[1].split("\n## ")[0]
SCRIPTS = sysconfig.get_path("scripts")

installed = pytest.mark.skipif(
    not all(shutil.which(name, path=SCRIPTS) for name in ("mrjax", "mrjax-calibrate")),
    reason="the commands are not installed",
)


def start_from_the_template(folder: Path) -> Path:
    """An experiment as `mrjax-calibrate --new` writes it, beside the recipe of `mrjax new`."""
    recipe = (Path(mrjax.__file__).parent / "recipe" / "template.toml").read_text("utf-8")
    (folder / "mine.toml").write_text(recipe, "utf-8")
    file = folder / "tube.toml"
    with pytest.raises(SystemExit) as ended:
        cli.main(["--new", str(file)])
    assert ended.value.code == 0
    return file


@pytest.fixture(scope="module")
def typed(tmp_path_factory) -> tuple[Path, str]:
    """The folder in which the section's commands ran, at first empty, and what they said."""
    (block,) = re.findall(r"```sh\n(.*?)```", SECTION, flags=re.S)
    home, folder = tmp_path_factory.mktemp("home"), tmp_path_factory.mktemp("newcomer")
    of_the_user = {"HOME": str(home), "XDG_CACHE_HOME": str(home), "MPLCONFIGDIR": str(home)}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block],
        cwd=folder,
        env={
            **os.environ,
            **of_the_user,
            "JAX_PLATFORMS": "cpu",
            "PATH": os.pathsep.join([SCRIPTS, os.environ["PATH"]]),
        },
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


@pytest.mark.slow
@installed
def test_it_ends_in_the_files_figures_and_numbers_it_names(typed):
    """One test, as its commands take minutes, and two may be given to two processes."""
    folder, said = typed
    named = set(re.findall(r"`((?:simulated|fitted)/[\w.]+)`", SECTION))
    assert len(named) == 4
    for name in named | {"mine.toml", "measured.toml", "measured.csv"}:
        assert (folder / name).stat().st_size > 0
    for name in (one for one in named if one.endswith(".png")):
        picture = imread(folder / name)[..., :3]
        assert min(picture.shape[:2]) > 300 and picture.std() > 0.05
    # Each command says what is next, or where its results are.
    for line in (
        "Change mine.toml, then: mrjax check mine.toml",
        "particles in the box",
        "Results: simulated",
        "Put your readings into measured.csv",
        "mrjax-calibrate measured.toml --model column",
        "Report: fitted/report.html",
    ):
        assert line in said
    refuse_other_numbers(folder)


def refuse_other_numbers(folder: Path) -> None:
    """Holds the results in a folder against the numbers of the section."""
    summary = json.loads((folder / "simulated" / "summary.json").read_text("utf-8"))
    assert f"fall by {summary['settling_velocity_mm_per_day']:.2f} mm/day" in SECTION
    # A bed's height is that of its start, and differs by a point or two elsewhere.
    rest = float(re.search(r"some (\d+) % of the height", SECTION.replace("\n", " "))[1])
    assert 100 * summary["final_ratio"] == pytest.approx(rest, abs=2.0)
    fit = json.loads((folder / "fitted" / "fit.json").read_text("utf-8"))
    assert fit["converged"] is True and fit["misfit"] is False
    found = fit["parameters"]
    for name, digits in (("f_w", 2), ("bed_fraction", 4)):
        one = found[name]
        stated = f"`{name}` = {one['value']:.{digits}f} ± {one['standard_error']:.{digits}f}"
        assert one["determined"] is True and stated in SECTION


def test_the_example_of_readings_is_what_it_says(tmp_path):
    """A straight fall, then a bed, and half a millimetre of noise; its own numbers fit it."""
    problem = Problem.prepare(Experiment.load(start_from_the_template(tmp_path)), "closed-form")
    truth = {"f_w": jnp.asarray(60.0), "bed_fraction": jnp.asarray(0.5)}
    with (tmp_path / "tube.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    read = np.array([float(row["mudline"]) for row in rows])
    off = (read - np.asarray(problem.predict(truth))) / 0.5
    assert np.abs(off).max() < 3.0 and 0.3 < (off**2).mean() < 2.0


def test_every_option_of_a_new_experiment_works(tmp_path):
    file = start_from_the_template(tmp_path)
    text = file.read_text("utf-8")
    shorter = {one.name for one in Experiment.load(file).parameters}
    assert text.count("#? ") > 15 and 'file = "tube.csv"' in text
    # A value for each sample, or for some: one of the two.
    for other in ("per_sample", "samples"):
        lines = [line for line in text.splitlines() if not line.startswith(f"#? {other} =")]
        file.write_text("\n".join(lines).replace("#? ", ""), "utf-8")
        whole = Experiment.load(file)
        assert {one.name for one in whole.parameters} == shorter | {"viscosity"}
        assert [sample.name for sample in whole.samples] == ["A", "B"]
        observables = {one.observable for one in whole.samples[0].measurements}
        assert observables == {"mudline", "initial_velocity", "final_ratio", "viscosity_ratio"}
        assert ("A", "f_s", 1.1) in whole.held


@pytest.mark.parametrize(
    "name, there, words",
    [
        ("tube.csv", (), "must end in .toml"),
        ("tube", (), "must end in .toml"),
        ("tube.toml", ("tube.toml",), "tube.toml: is there already"),
        ("tube.toml", ("tube.csv",), "tube.csv: is there already"),
        ("nowhere/tube.toml", (), "cannot be written"),
    ],
)
def test_a_new_experiment_replaces_nothing(tmp_path, name, there, words):
    for one in there:
        (tmp_path / one).write_text("mine")
    with pytest.raises((mrjax.InputError, mrjax.SystemRefusal), match=words):
        cli.main(["--new", str(tmp_path / name)], standalone_mode=False)
    assert {path.name for path in tmp_path.iterdir()} == set(there)
    assert all((tmp_path / one).read_text() == "mine" for one in there)
