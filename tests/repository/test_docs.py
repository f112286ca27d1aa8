"""The documentation: no public name, no equation and no argument is left out, no name is stale."""

import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType

import pytest

import calibrate
import mrjax
from mrjax.laws import dimensionless
from tests.builders import ROOT

DOCS = ROOT / "docs"
REFERENCE = "".join(page.read_text("utf-8") for page in sorted((DOCS / "reference").glob("*.rst")))
EQUATIONS = (DOCS / "explanations" / "equations.md").read_text("utf-8")


def resolved(name: str):
    """What a full name stands for; of a function and a module of one name, the function."""
    package, _, rest = name.partition(".")
    return pkgutil.resolve_name(name if "." in rest else f"{package}:{rest}")


def numbered(text: str) -> set[int]:
    """The equations that a text names: `Eq. 4`, `Eqs. 3, 9, 11, 20-23`."""
    found = set()
    for listed in re.findall(r"Eqs?\. ([\d, -]+(?:and \d+)?)", text):
        for first, last in re.findall(r"(\d+)(?:-(\d+))?", listed):
            found |= set(range(int(first), int(last or first) + 1))
    return found


@pytest.mark.parametrize("package", [mrjax, calibrate])
def test_every_public_name_is_in_the_reference_once(package):
    documented = re.findall(rf"^\.\. (?:auto|py:)\w+:: {package.__name__}\.(\w+)$", REFERENCE, re.M)
    assert sorted(documented) == sorted(package.__all__)


def test_names_that_a_module_has_too_are_those_of_functions():
    for name in re.findall(r"^\.\. autofunction:: (\S+)$", REFERENCE, re.M):
        assert callable(resolved(name)) and not isinstance(resolved(name), ModuleType), name


def test_every_equation_of_the_paper_is_mapped_once():
    rows = re.findall(r"^\| (\d+) \|", EQUATIONS, re.M)
    assert rows == [str(number) for number in range(1, 30)]


def test_equations_and_functions_name_each_other():
    for row in re.findall(r"^\| \d+ \|.*", EQUATIONS, re.M):
        _, number, _, functions, form, _ = (cell.strip() for cell in row.split("|"))
        names = re.findall(r"\{py:(?:func|class)\}`([\w.]+)`", functions)
        assert names
        told = set()
        for name in names:
            function = resolved(name)
            assert callable(function)
            told |= numbered(function.__doc__ + inspect.getmodule(function).__doc__)
        assert int(number) in told, f"{names} do not say that they are Eq. {number}"
        if not form.startswith(("as printed", "reduced")):
            anchor = re.fullmatch(r"\[corrected\]\(#([\w-]+)\)", form)[1]
            assert anchor in {
                re.sub(r"[^\w-]", "", heading.lower().replace(" ", "-"))
                for heading in re.findall(r"^### (.*)", EQUATIONS, re.M)
            }


def test_every_number_with_a_bound_is_on_the_page_of_validity():
    page = (DOCS / "explanations" / "validity.md").read_text("utf-8")
    parameters = mrjax.Recipe.load("case2").parameters()
    numbers = dimensionless.numbers(parameters, mrjax.terminal_velocity(parameters))
    for one in numbers:
        [row] = [line for line in page.splitlines() if f"{one.name} number $" in line]
        assert one.holds in row
        assert f"{float(f'{one.value:.1g}'):g}".replace("1000", "1e3").replace("e-0", "e-") in row


def public_functions() -> list:
    """Functions of the packages, and methods of their classes, by full name."""
    found = []
    for package in (mrjax, calibrate):
        for name in package.__all__:
            of = getattr(package, name)
            inside = vars(of) if inspect.isclass(of) else {}
            own = [one for one in inside if not one.startswith("_")]
            members = [(f"{name}.{one}", getattr(of, one)) for one in own]
            found += [
                pytest.param(function, id=f"{package.__name__}.{label}")
                for label, function in [(name, of), *members]
                if inspect.isfunction(function) or inspect.ismethod(function)
            ]
    return found


@pytest.mark.parametrize("function", public_functions())
def test_everything_public_has_its_types(function):
    signature = inspect.signature(function)
    arguments = [one for one in signature.parameters.values() if one.name != "self"]
    assert inspect.Signature.empty not in {one.annotation for one in arguments}
    assert signature.return_annotation is not inspect.Signature.empty


@pytest.mark.parametrize("package", [mrjax, calibrate])
def test_types_are_shipped(package):
    assert (Path(package.__file__).parent / "py.typed").exists()


def described(doc: str) -> list[str]:
    """The arguments that a docstring describes."""
    section = doc.split("Args:\n")[1].split("\n\n")[0]
    listed = re.findall(r"^  ([a-z_, ]+):", section, re.M)
    return [one for line in listed for one in line.split(", ")]


@pytest.mark.parametrize("function", public_functions())
def test_arguments_are_all_described_or_the_summary_does(function):
    doc = inspect.getdoc(function)
    arguments = [one for one in inspect.signature(function).parameters if one != "self"]
    if "Args:" not in doc:
        assert len(arguments) <= 1, "more than one argument, and none is described"
        return
    names = described(doc)
    if names[-1] == "options" and "`RunOptions`" in doc:  # which has them in its own docstring
        names[-1:] = described(inspect.getdoc(mrjax.RunOptions))
    assert names == arguments
