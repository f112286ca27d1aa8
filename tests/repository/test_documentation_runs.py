"""What the pages show is done: code and commands run, files are read, outputs come out.

`tests.builders.pages` has the comments that a page can put above a block.
"""

import contextlib
import io
import json
import re
import shlex
import sys
import tomllib
import types
from collections.abc import Iterator
from pathlib import Path

import click
import jax
import pytest
from click.testing import CliRunner
from pydantic import ValidationError

import calibrate.__main__
import mrjax.__main__
from calibrate.experiment import curve, local_table, velocity_table
from calibrate.experiment.readings.sheet import CurveSheet, LocalSheet, VelocitiesSheet
from calibrate.experiment.sheets import ExperimentSheet
from mrjax.cli import environment
from mrjax.recipe import sheets
from mrjax.recipe.suspension import Suspension
from tests.builders import ROOT, pages
from tests.builders.pages import Block

RUN = ("python", "sh")
READ = ("toml", "csv", "json")
SHOWN = ("text",)
OURS = {
    "mrjax": mrjax.__main__.cli,
    "mrjax-calibrate": calibrate.__main__.cli,
    "calibrate": calibrate.__main__.cli,  # python -m calibrate
}
CHEAP = {"new", "check", "--new", "--help", "--version"}
"""Words of commands that take a second."""
OTHERS = {".", "source", "cd", "eval", "git", "venv", "pip", "jupyter", "pytest"}
OTHERS |= {"ruff", "mypy", "lint-imports", "sphinx", ".ci/run"}
"""Programs of others in the pages, which are not run here."""
BUNDLED = {
    "recipe": "mrjax.recipe.bundled",
    "predict": "mrjax.recipe.bundled",
    "experiment": "calibrate.experiment.bundled",
}
"""Arguments that are the name of what is bundled, or a TOML file, and the packages of those."""
NAMED = re.compile(r"`((?:tests|mrjax|calibrate|docs|notebooks)/[\w./-]+)`")
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")

BLOCKS = [block for page in pages.PAGES for block in pages.blocks(page)]
every_page = pytest.mark.parametrize("page", pages.PAGES, ids=pages.name)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.place)
def test_a_block_says_what_it_is(block):
    known = block.language in (*RUN, *READ, *SHOWN)
    directive = re.fullmatch(r"\{(?!code)[\w-]+\}", block.language)
    assert known or directive, (
        f"{block.place}: ```{block.language}: write one of {', '.join((*RUN, *READ))}, which are "
        "checked, or text, which is shown or is the output of the block above it"
    )
    assert set(block.marks) <= pages.MARKS, f"{block.place}: the comments are {pages.MARKS}"
    for mark in ("not run", "file"):
        assert block.marks.get(mark, "given"), f"{block.place}: <!-- {mark}: ... --> what?"


@every_page
def test_files_that_a_page_names_are_there(page):
    named = re.findall(NAMED, page.read_text("utf-8"))
    assert not [name for name in named if not (ROOT / name).exists()]


@every_page
def test_what_a_page_shows_is_done(page, tmp_path, monkeypatch):
    """Up to the first block that is slow."""
    blocks = pages.blocks(page)
    slow = [place for place, block in enumerate(blocks) if "slow" in block.marks]
    do(blocks[: slow[0]] if slow else blocks, tmp_path, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", sorted({one.page for one in BLOCKS if "slow" in one.marks}), ids=pages.name
)
def test_what_a_page_shows_is_done_to_its_end(page, tmp_path, monkeypatch):
    do(pages.blocks(page), tmp_path, monkeypatch)


def do(blocks: list[Block], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs the blocks of a page in a folder, in one namespace, and compares what they print."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(environment, "start_jax", lambda *_, **__: None)
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
        for block in blocks:
            if "file" in block.marks:
                Path(block.marks["file"]).write_text(block.text, "utf-8")
            if block.language == "python":
                run_python(block, module)
            elif block.language == "sh" and "not run" not in block.marks:
                run_commands(block, monkeypatch)


def run_python(block: Block, module: types.ModuleType) -> None:
    # Its lines are numbered as on the page.
    code = compile("\n" * block.line + block.text, str(block.page), "exec")
    if "not run" in block.marks:
        return
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(code, vars(module))
    compare(block, printed.getvalue())


def run_commands(block: Block, monkeypatch: pytest.MonkeyPatch) -> None:
    said, all_run = "", True
    for words, target in commands(block):
        run = "parsed" not in block.marks and ("slow" in block.marks or CHEAP & set(words))
        all_run &= bool(run)
        with monkeypatch.context() as patched:
            if not run:
                only_parse(OURS[words[0]], patched)
            result = CliRunner().invoke(OURS[words[0]], words[1:], catch_exceptions=False)
        assert result.exit_code == 0, f"{block.place}: {shlex.join(words)}: {result.output}"
        if target:
            Path(target).write_text(result.stdout, "utf-8")
        else:
            said += result.output
    if block.output is not None and all_run:
        compare(block, said)
    assert all_run or block.output is None or "parsed" in block.marks, (
        f"{block.place}: its output is not compared: a command in it takes long; write "
        "<!-- slow --> above it, or <!-- parsed --> where it is longer than a minute"
    )


def commands(block: Block) -> Iterator[tuple[list[str], str | None]]:
    """The commands of ours in a shell block, and the files that their outputs go to."""
    for line in block.text.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        words: list[str] = []
        for word in [*lexer, ";"]:
            if not set(word) <= set(";&|"):
                words.append(word)
            elif words:
                yield from ours(block, words)
                words = []


def ours(block: Block, words: list[str]) -> Iterator[tuple[list[str], str | None]]:
    """The command without folders, if it is ours; refuses one that nobody knows."""
    target = words[-1] if words[-2:-1] == [">"] else None
    words = words[:-2] if target else words
    while re.match(r"\w+=", words[0]) and len(words) > 1:
        words = words[1:]
    program = words[0] if words[0] in OTHERS else words[0].rpartition("/")[2]
    if re.fullmatch(r"python3?", program) and words[1:2] == ["-m"]:
        program, words = words[2], words[2:]
    if program in OURS:
        yield [program, *words[1:]], target
        return
    assert program in OTHERS, (
        f"{block.place}: {program}: is no command that the tests know; add it to OTHERS in "
        "tests/repository/test_documentation_runs.py, or write <!-- not run: why --> above it"
    )
    for word in words:
        if word.startswith("tests/"):
            assert (ROOT / word.partition("::")[0]).exists(), f"{block.place}: {word}: is not there"


def only_parse(command: click.Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves of a command its parser, and of files to be read their names."""
    for one in [command, *getattr(command, "commands", {}).values()]:
        if not isinstance(one, click.Group):
            monkeypatch.setattr(one, "callback", refuse_unknown_names)


def refuse_unknown_names(**given) -> None:
    for argument, package in BUNDLED.items():
        value = given.get(argument)
        known = sheets.bundled(package)
        assert value is None or value in known or value.endswith(".toml"), f"{value}: not bundled"


def compare(block: Block, printed: str) -> None:
    """Holds what a block printed against its output on the page.

    There `...` stands for anything. Numbers keep to the last digit that the page has, as another
    machine may round otherwise; whole numbers are equal.
    """
    stated, printed = (block.output or "").strip(), printed.strip()
    assert stated or not printed, f"{block.place}: prints this; put it below, as text:\n{printed}"
    assert agrees(stated, printed), f"{block.place}: prints\n{printed}\nand not\n{stated}"


def agrees(stated: str, printed: str) -> bool:
    pieces = re.split(rf"(\.\.\.|{NUMBER.pattern}|\s+)", stated)
    patterns = {"...": r"(?:.|\n)*"}
    pattern = "".join(
        patterns.get(piece)
        or (r"\s+" if piece.isspace() else f"({NUMBER.pattern})" if NUMBER.fullmatch(piece) else "")
        or re.escape(piece)
        for piece in pieces
    )
    match = re.fullmatch(pattern, printed)
    numbers = filter(NUMBER.fullmatch, pieces)
    return match is not None and all(map(same_number, numbers, match.groups()))


def same_number(stated: str, printed: str) -> bool:
    """True of a number with the digits of another, the last of which may be one off."""
    if not {".", "e"} & set(stated):
        return float(stated) == float(printed)
    unit, finer = last_place(stated), last_place(printed)
    return abs(float(stated) - float(printed)) <= 0.5001 * (unit + min(unit, finer))


def last_place(number: str) -> float:
    """One in the last digit of a number."""
    digits, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def test_numbers_are_compared_at_the_digits_of_the_page():
    assert agrees("v = 9.116 mm/day, N = 314", "v = 9.117 mm/day, N = 314")
    assert agrees("v = 9.1 mm/day\n...\n3 more", "v = 9.1163 mm/day\na\nb\n3 more")
    assert agrees("1.0e-6", "1.1e-06") and not agrees("1.0e-6", "1.2e-6")
    assert not agrees("v = 9.116", "v = 9.118") and not agrees("0.3334", "0.33333")
    assert not agrees("N = 314", "N = 315")
    assert not agrees("v = 9.116", "u = 9.116") and not agrees("a", "a b")


@pytest.mark.parametrize(
    "block", [one for one in BLOCKS if one.language in READ], ids=lambda block: block.place
)
def test_a_file_is_read(block, tmp_path):
    if "not run" not in block.marks:
        {"toml": read_toml, "csv": read_csv, "json": read_json}[block.language](block, tmp_path)


def read_toml(block: Block, _folder: Path) -> None:
    """Refuses a wrong key or value of a recipe, an experiment, or a part of one."""
    table = tomllib.loads(block.text)
    model = ExperimentSheet if {"sample", "parameter"} & set(table) else Suspension
    try:
        model.model_validate(table)
    except ValidationError as error:
        faults = [one for one in error.errors() if "missing" not in one["type"] + one["msg"]]
        assert not faults, f"{block.place}: {sheets.first_fault(model, error)}"


def read_csv(block: Block, folder: Path) -> None:
    """Refuses what is no curve, no table of velocities and no table of concentrations."""
    (folder / "readings.csv").write_text(block.text, "utf-8")
    file, recipe = {"file": "readings.csv"}, mrjax.Recipe.load("case2")
    faults = []
    for read in (
        lambda: curve.read(CurveSheet(**file), folder, 1.0, 0.03),
        lambda: velocity_table.read(VelocitiesSheet(**file), folder, recipe),
        lambda: local_table.read_all([LocalSheet(**file, height=0.1)], folder, recipe, 1.0),
    ):
        try:
            return read()
        except mrjax.InputError as error:
            faults.append(str(error))
    pytest.fail(f"{block.place}: " + "; ".join(faults))


def read_json(block: Block, _folder: Path) -> None:
    json.loads(block.text)
