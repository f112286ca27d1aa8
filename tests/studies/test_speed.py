"""The speed benchmark works at tiny size; how long anything takes is not looked at."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.studies.benchmarks.speed import (
    liggghts,
    memory,
    page,
    process,
    states,
    throughput,
    timing,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """With a dispersed box, made once."""
    made = tmp_path_factory.mktemp("speed")
    states.make(made, states.DILUTE)
    return made


def test_tiles_are_images_of_each_other_and_do_not_touch(folder):
    one, small = states.load(folder, states.DILUTE)
    state, box = states.load(folder, states.DILUTE, tiles=2)
    position = np.asarray(state.position)
    assert state.particles == 4 * one.particles and states.tiles_of(state.particles) == 2
    assert box.size == (2 * small.size[0], 2 * small.size[1], small.size[2])
    apart = np.sort(position[:, 0]) - np.sort(box.size[0] - position[:, 0])
    np.testing.assert_allclose(apart, 0.0, atol=1e-15)
    # Nor do they across what were walls.
    assert states.look(position, np.asarray(state.velocity))["coordination_number"] == 0.0


@pytest.mark.slow
def test_both_codes_fall_alike(folder):
    """Ten steps of free fall: the same heights, by whichever code is there."""
    steps = 10
    measuring = throughput.here(str(folder), states.DILUTE, 1, steps - 1, 1, "float64")
    ours = next(measuring)
    assert {"seconds", "start"} == next(measuring).keys()
    state, box = states.load(folder, states.DILUTE)
    start = np.asarray(state.position), np.asarray(state.velocity)
    speed = 9.81 * steps * states.TIME_STEP
    assert ours["mean_speed"] == pytest.approx(speed, rel=1e-6)
    fallen = start[0][:, 2].mean() - 0.5 * speed * steps * states.TIME_STEP
    assert ours["mean_height"] == pytest.approx(fallen, rel=1e-12)
    if liggghts.available():
        theirs = liggghts.run(*start, box, steps=steps)
        assert states.look(theirs.position, theirs.velocity) == pytest.approx(
            {key: ours[key] for key in ("mean_height", "mean_speed", "coordination_number")}
        )


def test_a_process_answers_when_asked(tmp_path):
    """With an error there, not here, where its input is missing."""
    given = {"name": "settled bed", "folder": str(tmp_path), "steps": 1}
    with pytest.raises(RuntimeError, match="ended with status"):
        process.answered("compilation", given, 1)


def test_memory_is_that_of_the_call():
    taken = memory.taken(lambda: np.ones(4_000_000).sum())
    assert 25e6 < taken < 60e6


def test_ratios_are_of_pairs():
    assert timing.ratios([2.0, 9.0, 4.0], [1.0, 3.0, 4.0]) == {
        "median": 2.0,
        "least": 1.0,
        "greatest": 3.0,
    }


@pytest.mark.skipif(not page.RESULTS.exists(), reason="nothing was measured for the page")
def test_the_page_shows_what_was_measured():
    assert page.text(page.known(page.RESULTS)) == page.PAGE.read_text("utf-8")


def test_the_page_has_the_parts_that_were_measured(tmp_path):
    machine = {"processor": "P", "cores": 2, "python": "3", "mrjax": "0", "jax": "0"}
    machine |= {"jaxlib": "0", "liggghts": None}
    rows = [{"start": "cold", "cores": 2, "wall": 61.23, "cpu": 80.0}]
    file = tmp_path / "speed.json"
    file.write_text(json.dumps({"command": {"machine": machine, "rows": rows}}))
    text = page.text(page.known(file))
    assert "| cold | 2 | 61.2 | 80.0 |" in text and "Particle-steps" not in text
    assert page.known(tmp_path / "none.json") == {}
