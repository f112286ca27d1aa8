"""Names of users in every output: shown as they are, or refused; never read as another language."""

import json
import os
import pty
import re
import subprocess
import sys
import tomllib
import warnings
from dataclasses import fields, is_dataclass, replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import calibrate.__main__
import mrjax.__main__
from calibrate import Experiment, report
from calibrate.inference.identify import identify
from calibrate.inference.posterior import Posterior
from calibrate.inference.profile import profiles
from calibrate.problem.solve import fit_experiment
from calibrate.report import figures as fit_figures
from mrjax import Recipe, figures
from mrjax.cli import completion, exit_status, terminal
from mrjax.core import text
from mrjax.io import files
from tests.builders.hostile import NAMES, PRINTABLE, UNPRINTABLE

each_name = pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
ORDINARY = ("broken mathematics", "emoji", "as long as may be")
some_names = pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, id=kind, marks=[] if kind in ORDINARY else pytest.mark.slow)
        for kind, name in NAMES.items()
    ],
)


class Page(HTMLParser):
    """Elements with their attributes, and the text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple] = []
        self.text = ""
        self.of: dict[str, list[str]] = {"none": [""]}
        self.inside = "none"
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attributes):
        pictures = [
            (key, re.sub("^(data:image/png;base64,).*", r"\1", to)) for key, to in attributes
        ]
        self.elements.append((tag, pictures))
        self.of.setdefault(tag, []).append("")
        self.inside = tag

    def handle_endtag(self, _tag):
        self.inside = "none"

    def handle_data(self, data):
        self.text += data
        self.of[self.inside][-1] += data

    def handle_comment(self, data):
        self.elements.append(("comment", data))

    def handle_pi(self, data):
        self.elements.append(("instruction", data))

    def unknown_decl(self, data):
        self.elements.append(("declaration", data))


# The doors --------------------------------------------------------------------------------------


@each_name
def test_markdown_shows_the_name_and_nothing_else(name):
    read = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])
    shown = text.printable(name)
    for before, after, tags in (("", "", ["p"]), ("# ", "", ["h1"]), ("so ", " it is", ["p"])):
        page = Page(read.render(before + text.in_markdown(name) + after))
        assert [tag for tag, _ in page.elements] == tags
        assert page.text == f"{before.strip('# ')}{' ' * (before == 'so ')}{shown}{after}\n"
    page = Page(read.render(text.in_code(name)))
    assert [tag for tag, _ in page.elements] == ["p", "code"] and page.of["code"] == [shown]
    table = files.markdown_table([name, "b"], [[name, text.in_code(name)], [1.5, -0.52]])
    page = Page(read.render(table))
    assert (page.of["th"], len(page.of["tr"])) == ([shown, "b"], 3)
    assert page.of["code"] == [shown]
    assert page.of["td"] == [shown, "", "1.5", "-0.52"]


@each_name
def test_html_shows_the_name_and_nothing_else(name):
    page = Page(f'<p title="{text.in_html(name)}">{text.in_html(name)}</p>')
    shown = text.printable(name)
    assert page.elements == [("p", [("title", shown)])] and page.text == shown


@each_name
def test_figures_show_the_name_and_no_mathematics(name):
    label = text.in_figure(name)
    assert not matplotlib.cbook.is_math_text(label) and not label.startswith("_")
    shown = label.replace("\\$", "$").removeprefix(" " * (label[:2] == " _"))
    assert shown == text.shortened(text.printable(name), 32)
    # Beside mathematics of others, as in the titles of a corner plot.
    figure = Figure(figsize=(3, 1))
    figure.text(0, 0.5, f"{label} = $1.2_{{-0.1}}^{{+0.1}}$")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph ")
        figure.canvas.draw()


@each_name
def test_a_terminal_gets_one_line_of_what_can_be_shown(name, capsys):
    terminal.echo(f"a {name} b")
    terminal.echo(name, err=True)
    for said in capsys.readouterr():
        assert said.count("\n") == 1 and said[:-1].isprintable()
    assert text.in_terminal("µ é \udcff", "ascii") == "\\xb5 \\xe9 \\udcff"


@each_name
def test_json_is_printable_and_the_same(name):
    for ascii_only in (False, True):
        said = files.as_json({name: [name]}, ascii_only)
        assert json.loads(said) == {name: [name]}
        assert all(line.isprintable() for line in said.split("\n"))
    assert said.isascii()


@each_name
def test_messages_are_one_short_line(name):
    for error in (mrjax.InputError, mrjax.SimulationError, mrjax.SystemRefusal):
        for message in (name, name * 100, f"{name}\n{name}", f"{'x' * 1000}: {name}; mend it"):
            line = str(error(message))
            assert line.isprintable() and len(line) <= 400
            assert str(error(error(message))) == line
        assert line.endswith("mend it")
    assert str(mrjax.InputError()) == ""


@pytest.mark.parametrize("name", PRINTABLE.values(), ids=PRINTABLE)
def test_toml_reads_the_name_back(name):
    assert tomllib.loads(f"a = {text.in_toml(name)}") == {"a": name}


def test_random_text_passes_every_door():
    draw = np.random.default_rng(0)
    letters = list("\\`*_[]<>&~$#|!(){}-+=.:;'\" a1w/@^%\té😀\u202e\x1b\r\n")
    read = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])
    for _ in range(2000):
        name = "".join(draw.choice(letters, draw.integers(1, 12)))
        if not name.strip():
            continue
        shown = text.printable(name)
        table = files.markdown_table(["a"], [[name], [text.in_code(name)]])
        page = Page(
            read.render(f"# {text.in_markdown(name)}\n\n{text.in_markdown(name)}\n\n{table}")
        )
        tags = [tag for tag, _ in page.elements]
        assert tags == [
            "h1",
            "p",
            "table",
            "thead",
            "tr",
            "th",
            "tbody",
            "tr",
            "td",
            "tr",
            "td",
            "code",
        ]
        for tag in ("h1", "p", "code"):
            assert page.of[tag][0] == shown
        assert page.of["td"][0] == shown
        assert not matplotlib.cbook.is_math_text(text.in_figure(name))


# The report of a fit ----------------------------------------------------------------------------

INNOCENT = "innocent"
EXPERIMENT = f"""
name = "{INNOCENT} run"
[[sample]]
name = "{INNOCENT}"
recipe = "case3"
height = 0.1
bed_fraction = 0.5
initial_velocity = {{value = 3.6, standard_deviation = 0.1, unit = "mm/day"}}
curve = {{file = "c.csv", time_unit = "day", unit = "mm", standard_deviation = 1.0}}
[[sample]]
name = "B"
recipe = "case2"
initial_velocity = {{value = 8.0, standard_deviation = 0.1, unit = "mm/day"}}
[[parameter]]
name = "f_s"
per_sample = true
median = 1.1
bounds = [0.5, 2.0]
standard_deviation = 0.5
[[parameter]]
name = "f_w"
median = 50.0
"""


def renamed(thing, name):
    """The same thing with another name in the place of the innocent one."""
    if isinstance(thing, str):
        return thing.replace(INNOCENT, name)
    if isinstance(thing, dict):
        return {renamed(key, name): renamed(value, name) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return type(thing)(renamed(one, name) for one in thing)
    if is_dataclass(thing):
        return replace(
            thing, **{one.name: renamed(getattr(thing, one.name), name) for one in fields(thing)}
        )
    return thing


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A fit of a sample with an innocent name: all that its report is made of."""
    folder = tmp_path_factory.mktemp("fitted")
    (folder / "e.toml").write_text(EXPERIMENT)
    (folder / "c.csv").write_text("time,mudline\n1,96\n2,93\n")
    problem, fit = fit_experiment(Experiment.load(folder / "e.toml"), "closed-form")
    held = profiles(fit)
    names = tuple(one.label for one in problem.experiment.parameters)
    draws = np.random.default_rng(0).normal(1.0, 0.1, (200, len(names)))
    samples = Posterior(names, draws, np.ones(len(names)), np.full(len(names), 500.0), 0)
    predicted = np.asarray(problem.predict(fit.theta))
    result = report.summary(problem, fit, identify(fit), predicted, held, samples)
    left_out = [{**one, "difference_over_both_errors": 1.0} for one in result["predictions"]]
    result |= {
        "experiment": problem.experiment.name,
        "lab_sheets": {INNOCENT: {"name": INNOCENT}},
        "model": "closed-form",
        "seed": 0,
        "dtype": "float64",
        "versions": {},
        "wall_seconds": 1.0,
        "left_out": left_out,
        "new": left_out,
        "warnings": [f"sample {INNOCENT}: Reynolds number 1 is above 0.1"],
        "misfit": True,
    }
    result["undetermined"] = result["carried_by_priors_alone"] = [names[0], "f_w"]
    assert result["null_directions"] and result["notes"]
    return result, problem.experiment.parameters, fit, held, samples


def page_of(result, folder) -> Page:
    picture = Figure(figsize=(0.1, 0.1))
    drawn = {one: picture for one in ("predictions", "curves", "residuals", "loss")}
    folder.mkdir(exist_ok=True)
    said = report.markdown(result["experiment"], "closed-form", result, drawn)
    report.write(folder, said, result, drawn, pdf=False)
    page = (folder / "report.html").read_text("utf-8")
    assert page.count('src="data:image/png;base64,') == len(drawn)
    return Page(page)


@pytest.fixture(scope="module")
def innocent_page(fitted, tmp_path_factory):
    return page_of(fitted[0], tmp_path_factory.mktemp("innocent"))


@each_name
def test_a_report_has_the_elements_of_its_template_and_shows_the_name(
    name, fitted, innocent_page, tmp_path
):
    page, shown = page_of(renamed(fitted[0], name), tmp_path), text.printable(name)
    assert page.elements == innocent_page.elements
    heading = f"{shown} run, fitted with the closed-form model"
    assert (page.of["h1"][0], page.of["title"][0]) == (heading, heading)
    assert f"f_s[{shown}]" in page.of["code"] and shown in page.of["td"]
    assert page.text == innocent_page.text.replace(INNOCENT, shown)
    kept = json.loads((tmp_path / "fit.json").read_text("utf-8"))
    assert kept["predictions"][0]["sample"] == name
    with Image.open(tmp_path / "residuals.png") as image:
        assert json.loads(image.text["Description"])["experiment"] == f"{name} run"


@each_name
def test_what_is_said_of_a_fit_is_printable(name, fitted, capsys):
    result = renamed(fitted[0], name)
    lines = report.in_words(result) + [report.line(one) for one in result["left_out"]]
    for line in lines:
        terminal.echo(line)
    said = capsys.readouterr().out
    assert said.count("\n") == len(lines)
    assert all(line.isprintable() for line in said.split("\n"))
    assert f"`f_s[{text.printable(name)}]`" in said


@some_names
def test_every_figure_of_a_fit_is_written(name, fitted, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "DOTS_PER_INCH", 30)
    result, parameters, fit, held, samples = renamed(fitted[:1], name) + fitted[1:]
    experiment = SimpleNamespace(parameters=[renamed(one, name) for one in parameters])
    held, samples = renamed(held, name), renamed(samples, name)
    drawn = fit_figures.figures(SimpleNamespace(experiment=experiment), fit, result, held, samples)
    assert set(drawn) == {"predictions", "curves", "residuals", "profiles", "posterior", "loss"}
    for kind, figure in drawn.items():
        files.write_figure(tmp_path, kind, figure, {"name": name}, pdf=kind == "residuals")
        with Image.open(tmp_path / f"{kind}.png") as image:
            assert json.loads(image.text["Description"]) == {"name": name}
    assert (tmp_path / "residuals.pdf").read_bytes().startswith(b"%PDF")
    said = [one.get_text() for one in drawn["curves"].findobj(Text)]
    assert f"sample {text.in_figure(name)}" in said


@some_names
def test_figures_of_runs_take_any_name(name, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "DOTS_PER_INCH", 30)
    box = mrjax.Box((1e-5,) * 3)
    drawn = {
        "bars": figures.sensitivities({name: 1.0, "f_s": -2.0, f"{name}2": 0.5}, name),
        "lines": figures.sensitivity_curves([0.0, 1.0], {name: [1.0, 2.0]}, name),
        "spheres": figures.particles({name: [[5e-6] * 3]}, 1e-6, box),
    }
    for kind, figure in drawn.items():
        files.write_figure(tmp_path, kind, figure, {"name": name}, pdf=False)
    assert [one.get_text() for one in drawn["bars"].axes[0].get_yticklabels()][1:] == [
        text.in_figure(name), "f_s",
    ]  # fmt: skip
    [line] = drawn["lines"].legends[0].get_texts()
    assert line.get_text() == text.in_figure(name)


def test_a_figure_of_very_many_samples_is_written(tmp_path):
    figure = Figure(figsize=(340.0, 2.4))
    figure.subplots(1, 2)
    files.write_figure(tmp_path, "wide", figure, {}, pdf=False)
    with Image.open(tmp_path / "wide.png") as image:
        assert 50_000 < image.width < 65_536


def test_the_settings_of_others_do_not_change_what_labels_mean(tmp_path):
    with matplotlib.rc_context({"text.usetex": True, "text.parse_math": False}):
        figure = figures.sensitivities({"a_b$": 1.0}, "x$")
        files.write_figure(tmp_path, "bars", figure, {}, pdf=False)
    assert not any(one.get_usetex() for one in figure.axes[0].get_yticklabels())


# Sheets and command lines -----------------------------------------------------------------------


@each_name
def test_a_sheet_takes_a_printable_name_and_refuses_another_in_one_line(name):
    tables = tomllib.loads(mrjax.recipe.sheets.bundled("mrjax.recipe.bundled")["case2"].read_text())
    if name in PRINTABLE.values():
        assert Recipe(**tables | {"name": name}).name == name
        return
    with pytest.raises(mrjax.InputError) as refusal:
        Recipe(**tables | {"name": name})
    assert str(refusal.value).isprintable() and "must be one line of text" in str(refusal.value)


@pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)
def test_keys_of_any_name_are_told_in_one_printable_line(name):
    tables = tomllib.loads(mrjax.recipe.sheets.bundled("mrjax.recipe.bundled")["case2"].read_text())
    box, particle = dict(tables["box"]), dict(tables["particle"])
    for changes in (
        {name: 1},
        {"drag": {"f_w": {"closure": "son2018", name: 1.0}}},
        {"drag": {"f_w": {"closure": name}}},
        {"drag": {"f_w": name}},
        {"drag": {name: 1.0}},
        {"box": box | {name: 1}},
        {"particle": particle | {"diameter": {name: 1.0}}},
        {"particle": particle | {"diameter": {"values": [1e-6], "by": name}}},
        {"gravity": name},
    ):
        with pytest.raises(mrjax.InputError) as refusal:
            Recipe(**tables | changes)
        assert str(refusal.value).isprintable() and len(str(refusal.value)) <= 400


END = "ended with status"
"""What follows all that a fit said, in a terminal that several take one after the other."""


def in_a_terminal(*arguments, module="mrjax", folder=None) -> tuple[int, str]:
    """Exit status, and all that reaches a terminal; codes are dropped where there is none."""
    return python_in_a_terminal("-m", module, *arguments, folder=folder)


def python_in_a_terminal(*arguments, folder) -> tuple[int, str]:
    ours, theirs = pty.openpty()
    done = subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, cwd=folder,
        env={**os.environ, "JAX_PLATFORMS": "cpu"},
    )  # fmt: skip
    os.close(theirs)
    said = b""
    try:
        while piece := os.read(ours, 65536):
            said += piece
    except OSError:  # nobody writes to it any more
        pass
    os.close(ours)
    return done.wait(timeout=300), said.decode().replace("\r\n", "\n")


def test_a_terminal_shows_keys_and_names_of_a_sheet_quoted(tmp_path):
    case2 = mrjax.recipe.sheets.bundled("mrjax.recipe.bundled")["case2"].read_text()
    keys = "".join(map(text.in_toml, UNPRINTABLE.values())).replace('""', "")
    closure = f'f_w = {{closure = "son2018", {keys} = 1.0}}'
    (tmp_path / "key.toml").write_text(re.sub(r'f_w = "son2018"', lambda _: closure, case2))
    status, said = in_a_terminal("check", "key.toml", folder=tmp_path)
    assert status == 2 and said.count("\n") == 1 and said[:-1].isprintable()
    assert said.startswith("mrjax: key.toml: drag.f_w.'\\x1b[31mred")
    status, said = in_a_terminal("check", "\x1b[31m\u202e.toml", folder=tmp_path)
    assert status == 2 and said.count("\n") == 1 and said[:-1].isprintable()
    status, said = in_a_terminal("simulate", "case2", "--fr\x1b[31m", folder=tmp_path)
    assert status == 2 and said.count("\n") == 1 and said[:-1].isprintable()


def in_process(command, name, arguments, capsys, monkeypatch) -> tuple[int, str]:
    """Exit status of a command, and what it says."""
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    with pytest.raises(SystemExit) as end:
        exit_status.run(command, name)
    return end.value.code or 0, "".join(capsys.readouterr())


def test_a_new_experiment_names_its_readings_whatever_they_are_called(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    calibrating = partial(in_process, calibrate.__main__.cli, "mrjax-calibrate")
    Path("mine.toml").write_text(
        mrjax.recipe.sheets.bundled("mrjax.recipe.bundled")["case2"].read_text()
    )
    for name in ("a\"b'c.toml", "$x$ {y} \\.toml", "-x.toml", "試料.toml"):
        status, said = calibrating(["--new", f"./{name}"], capsys, monkeypatch)
        assert status == 0, said
        assert Experiment.load(name).samples
    status, said = calibrating(["--new", "a\x1b[31m.toml"], capsys, monkeypatch)
    assert status == 2 and said[:-1].isprintable() and "is no file name" in said


def test_new_files_never_take_the_place_of_others(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe.toml")
    Path("dangling.toml").symlink_to("nowhere")
    for name in ("dangling.toml", "pipe.toml", "x" * 300 + ".toml", "a\nb.toml", ""):
        status, said = in_process(mrjax.__main__.cli, "mrjax", ["new", name], capsys, monkeypatch)
        assert status in (2, 3) and said.count("\n") == 1 and len(said) < 420
    assert sorted(os.listdir()) == ["dangling.toml", "pipe.toml"]
    assert Path("dangling.toml").is_symlink() and Path("pipe.toml").is_fifo()


def test_a_shell_completes_no_file_whose_name_is_more_than_a_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in NAMES.values():
        if len(name) < 200 and "/" not in name and "\x00" not in name:
            Path(f"a{name}.toml").touch()
    complete = completion.sheet_names("mrjax.recipe.bundled")
    found = [one.value for one in complete(None, None, "a")]
    assert "a$x.toml" in found and all(name.isprintable() for name in found)


ONE_AFTER_THE_OTHER = f"""
import sys
from calibrate.__main__ import main
for number in range(int(sys.argv[1])):
    sys.argv[1:] = [f"e{{number}}.toml", "--model", "closed-form", "--out", f"out{{number}}"]
    try:
        main()
    except SystemExit as end:
        print(f"{END} {{end.code or 0}}")
"""
"""Fits by the command line in one process: half of the time of a fit was its start."""


def sweep(kinds: dict[str, str], folder) -> None:
    """Fits an experiment of each name by command line, and looks at all it writes."""
    for number, name in enumerate(kinds.values()):
        (folder / f"e{number}.toml").write_text(
            EXPERIMENT.replace("curve =", "# ").replace("height = 0.1", "")
            .replace(f'"{INNOCENT}"', text.in_toml(name))
            .replace(f'"{INNOCENT} run"', text.in_toml(name)), "utf-8"
        )  # fmt: skip
    _, all_said = python_in_a_terminal("-c", ONE_AFTER_THE_OTHER, str(len(kinds)), folder=folder)
    *fits, rest = re.split(f"{END} (\\d+)\n", all_said)
    assert len(fits) == 2 * len(kinds) and not rest, all_said
    templates: list[list] = []
    for number, (name, said, status) in enumerate(
        zip(kinds.values(), fits[::2], fits[1::2], strict=True)
    ):
        assert status == "0", (name, said)
        told = re.sub(r"\x1b\[A|\r", "", said)  # the bar of the search
        assert all(line.isprintable() for line in told.split("\n")), (name, said)
        written = {one.name for one in (folder / f"out{number}").iterdir()}
        assert written >= {
            *("fit.json", "report.md", "report.html", "predictions.png", "residuals.png"),
            *("profiles.png", "loss.png"),
        }
        page = Page((folder / f"out{number}" / "report.html").read_text("utf-8"))
        assert page.of["h1"] == [f"{name}, fitted with the closed-form model"]
        templates.append(page.elements)
        assert page.elements == templates[0], name


def test_a_fit_of_hostile_names_by_command_line(tmp_path):
    sweep({kind: PRINTABLE[kind] for kind in ("a script", "broken mathematics")}, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(8))
def test_fits_of_forty_hostile_names_by_command_line(part, tmp_path):
    assert len(PRINTABLE) >= 40
    sweep({"innocent": INNOCENT, **dict(list(PRINTABLE.items())[part::8])}, tmp_path)
