"""Readers: time in proportion to a file, pipes and devices refused, one short line for all else."""

import os
import socket
import subprocess
import sys
import threading
import time

import pytest

import mrjax
from calibrate import Experiment
from calibrate.experiment import curve
from calibrate.experiment.curve import CurveSheet
from mrjax import Recipe
from mrjax.io import reading
from mrjax.recipe import toml_limits
from tests.builders import ROOT

SHEET = {"file": "curve.csv", "time_unit": "day", "unit": "mm", "standard_deviation": 0.5}
READERS = {
    "recipe": Recipe.load,
    "experiment": Experiment.load,
    "curve": lambda path: curve.read(CurveSheet(**{**SHEET, "file": path.name}), path.parent),
}


def refusal(reader, path) -> str:
    with pytest.raises(mrjax.InputError) as error:
        reader(path)
    message = str(error.value)
    assert message.isprintable() and len(message) <= 400
    return message


# What is no regular file ------------------------------------------------------------------------


@pytest.fixture
def others(tmp_path):
    """Paths of what is no file, by what a refusal says of each."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "link.toml").symlink_to("pipe.toml")
    sock = socket.socket(socket.AF_UNIX)
    sock.bind(str(tmp_path / "socket.toml"))
    (tmp_path / "null.toml").symlink_to(os.devnull)
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    yield {
        "pipe.toml": "is a pipe",
        "link.toml": "is a pipe",
        "socket.toml": "is a socket",
        "null.toml": "is a device",
        "endless.toml": "is a device",
    }
    sock.close()


@pytest.mark.parametrize("kind", READERS)
def test_pipes_sockets_and_devices_are_refused_at_once(kind, others, tmp_path):
    """In a process of its own, as an open that waits for a writer cannot be interrupted."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import mrjax\n"
        "from tests.io import test_reading\n"
        "from pathlib import Path\n"
        "for name in sys.argv[3:]:\n"
        "    print(test_reading.refusal(test_reading.READERS[sys.argv[2]], Path(name)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, ROOT, kind, *others],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    for name, said, line in zip(others, others.values(), done.stdout.splitlines(), strict=True):
        assert line == f"{name}: {said}, which is not read; give a file"


def test_what_becomes_a_pipe_after_it_was_looked_at_is_not_waited_for(tmp_path, monkeypatch):
    path = tmp_path / "sheet.toml"
    path.touch()
    looked = os.stat(path)
    path.unlink()
    os.mkfifo(path)
    monkeypatch.setattr(reading.os, "stat", lambda _path, **_: looked)
    rescued = []
    rescue = threading.Timer(20.0, lambda: (rescued.append(True), path.open("wb").close()))
    rescue.start()
    with pytest.raises(mrjax.InputError, match=r"is a pipe"), reading.opened(path):
        pass
    rescue.cancel()
    assert not rescued


def test_an_experiment_may_name_no_device(tmp_path):
    (tmp_path / "e.toml").write_text(EXPERIMENT.replace('"case2"', '"/dev/zero"'))
    assert "recipe /dev/zero: is a device" in refusal(Experiment.load, tmp_path / "e.toml")
    (tmp_path / "e.toml").write_text(EXPERIMENT.replace('"c.csv"', '"/dev/stdin"'))
    code = "import sys, calibrate; calibrate.Experiment.load(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "e.toml"],
        stdin=subprocess.PIPE,  # nothing ever comes from it
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stderr.splitlines()[-1].endswith(
        "/dev/stdin: is a pipe, which is not read; give a file"
    )


EXPERIMENT = """
name = "e"
[[sample]]
name = "A"
recipe = "case2"
height = 0.1
curve = {file = "c.csv", time_unit = "day", unit = "mm", standard_deviation = 1.0}
[[parameter]]
name = "f_s"
median = 1.1
"""


# Time in proportion -----------------------------------------------------------------------------

SMALL = 'name = "small"\n'
EXCESS = {
    "dotted keys": (SMALL + ".".join("a" * 20_000) + " = 1", "line 2: a key has more than 16"),
    "with blanks": (SMALL + " \t.\t".join("a" * 20_000) + " = 1", "more than 16 parts"),
    "quoted keys": (SMALL + ".".join(['"=,{"'] * 20_000) + " = 1", "more than 16 parts"),
    "keys of digits": (SMALL + ".".join("1" * 20_000) + " = 1", "more than 16 parts"),
    "after a string": ("a = {b = '''x'''''" + ", " + ".".join("c" * 20_000) + " = 1}", "16 parts"),
    "after text": ('a = {b = """x"""""' + ", " + ".".join("c" * 20_000) + " = 1}", "16 parts"),
    "a header": ("[" + ".".join("a" * 20_000) + "]", "line 1: a key has more than 16 parts"),
    "lists": (SMALL + "q = " + "[" * 50_000 + "]" * 50_000, "tables are nested more than 16 deep"),
    "tables": (SMALL + "q = " + "{a = " * 10_000 + "1" + "}" * 10_000, "tables are nested"),
    "keys": ("".join(f"k{i} = 1\n" for i in range(70_000)), "more than 20000 keys"),
    "headers": ("[[sample]]\n" * 90_000, "more than 20000 keys, tables and lists"),
}  # fmt: skip


@pytest.mark.parametrize("name", EXCESS)
def test_what_no_sheet_needs_is_refused_before_it_is_read(name, tmp_path, monkeypatch):
    content, said = EXCESS[name]
    monkeypatch.setattr("tomllib.loads", lambda _content: pytest.fail("was read all the same"))
    (tmp_path / "sheet.toml").write_text(content)
    message = refusal(Recipe.load, tmp_path / "sheet.toml")
    assert said in message and message.startswith(f"{tmp_path / 'sheet.toml'}: ")


@pytest.mark.parametrize(
    "content",
    [
        'a = "[[[[[[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s"',
        "a = '[[[[[[[[[[[[[[[[[[[[[[ \\' # a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s",
        'a = """\n"[[[[[[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s\\""""',
        "# [[[[[[[[[[[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r.s",
        "a = [" + "1.5e-6, " * 3000 + "]",
        "a.b.c.d = 1\n[e.f.g.h]\ni = {j.k.l = [[1.0, 2.0], [3.0]]}",
    ],
)
def test_what_a_sheet_may_hold_passes(content):
    toml_limits.refuse_excess(content)


LARGE = {
    "a string of escapes": 'name = "' + "\\t" * 400_000 + '"',
    "a string without end": 'name = "' + '\\"' * 450_000,
    "text without end": 'name = """' + '\\"' * 450_000,
    "quotation marks": '"\n' * 400_000,
    "keys of sixteen parts": "".join(
        f"k{i}.a.b.c.d.e.f.g.h.i.j.k.l.m.n.o = 1\n" for i in range(19_000)
    ),
    "unknown keys": "".join(f"k{i} = 1\n" for i in range(19_000)),
    "a key of a megabyte": "x" * 990_000 + " = 1",
    "a quoted key of a megabyte": '"' + "\\t" * 490_000 + '" = 1',
    "diameters": "[particle]\ndiameter = [" + "1.5e-6," * 120_000 + "'x']",
    "digits": "name = " + "9" * 990_000,
    "hexadecimal digits": "name = 0x" + "f" * 900_000,
    "new lines": "\n" * 990_000,
    "words": "a " * 490_000,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_a_megabyte_takes_seconds_and_its_refusal_is_short(name, tmp_path):
    (tmp_path / "sheet.toml").write_text(LARGE[name])
    began = time.perf_counter()
    refusal(Recipe.load, tmp_path / "sheet.toml")
    assert time.perf_counter() - began < 10.0  # the old readers: minutes to hours


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1," + "9" * 200_000, "field larger than field limit"),
        ('1,"' + "x" * 100_000 + '"', "mudline = 'xxx"),
        ("," * 200_000, "200001 cells for 2 columns"),
    ],
)
def test_cells_without_measure_are_refused_in_a_short_line(row, said, tmp_path):
    (tmp_path / "curve.csv").write_text(f"time,mudline\n{row}\n")
    assert said in refusal(READERS["curve"], tmp_path / "curve.csv")


def test_a_curve_of_more_points_than_anyone_reads_is_refused(tmp_path):
    rows = "".join(f"{i},1\n" for i in range(100_002))
    (tmp_path / "curve.csv").write_text(f"time,mudline\n{rows}")
    message = refusal(READERS["curve"], tmp_path / "curve.csv")
    assert "line 100002: comes after 100000 rows; give fewer readings" in message
    # The first fault ends the reading: nobody asks for the rest.
    (tmp_path / "curve.csv").write_text("time,mudline\n1,x\n" + '"\n' * 100_000)
    assert "line 2: mudline = 'x'" in refusal(READERS["curve"], tmp_path / "curve.csv")


# Lengths ----------------------------------------------------------------------------------------

LONG = "é" * 3000


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('name = "A"', f'name = "{LONG}"', "must be at most 200 characters long"),
        ('name = "e"', f'name = "{LONG}"', "must be at most 200 characters long"),
        ('name = "f_s"', f'name = "{LONG}"', "must be at most 200 characters long"),
        ('"case2"', f'"{"x" * 300}"', "cannot be read (File name too long)"),
        ('"case2"', f'"{"../" * 320}x"', "no such file"),
        ('"case2"', f'"{"../" * 2000}"', "must be at most 1000 characters long"),
        ('"c.csv"', f'"{"x" * 300}"', "cannot be read (File name too long)"),
        ("median", f'samples = ["{LONG}"]\nmedian', "must be at most 200 characters long"),
        ("median", f'samples = ["{LONG[:190]}"]\nmedian', "no such sample; known: A"),
        ("median", f'"{LONG}" = 1\nmedian', "unknown key"),
        ('"day"', f'"{LONG}"', "must be one of s, min, h, day"),
        ('name = "A"', 'name = " "', "must be one line of text"),
        ('name = "A"', 'name = "\\u202e"', "must be one line of text"),
    ],
)
def test_messages_are_short_whatever_is_long(old, new, said, tmp_path):
    assert old in EXPERIMENT
    (tmp_path / "e.toml").write_text(EXPERIMENT.replace(old, new, 1))
    assert said in refusal(Experiment.load, tmp_path / "e.toml")


def test_a_long_path_leaves_the_remedy_in_its_message(tmp_path):
    path = tmp_path.joinpath(*["d" * 200] * 10, "sheet.toml")
    assert refusal(Recipe.load, path).endswith(
        "sheet.toml: no such file, and no bundled recipe; give a TOML file or one of case1, case2, "
        "case3"
    )


def test_many_samples_are_refused_before_each_is_looked_at(tmp_path):
    (tmp_path / "e.toml").write_text(EXPERIMENT + '[[sample]]\nname = "B"\n' * 5000)
    message = refusal(Experiment.load, tmp_path / "e.toml")
    assert "sample" in message and "at most 1000" in message


def test_a_recipe_of_many_samples_is_read_once(tmp_path, monkeypatch):
    recipes, parameters = [], []
    load, of = Recipe.load, Recipe.parameters
    monkeypatch.setattr(Recipe, "load", lambda source: recipes.append(source) or load(source))
    monkeypatch.setattr(Recipe, "parameters", lambda self: parameters.append(self) or of(self))
    monkeypatch.setattr("calibrate.experiment.plausibility.oddities", lambda *_: ())
    sample = '[[sample]]\nname = "{}"\nrecipe = "case2"\nfinal_ratio = {{value = 0.8, ' + (
        "standard_deviation = 0.1}}\n"
    )
    fitted = '[[parameter]]\nname = "{}"\nmedian = 1.1\n'
    (tmp_path / "e.toml").write_text(
        'name = "e"\n'
        + "".join(map(sample.format, range(300)))
        + "".join(map(fitted.format, ("f_s", "f_v", "viscosity")))
    )
    assert len(Experiment.load(tmp_path / "e.toml").samples) == 300
    assert (len(recipes), len(parameters)) == (1, 1)
