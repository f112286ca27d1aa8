"""Figures show the numbers they are given, at the size and with the metadata they promise."""

import itertools
import json
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import imageio_ffmpeg
import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from PIL import Image, ImageSequence

import mrjax
from mrjax import InputError, figures
from mrjax.figures import spheres
from mrjax.io import files
from tests.builders.particles import glass, unit_spheres
from tests.builders.runs import run_of, straight_run

near = partial(pytest.approx, rel=1e-6, abs=0.0)

DRY = glass(radius=1e-6, elastic_modulus=5e7, poisson_ratio=0.25)
BOX = mrjax.Box((1e-5, 1e-5, 2e-5))
TALL = mrjax.Box((10.0, 10.0, 40.0))


@pytest.fixture(scope="module")
def run():
    """Two particles that fly apart, one towards the floor."""
    return straight_run(
        [[3e-6, 5e-6, 6e-6], [7e-6, 5e-6, 1.2e-5]],
        [[0.0, 0.0, -0.16], [0.0, 0.0, 0.2]],
        BOX,
        np.linspace(0.0, 3e-5, 13),
        radius=jnp.full(2, 1e-6),
    )


@pytest.fixture(scope="module")
def bed():
    """Three on each other, the lowest on the floor and at a wall, and one that touches nothing."""
    return mrjax.place(
        [[0.95e-6, 5e-6, 0.9e-6], [1.9e-6, 5e-6, 2.5e-6], [1.9e-6, 5e-6, 4.45e-6], [8e-6] * 3],
        [[0.0, 0.0, 0.0], [0.0, 0.0, -0.01], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    )


def drawn(figure):
    """Drawn once, as saving would: what is wrong with it is a warning, which is an error here."""
    figure.canvas.draw()
    return figure


def test_spheres_are_drawn_to_scale_and_the_nearer_one_hides_the_other():
    size = np.array([4.0, 4.0, 8.0])
    middle = size / 2
    towards_eye = np.linalg.inv(spheres.project(np.eye(3)))[2]
    moments = {"one": [middle], "two": [middle + 1.5 * towards_eye, middle]}
    figure = drawn(figures.particles(moments, 1.0, mrjax.Box(tuple(size))))
    assert [axes.get_title() for axes in figure.axes] == ["one", "two"]
    assert figure.get_figwidth() == figures.COLUMN
    single, both = (axes.images[0] for axes in figure.axes)
    left, right, low, high = single.get_extent()
    shades = single.get_array()
    pixel = (right - left) * (high - low) / shades.size
    assert pixel * shades.count() == near(np.pi, rel=0.01)
    assert both.get_array().count() == shades.count()
    assert both.get_array().max() > 1.1 * shades.max()


def test_particles_of_several_sizes_are_drawn_where_they_are_in_a_periodic_box():
    box = mrjax.Box((4.0, 4.0, 8.0), (True, False, False))
    centres = np.array([[5.0, 2.0, 2.0], [1.0, 2.0, 5.0]])
    radius = np.array([1.0, 0.5])
    (beyond,), (within,) = (
        drawn(figures.particles({"": places}, radius, box)).axes
        for places in (centres, centres - [[4.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    )
    shades = beyond.images[0].get_array()
    np.testing.assert_array_equal(shades.filled(2), within.images[0].get_array().filled(2))
    left, right, low, high = beyond.images[0].get_extent()
    pixel = (right - left) * (high - low) / shades.size
    assert pixel * shades.count() == near(np.pi * (1.0 + 0.25), rel=0.02)
    with pytest.raises(InputError, match=r"positions\['now'\] have shape \(2, 2\)"):
        figures.particles({"now": centres[:, :2]}, radius, box)
    with pytest.raises(InputError, match="positions is empty"):
        figures.particles({}, radius, box)


def test_a_heat_map_holds_all_the_solid(run):
    thickness = 1e-6
    figure = drawn(figures.concentration(run, thickness))
    axes, bar = figure.axes
    (mesh,) = axes.collections
    shown = np.asarray(mesh.get_array())
    assert shown.shape == (figures.heat_map.LEVELS, 13)
    height = BOX.height / figures.heat_map.LEVELS
    solid = shown.sum(axis=0) * height * 1e-10
    # Slabs at the floor are cut off, and count their part in full; particles near it in half.
    np.testing.assert_allclose(solid[0], 2 * 4 / 3 * np.pi * 1e-18, rtol=1e-3)
    highest = np.flatnonzero(shown[:, 0])[-1]
    assert (highest + 0.5) * height == near(1.3e-5 + thickness / 2, rel=0.02)
    np.testing.assert_allclose(axes.lines[0].get_xdata(), run.times)
    np.testing.assert_allclose(axes.lines[0].get_ydata(), run.mudline)
    # Each column between the middles of two intervals, each row a slab.
    edges = mesh.get_coordinates()
    frame = 3e-5 / 12
    begins = np.concatenate([[0.0], frame * (np.arange(12) + 0.5), [3e-5]])
    np.testing.assert_allclose(edges[0, :, 0], begins, rtol=1e-12)
    np.testing.assert_allclose(edges[:, 0, 1], height * np.arange(201), rtol=1e-12)
    assert axes.get_xlim() == (0.0, near(3e-5)) and axes.get_ylim() == (0.0, 2e-5)
    assert bar.get_ylabel() == "volume fraction"
    assert {"time", "height"} == {axes.get_xlabel(), axes.get_ylabel()}
    # Units with the numbers.
    assert axes.get_xticklabels()[-1].get_text().endswith("µs")
    assert axes.get_yticklabels()[-1].get_text() == "20 µm"


def test_a_field_of_a_column_is_drawn_with_its_isolines_and_readings():
    """Days as the unit of a long run; a line on the scale for each volume fraction."""
    times, levels = np.array([0.0, 1.0, 2.0, 4.0]) * 86400.0, np.arange(8) * 0.01 + 0.005
    fraction = np.tile(np.linspace(0.5, 0.1, 8), (4, 1))
    tube = mrjax.Column(
        times=times,
        mudline=np.full(4, 0.08),
        bed_front=np.zeros(4),
        sedimentation_ratio=np.ones(4),
        volume_fraction=fraction,
        settling_velocity=-1e-6 * fraction,
        solid_stress=100.0 * fraction,
        levels=levels,
        initial_height=np.asarray(0.08),
        courant=np.asarray(0.1),
        steps=3,
    )
    readings = ([86400.0, 172800.0], [0.05, 0.04])
    figure = drawn(figures.column_field(tube, readings=readings, isolines=[0.3, 0.45, 0.9]))
    axes, bar = figure.axes
    mesh, lines = axes.collections
    np.testing.assert_allclose(mesh.get_array(), fraction.T)
    np.testing.assert_allclose(mesh.get_coordinates()[0, :, 0], [0.0, 0.5, 1.5, 3.0, 4.0])
    assert list(lines.levels) == [0.3, 0.45]
    assert len(bar.collections[-1].get_segments()) == 2
    mudline, measured = axes.lines
    np.testing.assert_allclose(measured.get_data(), ([1.0, 2.0], readings[1]))
    np.testing.assert_allclose(mudline.get_ydata(), 0.08)
    assert (axes.get_xlabel(), bar.get_ylabel()) == ("time, days", "volume fraction")
    # Particles that rise: their velocities are negative, and zero is white.
    axes, bar = drawn(figures.column_field(tube, "settling_velocity")).axes
    (mesh,) = axes.collections
    np.testing.assert_allclose(mesh.get_array(), -fraction.T)
    assert mesh.norm.vmax == 0.0 and mesh.to_rgba(0.0)[0] == 1.0
    assert bar.get_ylabel() == "settling velocity, µm/s"
    for wrong in ({"field": "shear"}, {"class_number": 1}, {"field": "class_fractions"}):
        with pytest.raises(InputError, match=r"must be one of volume|that of all classes"):
            figures.column_field(tube, **wrong)
    with pytest.raises(InputError, match="solid_stress of the column is not finite"):
        figures.column_field(replace(tube, solid_stress=fraction * np.nan), "solid_stress")


def test_the_curve_of_a_settling_run_is_beside_its_formula():
    """Dots of the run, the line of Eq. 27, and how far the mudline has come."""
    parameters = unit_spheres(gravity=1.0, viscosity=0.05)
    times = np.linspace(0.0, 2.0, 9)
    speed = 0.1 * times
    run = run_of(times, 30.0 - 2.0 * times[:, None] * [1.0, 1.5], TALL, mean_velocity=speed)
    velocity, mudline = drawn(figures.settling(run, parameters)).axes
    line, dots = velocity.lines
    per_day = 1000.0 * 86400.0  # mm/day in m/s
    relaxation = 1.0 / (6 * np.pi * 0.05)  # of 1 kg
    moments = line.get_xdata()
    np.testing.assert_allclose(moments, np.linspace(0.0, 2.0, 200), rtol=1e-12)
    exact = per_day * relaxation * (1.0 - np.exp(-moments / relaxation))
    np.testing.assert_allclose(line.get_ydata(), exact, rtol=1e-9, atol=1e-9 * exact.max())
    np.testing.assert_allclose(dots.get_xdata(), times)
    np.testing.assert_allclose(dots.get_ydata(), per_day * speed)
    (descent,) = mudline.lines
    np.testing.assert_allclose(descent.get_xdata(), times)
    np.testing.assert_allclose(descent.get_ydata(), 2.0 * times)
    assert velocity.get_ylabel() == "settling velocity, mm/day"
    assert mudline.get_ylabel() == "descent of the mudline"


def test_what_rises_is_drawn_as_rising():
    times = np.linspace(0.0, 2.0, 9)
    run = run_of(times, 5.0 + times[:, None], TALL, mean_velocity=-times, rising=jnp.asarray(True))
    light = unit_spheres(gravity=1.0, viscosity=0.05, fluid_density=1.0)
    velocity, mudline = drawn(figures.settling(run, light)).axes
    assert mudline.get_ylabel() == "rise of the mudline"
    np.testing.assert_allclose(mudline.lines[0].get_ydata(), times)
    low, high = velocity.get_ylim()
    assert low < -2.0 * 86400e3 and high == 0.0


def test_the_whole_curve_has_its_asymptotes_and_profiles():
    """Two runs that fall straight and rest: lines that meet where the fall ends."""
    times = np.linspace(0.0, 10.0, 11)
    each = [
        run_of(times, np.maximum(39.0 - 4.0 * times, rest - 1.0)[:, None], TALL)
        for rest in (24.0, 16.0)
    ]
    runs = jax.tree.map(lambda *leaves: jnp.stack(leaves), *each)
    whole = mrjax.Sedimentation(runs, unit_spheres(), 1.0, (0, 1))
    curve, profile = drawn(figures.sedimentation(whole)).axes
    first, second, mean, corners = curve.lines
    for line, rest in ((first, 24.0), (second, 16.0)):
        np.testing.assert_allclose(line.get_xdata(), times)
        np.testing.assert_allclose(line.get_ydata(), np.maximum(40.0 - 4.0 * times, rest) / 40.0)
    both = np.asarray(first.get_ydata()), np.asarray(second.get_ydata())
    np.testing.assert_allclose(mean.get_ydata(), np.mean(both, axis=0))
    np.testing.assert_allclose(corners.get_xdata(), [0.0, 5.0, 10.0])
    np.testing.assert_allclose(corners.get_ydata(), [1.0, 0.5, 0.5])
    # Of the first run at the start, on half of the way, where the lines meet, and at the end.
    assert [line.get_label() for line in profile.lines] == ["0 s", "3 s", "5 s", "10 s"]
    for line, centre in zip(profile.lines, (39.0, 27.0, 23.0, 23.0), strict=True):
        fraction, level = map(np.asarray, line.get_data())
        assert level[0] == 0.0 and level[-1] == 1.0
        assert 40.0 * np.average(level, weights=fraction) == near(centre, abs=0.5)


def test_bars_of_sensitivities_are_in_the_order_of_their_size():
    figure = drawn(figures.sensitivities({"f_w": -1.0, "mu": 0.03, "radius": 2.0}, "velocity"))
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["mu", "f_w", "radius"]
    assert [bar.get_width() for bar in axes.patches] == [0.03, -1.0, 2.0]
    assert [text.get_text() for text in axes.texts] == ["+0.03", "\N{MINUS SIGN}1", "+2"]
    low, high = axes.get_xlim()
    assert low < -1.0 and high > 2.0
    assert axes.get_xlabel() == "d ln velocity / d ln parameter"
    for wrong in ({}, {"f_w": np.nan}, {"f_w": [1.0, 2.0]}):
        with pytest.raises(InputError, match="exponents"):
            figures.sensitivities(wrong, "velocity")


def test_sensitivities_along_a_run_are_lines_that_differ_without_colour():
    times = np.linspace(0.0, 60.0, 7)
    values = {name: np.full(7, float(at)) for at, name in enumerate("abcdef")}
    figure = drawn(figures.sensitivity_curves(times, values, "ratio"))
    lines = figure.axes[0].lines[1:]
    assert [line.get_label() for line in lines] == list("abcdef")
    assert [line.get_ydata()[3] for line in lines] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 6
    for wrong in (values | {"g": values["a"]}, {"a": 1.0}, {"a": np.full(7, np.inf)}):
        with pytest.raises(InputError, match="exponents"):
            figures.sensitivity_curves(times, wrong, "ratio")


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_normal_forces_add_up_to_the_forces_on_the_particles(bed, dtype):
    """Without friction there are no others. One contact closes, and is damped."""
    parameters = DRY.replace(restitution=0.5).astype(dtype)
    state = mrjax.place(bed.position, bed.velocity, dtype=dtype)
    found = mrjax.normal_forces(state, parameters, BOX)
    pairs = sorted(zip(found.first.tolist(), found.second.tolist(), strict=True))
    # Ids from 4 on are walls: x at 0, then z at 0.
    assert pairs == [(0, 1), (0, 4), (0, 8), (1, 2)]
    assert (found.force > 0.0).all()
    length = np.linalg.norm(found.reach, axis=1)
    total = np.zeros((4, 3))
    push = found.force[:, None] * found.reach / length[:, None]
    np.add.at(total, found.first, -push)
    inner = found.second < 4
    np.add.at(total, found.second[inner], push[inner])
    expected, torque = mrjax.contact_forces(state, parameters, BOX)
    assert not np.any(torque)
    precision = 4e-6 if dtype == "float32" else 1e-13
    np.testing.assert_allclose(total, expected, rtol=0, atol=precision * found.force.max())
    # Damping adds to the force of a contact that closes.
    still = mrjax.normal_forces(replace(state, velocity=0.0 * state.velocity), parameters, BOX)
    change = dict(zip(pairs, np.sign(found.force / still.force - 1.0), strict=True))
    assert change == {(0, 1): 1.0, (0, 4): 0.0, (0, 8): 0.0, (1, 2): -1.0}


def test_force_chains_run_from_centre_to_centre(bed):
    found = mrjax.normal_forces(bed, DRY, BOX)
    figure = drawn(figures.force_chains(bed, DRY, BOX))
    (axes,) = figure.axes
    circles, lines = axes.collections
    assert len(circles.get_paths()) == 4
    widths = lines.get_linewidths()
    strength = np.minimum(np.sort(found.force) / found.force.mean(), 4.0) / 4.0
    assert widths == near(3.5 * strength)
    strongest = found.force.argmax()
    begin = spheres.project(np.asarray(bed.position))[found.first[strongest], :2]
    np.testing.assert_allclose(lines.get_segments()[-1][0], begin)
    assert axes.get_title().startswith("4 contacts, mean normal force ")


def test_a_distribution_of_forces_is_one_of_probability(bed):
    figure = drawn(figures.force_distribution(bed, DRY, BOX))
    (axes,) = figure.axes
    ratio, density = axes.lines[0].get_data()
    bins = 5
    found = mrjax.normal_forces(bed, DRY, BOX).force
    width = found.max() / found.mean() / bins
    assert density.sum() * width == near(1.0)
    assert axes.get_yscale() == "log" and (ratio < found.max() / found.mean()).all()
    smooth, exponential = axes.lines[1].get_data()
    assert smooth[0] == 0.0 and smooth[-1] == near(found.max() / found.mean())
    np.testing.assert_allclose(exponential, np.exp(-smooth), rtol=1e-12)
    alone = jax.tree.map(lambda rows: rows[3:], bed)
    for figure in (figures.force_distribution, figures.force_chains):
        with pytest.raises(InputError, match="nothing touches in this state"):
            figure(alone, DRY, BOX)


def test_figures_of_a_packing_show_its_observables(bed):
    network = mrjax.contact_network(bed, DRY, BOX)
    numbers = mrjax.coordination(network)
    (axes,) = drawn(figures.coordination_distribution(network)).axes
    shares = [bar.get_height() for bar in axes.patches]
    assert shares == near(np.asarray(numbers.distribution)[: len(shares)])
    assert f"mean {float(numbers.mean):.2f}" in axes.get_legend_handles_labels()[1]
    (axes,) = drawn(figures.clusters(network)).axes
    sizes = axes.lines[0].get_xdata()
    assert sizes.tolist() == mrjax.cluster_sizes(network).tolist()
    (axes,) = drawn(figures.contact_directions(network)).axes
    density = axes.containers[0].lines[0].get_ydata()
    assert density.mean() == near(1.0)
    (axes,) = drawn(figures.stress_profile(network, weight=1e-9)).axes
    stress, levels = axes.lines[0].get_data()
    assert stress == near(np.asarray(mrjax.vertical_stress(network, levels)))
    assert axes.lines[1].get_xdata()[0] == near(1e-9 / (BOX.size[0] * BOX.size[1]))
    alone = jax.tree.map(lambda rows: rows[3:], bed)
    with pytest.raises(InputError, match="no two particles touch"):
        figures.contact_directions(mrjax.contact_network(alone, DRY, BOX))


def test_a_compressive_yield_is_drawn_with_its_law():
    phi = np.linspace(0.2, 0.5, 7)
    law = mrjax.Compression(gel_fraction=0.22, stress=0.02, exponent=6.0)
    exact = np.asarray(law.solid_stress(phi))
    result = mrjax.CompressiveYield(
        volume_fraction=phi,
        stresses=np.stack([0.8 * exact, 1.2 * exact]),
        lateral_stresses=exact[None],
        coordination=exact[None],
        unbalanced=exact[None],
        compression=law,
        covariance=np.zeros((3, 3)),
        fitted=exact > 0,
        pull_off=8e-12,
        diameter=4e-6,
        seeds=(0, 1),
    )
    (axes,) = drawn(figures.compressive_yield(result)).axes
    points = axes.containers[0].lines[0]
    assert points.get_ydata() == near((exact / 0.5)[exact / 0.5 > 1e-3])  # F_c / d^2 = 0.5 Pa
    fraction, stress = axes.lines[-1].get_data()
    assert stress == near(np.asarray(law.solid_stress(fraction)) / 0.5)


def test_a_film_shows_the_first_frame_the_last_and_as_many_as_asked(run, tmp_path):
    path = tmp_path / "run.gif"
    figures.save_animation(path, run, pictures=5)
    assert list(tmp_path.iterdir()) == [path]
    with Image.open(path) as film:
        shown = [np.asarray(one.convert("L"), int) for one in ImageSequence.Iterator(film)]
        assert film.info["loop"] == 0
    assert len(shown) == 5
    for one, other in itertools.pairwise(shown):
        assert 20 < np.count_nonzero(abs(one - other) > 60) < one.size / 4
    figures.save_animation(path, run)
    with Image.open(path) as film:
        assert film.n_frames == 13


def test_a_film_may_be_mp4(run, tmp_path):
    path = tmp_path / "run.mp4"
    # Its own way of finding its program forks, which JAX warns of.
    (ffmpeg,) = Path(imageio_ffmpeg.__file__).parent.glob("binaries/ffmpeg-*")
    with matplotlib.rc_context({"animation.ffmpeg_path": str(ffmpeg)}):
        figures.save_animation(path, run, pictures=6)
    assert list(tmp_path.iterdir()) == [path]
    told = subprocess.run(
        [ffmpeg, "-i", path, "-f", "framemd5", "-"], capture_output=True, text=True, check=True
    ).stdout
    assert "#tb 0: 1/20" in told
    frames = [line.split(", ")[-1] for line in told.splitlines() if not line.startswith("#")]
    assert len(frames) == len(set(frames)) == 6


def test_a_film_that_cannot_be_made_is_refused(run, tmp_path):
    nowhere = matplotlib.rc_context({"animation.ffmpeg_path": "there-is-none"})
    with nowhere, pytest.raises(InputError, match="MP4 needs the program ffmpeg"):
        figures.save_animation(tmp_path / "run.mp4", run)
    with pytest.raises(InputError, match=r"run\.avi: give a name that ends in \.gif or \.mp4"):
        figures.save_animation(tmp_path / "run.avi", run)
    with pytest.raises(InputError, match="pictures = 0 must be a whole number"):
        figures.save_animation(tmp_path / "run.gif", run, pictures=0)
    for other in (replace(run, trajectory=None), jax.tree.map(lambda leaf: leaf[None], run)):
        with pytest.raises(InputError, match="give one run, with a trajectory"):
            figures.save_animation(tmp_path / "run.gif", other)
    with pytest.raises(mrjax.SimulationError):
        figures.save_animation(tmp_path / "a.gif", replace(run, fault=jnp.asarray(8, jnp.int32)))
    assert list(tmp_path.iterdir()) == []


def test_figures_are_for_columns_of_a_paper_and_leave_settings_alone(run, bed, tmp_path):
    before = dict(matplotlib.rcParams)
    every = [
        figures.settling(run, DRY.replace(gravity=9.81, viscosity=1.0)),
        figures.concentration(run),
        figures.particles({"now": bed.position}, DRY.radius, BOX),
        figures.sensitivities({"f_w": -1.0}, "velocity"),
        figures.force_chains(bed, DRY, BOX),
        figures.coordination_distribution(mrjax.contact_network(bed, DRY, BOX)),
    ]
    assert dict(matplotlib.rcParams) == before
    for figure in every:
        assert figure.get_figwidth() in (figures.COLUMN, figures.COLUMN / 2, figures.PAGE)
        for text in drawn(figure).findobj(matplotlib.text.Text):
            assert 7.0 <= text.get_fontsize() <= 8.5
        files.write_figure(tmp_path, "figure", figure, {"recipe": "größe"}, pdf=True)
    with Image.open(tmp_path / "figure.png") as image:
        assert json.loads(image.text["Description"]) == {"recipe": "größe"}
        assert image.text["Software"] == f"mrjax {mrjax.__version__}"
        assert image.width == near(300 * figures.COLUMN, rel=2e-3)
    document = (tmp_path / "figure.pdf").read_bytes()
    assert document.startswith(b"%PDF") and b"/Subject" in document
    assert b"/FontFile2" in document and b"/Type3" not in document  # text that can be edited
    assert {path.name for path in tmp_path.iterdir()} == {"figure.png", "figure.pdf"}
