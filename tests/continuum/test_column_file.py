"""A settling column on disk has the numbers of the result, under names with units."""

import csv
import json

import numpy as np
import pytest

import mrjax
from tests.continuum.test_column import HEIGHT, spheres, zaki
from tests.continuum.test_fields import FALL, RIGID, TIMES, classes


def test_a_column_is_written_as_a_table_and_as_arrays(tmp_path):
    tube = mrjax.column(spheres(), times=TIMES[1:3], **RIGID | {"cells": 30})
    mrjax.save_column(tmp_path / "tube.csv", tube)
    with (tmp_path / "tube.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == [
        "time_s", "height_m", "volume_fraction", "settling_velocity_m_per_s", "solid_stress_Pa"
    ]  # fmt: skip
    table = np.array(rows, float).reshape(2, 30, 5)
    assert table[:, 3, 0] == pytest.approx(TIMES[1:3]) and len(rows) == 60
    assert table[0, :, 1] == pytest.approx(np.asarray(tube.levels), rel=1e-7)
    for place, field in enumerate(("volume_fraction", "settling_velocity", "solid_stress"), 2):
        np.testing.assert_allclose(table[:, :, place], getattr(tube, field), rtol=1e-7)
    mrjax.save_column(tmp_path / "tube.npz", tube, {"recipe": "mine"})
    with np.load(tmp_path / "tube.npz") as arrays:
        np.testing.assert_array_equal(arrays["solid_stress_Pa"], tube.solid_stress)
        np.testing.assert_array_equal(arrays["mudline_m"], tube.mudline)
        assert json.loads(str(arrays["metadata"]))["made_by"] == {"recipe": "mine"}
    with pytest.raises(mrjax.InputError, match=r"tube\.txt: give a name that ends in \.csv or"):
        mrjax.save_column(tmp_path / "tube.txt", tube)


def test_the_fields_of_each_class_are_written(tmp_path):
    tube = mrjax.polydisperse_column(
        classes(), height=HEIGHT, volume_fraction=[0.15, 0.1], bed_fraction=0.6,
        times=[0.3 * FALL], hindrance=zaki(), cells=6,
    )  # fmt: skip
    mrjax.save_column(tmp_path / "tube.csv", tube)
    lines = (tmp_path / "tube.csv").read_text().splitlines()
    assert lines[0].split(",")[5:] == [
        "volume_fraction_class_0",
        "volume_fraction_class_1",
        "settling_velocity_m_per_s_class_0",
        "settling_velocity_m_per_s_class_1",
    ]
    table = np.array([line.split(",") for line in lines[1:]], float)
    np.testing.assert_allclose(table[:, 5:7].T, tube.class_fractions[0], rtol=1e-7)
    np.testing.assert_allclose(table[:, 7:].T, tube.class_velocities[0], rtol=1e-7)
    mrjax.save_column(tmp_path / "tube.npz", tube)
    with np.load(tmp_path / "tube.npz") as arrays:
        np.testing.assert_array_equal(arrays["class_velocities_m_per_s"], tube.class_velocities)
