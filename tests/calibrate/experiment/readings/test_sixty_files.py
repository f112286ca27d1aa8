"""Sixty ordinary files are read with the right numbers; sixty wrong ones are refused in a line."""

import json
import os
import re

import numpy as np
import pytest

import mrjax
from calibrate import Experiment
from tests.calibrate.experiment.readings import ordinary_files, wrong_files

ORDINARY = 60
MORE = 600
EXPERIMENT = """
name = "e"
[[sample]]
name = "A"
recipe = "case2"
bed_fraction = 0.6
{tube}
curve = {{file = {file}{stated}}}
[[parameter]]
name = "f_w"
median = 50.0
"""
REMEDY = re.compile(r"\b(give|mend|write|state|take|save|leave|begin|separate|keep)\b")


def in_toml(value) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {in_toml(one)}" for key, one in value.items()) + "}"
    return json.dumps(value, ensure_ascii=False)


def sample_of(folder, file, stated, height, tube_diameter):
    """The sample of an experiment with this file."""
    tube = f"height = {height}"
    if tube_diameter is not None:
        tube += f"\ntube_diameter = {tube_diameter}"
    more = "".join(f", {key} = {in_toml(value)}" for key, value in stated.items())
    text = EXPERIMENT.format(tube=tube, file=in_toml(file), stated=more)
    (folder / "e.toml").write_text(text, "utf-8")
    return Experiment.load(folder / "e.toml").samples[0]


def refuse_other_numbers(folder, seed):
    """Fails unless the file of a number is read as it was written, to its last digit."""
    file = ordinary_files.write(folder, seed)
    height, diameter = ordinary_files.HEIGHT, ordinary_files.DIAMETER
    sample = sample_of(folder, file.name, file.stated, height, diameter)
    readings = sample.measurements
    whole = 1.0 if readings[0].observable == "sedimentation_ratio" else height
    found = [(sample.times[one.place], one.value * one.si / whole) for one in readings]
    found.sort(key=lambda one: (one[0], -one[1]))
    assert len(found) == len(file.times), file.told
    times, ratios = np.array(found).T
    # Exact but for the rounding of units, of times of 1e6 s and ratios of 1.
    np.testing.assert_allclose(times, file.times, rtol=1e-12, atol=1e-9, err_msg=file.told)
    np.testing.assert_allclose(ratios, file.ratios, rtol=0.0, atol=1e-12, err_msg=file.told)


@pytest.mark.parametrize("seed", range(ORDINARY))
def test_an_ordinary_file_is_read_with_its_numbers(seed, tmp_path):
    if seed % ordinary_files.EVERY_WORKBOOK == ordinary_files.EVERY_WORKBOOK - 1:
        pytest.importorskip("openpyxl")
    refuse_other_numbers(tmp_path, seed)


@pytest.mark.slow
def test_many_more_ordinary_files_are_read(tmp_path):
    pytest.importorskip("openpyxl")
    for seed in range(ORDINARY, ORDINARY + MORE):
        refuse_other_numbers(tmp_path, seed)


def test_the_ordinary_files_are_of_all_kinds(tmp_path):
    """Every delimiter, encoding, unit of time and form of height is among the sixty."""
    pytest.importorskip("openpyxl")
    files = [ordinary_files.write(tmp_path, seed) for seed in range(ORDINARY)]
    told = "\n".join(one.told for one in files)
    for form in (*ordinary_files.TIMES, *ordinary_files.HEIGHTS):
        name = getattr(form, "name", None) or form.names[0]
        assert re.search(rf"\b{re.escape(name)}, ", told), name
    for delimiter in ordinary_files.DELIMITERS:
        assert repr(delimiter) in told
    contents = {(tmp_path / one.name).read_bytes() for one in files}
    assert len(contents) == ORDINARY
    assert sum(one.startswith(b"\xff\xfe") for one in contents) > 3  # UTF-16
    assert sum(one.startswith(b"\xef\xbb\xbf") for one in contents) > 3
    assert sum(one.startswith(b"PK") for one in contents) > 5


MISTAKES = wrong_files.mistakes()


def test_there_are_sixty_mistakes():
    assert len({one.name for one in MISTAKES}) == len(MISTAKES) >= 60


@pytest.mark.parametrize("mistake", [pytest.param(one, id=one.name) for one in MISTAKES])
def test_a_wrong_file_is_refused_in_one_line(mistake, tmp_path):
    file = wrong_files.write(tmp_path, mistake)
    with pytest.raises(mrjax.InputError) as refused:
        sample_of(tmp_path, file, mistake.stated, mistake.height, mistake.tube_diameter)
    said = str(refused.value)
    assert len(said) <= 400 and said.isprintable()
    assert os.path.basename(file) in said
    without_folder = said.replace(str(tmp_path), "")
    for word in mistake.named:
        assert word in without_folder, said
    assert REMEDY.search(without_folder.partition(file)[2]), said


def test_the_file_without_mistakes_is_read(tmp_path):
    (tmp_path / "right.csv").write_bytes(wrong_files.table(wrong_files.RIGHT))
    sample = sample_of(tmp_path, "right.csv", {}, 0.4, 0.03)
    assert [one.value for one in sample.measurements] == [
        float(row[1]) for row in wrong_files.RIGHT[1:]
    ]


@pytest.mark.parametrize(
    "content",
    [
        "t (min),h/h0 [-]\n0,1\n10,0.9\n",
        "t (min),ratio\nmin,-\n0,1\n10,0.9\n",
        "t_[min]  H(T)_(mm)\n0  400\n10  360\n",
        "time\tsupernatant\n\t%\n0 min\t0\n10 min\t10\n",
        "time (min),sedimentation percentage\n0,100\n10,90\n",
    ],
)
def test_a_rare_form_is_read_with_its_numbers(content, tmp_path):
    """Of the full height at once, and of nine tenths after ten minutes."""
    (tmp_path / "rare.csv").write_text(content)
    sample = sample_of(tmp_path, "rare.csv", {}, 0.4, None)
    whole = 1.0 if sample.measurements[0].observable == "sedimentation_ratio" else 0.4
    ratios = [one.value * one.si / whole for one in sample.measurements]
    assert [sample.times[one.place] for one in sample.measurements] == pytest.approx([0.0, 600.0])
    assert ratios == pytest.approx([1.0, 0.9])
