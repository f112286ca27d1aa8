"""Old names of modules: each gives the module that took over."""

import importlib
import subprocess
import sys

import pytest

import calibrate
import mrjax
from mrjax.core import aliases

PUBLIC = {
    "contact": ("normal_force", "effective_modulus", "harmonic", "stiffness", "damping_ratio"),
    "drag": ("coefficient", "son2018", "diameter_ratio", "shape_factor", "CLOSURES"),
    "forces": ("of_contacts", "pull", "Laws", "laws"),
    "friction": ("tangential_force", "effective_shear_modulus"),
    "hindrance": ("BED", "DENSEST", "hindered", "local_volume_fraction", "as_tree"),
    "leapfrog": ("step", "kick", "spin_kick", "mean_decay", "drifted"),
    "observe": ("top", "mean_of_top", "mass_quantile", "twice_centre_of_mass", "Asymptotes"),
    "particle": ("inertia", "net_weight", "mass", "apparent_density", "outer_radius"),
    "rolling": ("rolling_torque",),
    "surfaces": ("of", "of_kinds", "Surfaces"),
    "theory": ("free_fall_velocity", "terminal_velocity", "hertz_force"),
    "timestep": ("rayleigh_time", "rise_time", "largest_stable_step", "time_step"),
    "validity": ("numbers", "warnings"),
}
"""What the documentation named before the rooms."""


@pytest.mark.parametrize("old", sorted(aliases.OLD_NAMES))
def test_an_old_name_is_todays_module(old):
    today = importlib.import_module(f"mrjax.{aliases.OLD_NAMES[old]}")
    assert importlib.import_module(f"mrjax.{old}") is today
    assert sys.modules[today.__name__] is today and today.__spec__.name == today.__name__
    if old not in aliases.FUNCTIONS:
        assert getattr(mrjax, old) is today or old in mrjax.__all__


@pytest.mark.parametrize("module", PUBLIC)
def test_what_was_documented_is_there(module):
    assert all(hasattr(getattr(mrjax, module), name) for name in PUBLIC[module])


def test_old_classes():
    assert mrjax.Contacts is mrjax.ContactHistory
    assert mrjax.Touching is mrjax.ContactList


def test_functions_come_before_old_modules():
    code = """
import mrjax.settle, mrjax.column
from mrjax.concentration import half_concentration
import mrjax
assert callable(mrjax.settle) and callable(mrjax.column) and callable(mrjax.concentration)
assert mrjax.figures.__name__ == "mrjax.figures"
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_name_that_was_never_there():
    assert not hasattr(mrjax, "leapfrogs") and not hasattr(calibrate, "leapfrogs")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("mrjax.leapfrogs")
