"""Trajectories as viewers read them, and runs as they are kept: every number, by each's library."""

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import gsd.hoomd
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

import mrjax
from mrjax import InputError, SimulationError, SystemRefusal
from mrjax.core.state import ContactHistory
from mrjax.io import viewers
from tests.builders.runs import straight_run

BOX = mrjax.Box((1e-5, 2e-5, 3e-5), (True, False, False))
RADIUS = np.array([1e-6, 2e-6, 1.5e-6])
MADE_BY = {"recipe": "größe", "seed": 7, "versions": {"mrjax": "0"}}


@pytest.fixture(scope="module", params=["float64", "float32"])
def run(request):
    """Three particles of two materials that fly through two periodic sides."""
    found = straight_run(
        [[1e-6, 3e-6, 1e-5], [5e-6, 1e-5, 2e-6], [9e-6, 1.7e-5, 2e-5]],
        [[-0.5, 0.0, 0.1], [0.2, 0.0, 0.2], [1.2, 0.0, 0.0]],
        BOX,
        np.linspace(0.0, 2e-5, 5),
        spins=[[1e4, 2e4, 0.0], [0.0, 0.0, -3e4], [0.0, 0.0, 0.0]],
        dtype=request.param,
        radius=jnp.asarray(RADIUS),
        time_step=4e-9,
        steps=5000,
    )
    first, _, last = np.asarray(found.state.position)[:, 0]
    assert first < 0.0 and last > 2 * BOX.size[0]  # two sides have been passed
    rows = 1e-9 * jnp.arange(18.0).reshape(3, 2, 3).astype(request.param)
    history = ContactHistory(jnp.array([[1, -4], [0, -1], [-1, -1]], jnp.int32), rows, None)
    material = jnp.array([0, 1, 1], jnp.int32)
    return replace(found, state=replace(found.state, contacts=history, material=material))


def test_gsd_has_every_number(run, tmp_path, caplog):
    """In single precision, in um, from the middle of the box."""
    path = tmp_path / "trajectory.gsd"
    viewers.write_gsd(str(path), run, MADE_BY)
    assert caplog.records == []  # which would be printed
    assert list(tmp_path.iterdir()) == [path]
    size = np.array(BOX.size)
    with gsd.hoomd.open(path, "r") as read:
        assert len(read) == 5
        assert json.loads(read[0].log["metadata"].tobytes()) == MADE_BY
        np.testing.assert_array_equal(read[0].log["walls"], [0, 1, 1])
        for number, frame in enumerate(read):
            assert frame.configuration.step == number * run.steps / 4
            assert frame.log["time_s"] == np.asarray(run.times)[number]
            np.testing.assert_array_equal(
                frame.configuration.box, np.float32([10.0, 20.0, 30.0, 0.0, 0.0, 0.0])
            )
            particles = frame.particles
            assert particles.types == ["material 0", "material 1"]
            np.testing.assert_array_equal(particles.typeid, [0, 1, 1])
            single = dict(rtol=2**-23, atol=0.0)  # rounded once, from um
            np.testing.assert_allclose(particles.diameter, 2e6 * RADIUS, **single)
            np.testing.assert_allclose(
                particles.velocity, 1e6 * np.asarray(run.trajectory.velocity[number]), **single
            )
            np.testing.assert_allclose(
                frame.log["particles/spin_rad_per_s"], run.trajectory.spin[number], **single
            )
            assert (np.abs(particles.position) <= size * 5e5).all()
            unwrapped = 1e-6 * particles.position.astype(float) + size * (particles.image + 0.5)
            # A coordinate is as exact as single precision is of the box and of where it got to.
            np.testing.assert_allclose(
                unwrapped, run.trajectory.position[number], rtol=0.0, atol=2**-22 * 3e-5
            )
        np.testing.assert_array_equal(read[4].particles.image, [[-1, 0, 0], [0, 0, 0], [3, 0, 0]])


def test_vtk_has_every_bit(run, tmp_path):
    path = tmp_path / "one two & three.pvd"
    viewers.write_vtk(path, run)
    listed = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    assert [float(one.get("timestep")) for one in listed] == list(map(float, run.times))
    dtype = run.times.dtype
    size = np.array(BOX.size, dtype)
    for number, one in enumerate(listed):
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(tmp_path / one.get("file")))
        reader.Update()
        grid = reader.GetOutput()
        assert grid.GetNumberOfPoints() == grid.GetNumberOfCells() == 3
        values = {
            grid.GetPointData().GetArrayName(index): vtk_to_numpy(
                grid.GetPointData().GetArray(index)
            )
            for index in range(grid.GetPointData().GetNumberOfArrays())
        }
        assert set(values) == {
            "velocity_um_per_s",
            "spin_rad_per_s",
            "radius_um",
            "id",
            "material",
        }
        np.testing.assert_array_equal(values["id"], [0, 1, 2])
        np.testing.assert_array_equal(values["material"], [0, 1, 1])
        million = np.asarray(1e6, dtype)
        np.testing.assert_array_equal(values["radius_um"], million * np.asarray(run.radius))
        velocity = np.asarray(run.trajectory.velocity[number])
        np.testing.assert_array_equal(values["velocity_um_per_s"], million * velocity)
        np.testing.assert_array_equal(values["spin_rad_per_s"], run.trajectory.spin[number])
        assert values["velocity_um_per_s"].dtype == dtype
        centres = vtk_to_numpy(grid.GetPoints().GetData())
        assert centres.dtype == dtype
        assert ((centres >= 0) & (centres <= million * size)).all()
        sides = million * np.asarray(run.trajectory.position[number]) - centres
        whole = sides[:, 0] / 10.0
        np.testing.assert_allclose(whole, np.round(whole), rtol=0.0, atol=4 * np.finfo(dtype).eps)
        assert not sides[:, 1:].any()
    # Written again with fewer frames, the list has only those.
    shorter = jax.tree.map(lambda rows: rows[:2], run.trajectory)
    viewers.write_vtk(path, replace(run, times=run.times[:2], trajectory=shorter))
    assert len(ElementTree.parse(path).getroot().findall("Collection/DataSet")) == 2
    assert sorted(one.name for one in (tmp_path / "one two & three").iterdir()) == [
        "000000.vtu",
        "000001.vtu",
        "mrjax-frames.json",
    ]


def test_a_run_comes_back_to_the_last_bit(run, tmp_path):
    path = tmp_path / "run.npz"
    for kept in (run, replace(run, trajectory=None, state=replace(run.state, contacts=None))):
        mrjax.save_run(path, kept, MADE_BY)
        again, made_by = mrjax.load_run(path)
        assert made_by == MADE_BY
        assert jax.tree.structure(again) == jax.tree.structure(kept)
        for one, other in zip(jax.tree.leaves(again), jax.tree.leaves(kept), strict=True):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(
            mrjax.sedimentation_ratio(again), mrjax.sedimentation_ratio(kept)
        )
    with np.load(path, allow_pickle=False) as stored:
        assert {"times_s", "heights_m", "mean_velocity_m_per_s", "last_position_m"} <= set(stored)


def test_what_is_no_trajectory_is_refused(run, tmp_path):
    without = replace(run, trajectory=None)
    several = jax.tree.map(lambda leaf: leaf[None], run)
    spoilt = replace(run, fault=jnp.asarray(8, jnp.int32))
    for write in (viewers.write_vtk, lambda path, run: viewers.write_gsd(path, run, {})):
        with pytest.raises(InputError, match="give simulate or settle trajectory=True"):
            write(tmp_path / "a", without)
        with pytest.raises(InputError, match="these are several runs"):
            write(tmp_path / "a", several)
        with pytest.raises(SimulationError, match="give a smaller time_step"):
            write(tmp_path / "a", spoilt)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "a").touch()
    with pytest.raises(InputError, match=r"run: give a name that ends in \.npz"):
        mrjax.save_run(tmp_path / "run", run, {})
    with pytest.raises(InputError, match=r"a: give a name that ends in \.pvd"):
        viewers.write_vtk(tmp_path / "a", run)
    for name in ("a\x1b.pvd", "\udcff.pvd"):
        with pytest.raises(InputError, match="give a name of printable characters"):
            viewers.write_vtk(tmp_path / name, run)
    with pytest.raises(SystemRefusal, match="a: cannot be written"):
        viewers.write_vtk(tmp_path / "a.pvd", run)
    mrjax.io.npz.write(tmp_path / "other.npz", {"a": np.zeros(3)}, {})
    with pytest.raises(InputError, match=r"other\.npz: is not a file that .* give a file of a run"):
        mrjax.load_run(tmp_path / "other.npz")
