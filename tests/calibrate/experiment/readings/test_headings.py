"""Cells of headers: role, rank, unit and base of a name, each by what people write."""

import pytest

from calibrate.experiment.readings.headings import heading


@pytest.mark.parametrize(
    "written, role, unit",
    [
        ("time", "time", ""),
        ("Time (min)", "time", "min"),
        ("TIME [ H ]", "time", "h"),
        ("t/d", "time", "d"),
        ("t / min", "time", "min"),
        ("time_min", "time", "min"),
        ("Time, h", "time", "h"),
        ("time in days", "time", "days"),
        ("days", "time", "days"),
        ("(min)", "time", "min"),
        ("Elapsed time (hh:mm:ss)", "time", "hh:mm:ss"),
        ("time of day", "time", ""),
        ("Date/Time", "time", ""),
        ("Zeit [Tage]", "time", "tage"),
        ("mudline", "mudline", ""),
        ("Mudline height (mm)", "mudline", "mm"),
        ("h [mm]", "mudline", "mm"),
        ("h/cm", "mudline", "cm"),
        ("h2", "mudline", ""),
        ("mean h (mm)", "mudline", "mm"),
        ("h std", "standard_deviation", ""),
        ("height in cm", "mudline", "cm"),
        ("Height, in", "mudline", ""),  # inches, or left open
        ("H (in)", "mudline", "in"),
        ("interface position", "mudline", ""),
        ("interface to supernatant (mm)", "mudline", "mm"),
        ("Sediment volume (mL)", "mudline", "ml"),
        ("V [cm³]", "mudline", "cm3"),
        ("tube 2 height", "mudline", ""),
        ("run A", "mudline", ""),
        ("height (% of initial height)", "mudline", "%"),
        ("sedimentation_ratio", "sedimentation_ratio", ""),
        ("h/h0", "sedimentation_ratio", ""),
        ("H/H0 (%)", "sedimentation_ratio", "%"),
        ("relative height", "sedimentation_ratio", ""),
        ("supernatant", "supernatant", ""),
        ("Clear layer depth / mm", "supernatant", "mm"),
        ("height of clear liquid", "supernatant", ""),
        ("standard_deviation", "standard_deviation", ""),
        ("SD (mm)", "standard_deviation", "mm"),
        ("mudline error", "standard_deviation", ""),
        ("±", "standard_deviation", ""),
        *(
            (other, None, None)
            for other in (
                *("", "note", "temperature", "T (°C)", "initial height (mm)", "h0", "H0 (mm)"),
                *("tube height (mm)", "tube diameter (mm)", "velocity (mm/s)", "v (mm/s)", "no"),
                *("start time", "time error", "relative humidity (%)", "solids volume fraction"),
                *(
                    "pH",
                    "mass (g)",
                    "h_min",
                    "height max (mm)",
                    "total height (mm)",
                    "RH (%)",
                    "t1",
                ),
            )
        ),
    ],
)
def test_a_header_says_what_its_column_holds(written, role, unit):
    found = heading(written)
    assert (found.kind and found.kind[0]) == role
    if role:
        assert found.unit == unit and found.written == written


@pytest.mark.parametrize(
    "names, base",
    [
        (("mudline", "mudline 1", "Mudline_2 (mm)", "mudline.3", "mudline (tube B)"), "mudline"),
        (("h1", "h 2", "H3 (mm)", "h (a)"), "h"),
        (("height A", "Height B (cm)", "height #3"), "height"),
        (("run 1", "Tube B", "replicate 3 (mm)"), ""),
        (("left height", "left height 2"), "left height"),
    ],
)
def test_repeats_have_one_base(names, base):
    assert {heading(name).base for name in names} == {base}


def test_the_plainest_name_of_a_mudline_comes_first():
    ranks = [
        heading(name).kind[1]
        for name in ("mudline", "height", "sediment height", "reading", "h/h0", "clear layer")
    ]
    assert ranks == sorted(ranks) and len(set(ranks)) == len(ranks)
    assert heading("time").kind < heading("date").kind
