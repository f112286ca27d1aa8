"""The notebooks run as they are, in a fresh kernel of this interpreter, and check what they say."""

import re

import nbformat
import pytest
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

from tests.builders import ROOT

FOLDER = ROOT / "notebooks"
README = (ROOT / "README.md").read_text(encoding="utf-8")
GETTING_STARTED = (ROOT / "docs/getting_started.md").read_text(encoding="utf-8")
NAMES = (
    "first_settling",
    "paper_reproduced",
    "gradients",
    "fit_your_own_data",
    "design_a_recipe",
    "your_own_force",
    "sizes",
    "flocs",
    "thickener",
    "layer_thickness",
)
QUICK = ("fit_your_own_data",)
"""What the others show, tests of their own guard in an ordinary run."""
LONGEST = 600
"""Of a cell, s; a whole notebook takes under a minute on two cores that are its own."""


class Kernels(AsyncKernelManager):
    """Of this interpreter, whatever kernels a user has installed under the same name."""

    def __init__(self, **options):
        super().__init__(kernel_spec_manager=KernelSpecManager(kernel_dirs=[]), **options)


def read(name):
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_these_are_all_of_them_and_getting_started_lists_them():
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)
    for name in NAMES:
        assert f"[`{name}`](../notebooks/{name}.ipynb)" in GETTING_STARTED


@pytest.mark.parametrize("name", NAMES)
def test_it_is_kept_without_outputs_and_checks_its_result(name):
    notebook = read(name)
    nbformat.validate(notebook)
    for cell in code(notebook):
        assert cell.outputs == [] and cell.execution_count is None
    lines = [line for cell in code(notebook) for line in cell.source.splitlines()]
    assert any(line.startswith(("assert ", "np.testing.")) for line in lines)
    first = notebook.cells[0].source
    assert first.startswith("# ") and "**Question.**" in first
    text = "\n".join(cell.source for cell in notebook.cells)
    assert max(map(len, text.splitlines())) <= 100
    assert not re.search(r"(?<![\w.])/(home|tmp|Users)/", text)


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in NAMES],
)
def test_it_runs_through(name, tmp_path, monkeypatch):
    # No profile of a user's.
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path))
    notebook = read(name)
    client = NotebookClient(
        notebook,
        kernel_manager_class=Kernels,
        kernel_name="python3",
        timeout=LONGEST,
        resources={"metadata": {"path": FOLDER}},
    )
    client.execute()
    outputs = [output for cell in code(notebook) for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output.text for output in outputs if output.get("name") == "stderr"]


def test_what_is_held_against_the_readme_stands_there():
    (cell,) = [one for one in code(read("paper_reproduced")) if "velocities = {" in one.source]
    stated = re.findall(r'"case\d": ([\d.]+)', cell.source)
    assert len(stated) == 5
    section = README.split("## What it reproduces")[1].split("\n## ")[0]
    for number in stated:
        assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d])", section)
