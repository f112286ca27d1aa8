"""Sizes of an environment, of packages that are made up."""

import pytest

from tests.studies.benchmarks import size

MEGABYTES = {"mrjax": 1, "jax": 20, "jax-md": 3, "flax": 40, "vtk": 500, "other": 6}
REQUIRES = {
    "mrjax": ["jax>=0.8", "jax-md", 'vtk; extra == "test"', 'mrjax[more]; extra == "test"'],
    "jax-md": ["jax", "flax", "nowhere"],
    "flax": ["jax", 'other; python_version < "3"'],
}


@pytest.fixture
def folder(tmp_path):
    for name, megabytes in MEGABYTES.items():
        described = tmp_path / f"{name.replace('-', '_')}-1.0.dist-info"
        described.mkdir()
        lines = ["Metadata-Version: 2.1", f"Name: {name}", "Version: 1.0"]
        lines += [f"Requires-Dist: {one}" for one in REQUIRES.get(name, [])]
        (described / "METADATA").write_text("\n".join(lines) + "\n")
        (described / "RECORD").write_text(f"{name}.bin,,\n{name}.bin,,\n{name}.gone,,\n")
        with (tmp_path / f"{name}.bin").open("wb") as file:
            file.truncate(megabytes * 10**6)
    return str(tmp_path)


def test_sizes_are_of_what_needs_them(folder):
    lines = size.text(folder).splitlines()
    found = {line[:32].strip(): line[32:].strip() for line in lines}
    assert found["all packages"] == "570 MB"
    assert found["mrjax and what it needs"] == "64 MB"
    assert found["of these only for jax-md"] == "43 MB"
    assert found["more for the tests"] == found["of these vtk"] == "500 MB"
    assert found["flax"] == "40 MB, for jax-md" and found["jax"] == "20 MB, for mrjax"
    assert found["vtk"] == "500 MB, for tests" and found["other"] == "6 MB, for none of these"
