"""What the README promises beside its blocks of code: numbers, rooms, closures, the version."""

import re

import pytest

import mrjax
from mrjax.laws import drag
from tests.builders import ROOT
from tests.builders.pages import REPRODUCTION, reproduced_rows

README = (ROOT / "README.md").read_text(encoding="utf-8")
ROOMS = (ROOT / "docs/explanations/rooms.md").read_text(encoding="utf-8")
RECIPE_FILE = (ROOT / "docs/reference/recipe_file.md").read_text(encoding="utf-8")


def test_there_are_exactly_two_set_up_commands():
    section = README.split("## Set up")[1].split("\n## ")[0]
    commands = re.findall(r"```sh\n(.*?)\n```", section, flags=re.S)
    assert len(commands) == 2 == len([line for c in commands for line in c.splitlines()])
    assert "mrjax-calibrate fang2005 --out fang2005" in commands[0]
    assert "-m pytest" in commands[1]


def test_the_readme_is_a_door_and_shows_ten_of_the_reproduced_numbers():
    assert len(README.splitlines()) <= 150
    shown, all_rows = map(reproduced_rows, (README, REPRODUCTION))
    assert len(shown) == 10 and set(shown) < set(all_rows)


def test_every_file_is_in_a_room_of_the_table():
    rows = re.findall(r"^\| ((?:`[\w/.]+`(?:, )?)+) \| (.+) \|$", ROOMS, re.M)
    listed = {name for names, _ in rows for name in re.findall(r"`([\w.]+/[\w/.]*)`", names)}
    assert all((ROOT / name).exists() for name in listed)
    for package in ("mrjax", "calibrate"):
        for path in (ROOT / package).rglob("*.py"):
            name = path.relative_to(ROOT)
            in_room = any(f"{folder.as_posix()}/" in listed for folder in name.parents)
            assert in_room or path.name == "__init__.py" or name.as_posix() in listed, name
    rooms = [path.parent for path in (ROOT / "mrjax").glob("*/__init__.py")]
    assert {f"mrjax/{room.name}/" for room in rooms} <= listed
    assert len(rooms) <= 18


def test_every_closure_is_in_the_table_of_closures():
    for name in drag.CLOSURES:
        assert f"| `{name}` |" in RECIPE_FILE
    assert float(drag.volume_fraction_at(0.8)) == pytest.approx(0.368, abs=5e-4)


def test_the_version_is_the_same_everywhere():
    version = re.search(r'^version = "(.*)"', (ROOT / "pyproject.toml").read_text(), re.M)[1]
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text()
    assert mrjax.__version__ == version
