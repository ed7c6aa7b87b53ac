"""Numbers as people type them: every unit, ranges and lists, and what can't be meant or could be read two ways."""

import contextlib
import contextvars
import math
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raff2urdf import quantities
from raff2urdf.quantities import ANGLE, DIMENSIONS, LENGTH, NUMBER, SPEED, QuantityError, parse, parse_range, shown

FACTORS = {
    "um": 1e-6, "µm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254,
    "deg": math.pi / 180.0, "°": math.pi / 180.0, "rad": 1.0,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "Hz": 1.0, "kHz": 1e3,
    "N": 1.0, "kN": 1e3, "Nm": 1.0, "Nmm": 1e-3, "kg/m3": 1.0, "kg/m^3": 1.0, "g/cm3": 1e3,
    "kg": 1.0, "g": 1e-3, "t": 1e3,
    "N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3, "N/um": 1e6, "Nm/rad": 1.0, "kNm/rad": 1e3,
}  # fmt: skip
FACTORS |= {f"{unit}/{per}": FACTORS[unit] for unit in (*LENGTH.units, *ANGLE.units) for per in ("s", "s2", "s^2")}
UNITS = [(dimension, unit) for dimension in DIMENSIONS for unit in dimension.units]
numbers = st.floats(-1e6, 1e6, allow_nan=False)


@given(number=numbers, blank=st.sampled_from(["", " ", "  "]))
def test_every_unit_of_every_dimension(number, blank):
    for dimension, unit in UNITS:
        value = parse(f"{number!r}{blank}{unit}", dimension)
        assert value == pytest.approx(number * FACTORS[unit], rel=1e-15, abs=1e-300), unit


def test_a_unit_of_another_dimension_is_refused_and_both_are_named():
    for (dimension, unit), other in product(UNITS, DIMENSIONS):
        if unit not in other.units:
            with pytest.raises(QuantityError, match=f"'1{unit.replace('^', '.')}' is {dimension.name}: {other.name}"):
                parse(f"1{unit}", other)


@pytest.mark.parametrize("dimension", DIMENSIONS, ids=lambda dimension: dimension.name)
def test_a_number_without_a_unit_is_in_m_degrees_and_s(dimension):
    degrees = (ANGLE, quantities.ANGULAR_SPEED, quantities.ANGULAR_ACCELERATION)
    assert parse("1", dimension) == (math.radians(1.0) if dimension in degrees else 1.0)


def test_decimal_numbers_are_converted_exactly():
    assert (parse("-900mm", LENGTH), parse("0.3 mm", LENGTH)) == (-0.9, 0.0003)
    assert (parse("10in", LENGTH), parse("250", LENGTH, "mm")) == (0.254, 0.25)


@given(st.floats(1e-4, 1e5), st.sampled_from(DIMENSIONS[:-1]), st.sampled_from(["m", "mm"]))
def test_what_is_shown_can_be_typed(number, dimension, unit):
    def both() -> tuple[str, float]:
        quantities.show_lengths_in(unit)
        return shown(number, dimension, 12), parse(shown(number, dimension, 12), dimension)

    text, again = contextvars.copy_context().run(both)
    assert quantities.has_unit(text)
    assert again == pytest.approx(number, rel=1e-9)


@pytest.mark.parametrize("text", [
    "", " ", "x", "nan", "inf", "-inf", "1e999", "--1", "1-", "1.2.3", "1,5", "1_000", "0x10", "٣", "½", "1m m", "mm",
    "1e5e", "+", ".", "1..2", "1;2", "1 2", "1mm2",
])  # fmt: skip
def test_garbage_is_refused(text):
    with pytest.raises(QuantityError):
        parse(text, LENGTH)
    with pytest.raises(QuantityError):
        parse(text, ANGLE)


@given(st.text(max_size=20))
def test_any_text_is_a_finite_number_or_is_refused(text):
    for dimension in (LENGTH, ANGLE, NUMBER):
        with contextlib.suppress(QuantityError):
            assert math.isfinite(parse(text, dimension))
    with contextlib.suppress(QuantityError):
        assert all(map(math.isfinite, parse_range(text, LENGTH)))


@pytest.mark.parametrize(
    ("text", "hint"), [("1MM", "did you mean mm"), ("1 Meter", "unknown unit 'Meter'"), ('3"', "did you mean in")]
)
def test_a_misspelled_unit_is_answered_by_a_suggestion(text, hint):
    with pytest.raises(QuantityError, match=hint):
        parse(text, LENGTH)
    for text in ("15degrees", "15 Deg", "15degs"):
        with pytest.raises(QuantityError, match="did you mean deg"):
            parse(text, ANGLE)


# --- ranges and lists --------------------------------------------------------------------------------------------


@given(numbers, numbers, st.sampled_from(["", "m", "mm", "in"]))
def test_a_unit_behind_a_range_is_that_of_both_ends(low, high, unit):
    expected = parse(f"{low!r}{unit}", LENGTH), parse(f"{high!r}{unit}", LENGTH)
    assert parse_range(f"{low!r}..{high!r}{unit}", LENGTH) == expected
    if unit:
        assert parse_range(f"{low!r}{unit} .. {high!r} {unit}", LENGTH) == expected


@pytest.mark.parametrize(("text", "why"), [
    ("0...1", "'0...1' has 3 dots: write LOW..HIGH with two dots"),
    ("0...5", "3 dots"), ("1...2", "3 dots"), ("0....5", "4 dots"),
    ("1", "is one number"), ("1..2..3", "is not a range"), ("..1", "'' is not a length"),
    ("1..", "'' is not a length"), ("-500mm..500", "can be read two ways"), ("0mm..5", "can be read two ways"),
    ("0..5deg", "'5deg' is an angle"), ("a..b", "is not a length"),
])  # fmt: skip
def test_ranges_that_are_refused(text, why):
    with pytest.raises(QuantityError, match=why):
        parse_range(text, LENGTH)


def test_ends_of_a_range_may_have_different_units():
    assert parse_range("-5mm..0.1m", LENGTH) == (-0.005, 0.1)
    assert parse_range("-500mm..0", LENGTH) == (-0.5, 0.0)


def test_in_a_list_all_numbers_have_a_unit_or_none():
    assert quantities.parse_list(["0", "0", "-900mm"], LENGTH) == [0.0, 0.0, -0.9]
    assert quantities.parse_list(["1m", "20mm", "3cm"], LENGTH) == [1.0, 0.02, 0.03]
    with pytest.raises(QuantityError, match=r"'1,0,500mm' can be read two ways: '500mm' has a unit, '1' has none"):
        quantities.parse_list(["1", "0", "500mm"], LENGTH)


# --- what people read --------------------------------------------------------------------------------------------


def test_lengths_are_shown_in_m_unless_a_context_says_otherwise():
    def in_mm() -> list[str]:
        quantities.show_lengths_in("mm")
        return [shown(0.0598, LENGTH, 3), shown(1.5, SPEED), shown(1.0, ANGLE), quantities.shown_unit("m^2 rad")[1]]

    assert contextvars.copy_context().run(in_mm) == ["59.8 mm", "1500 mm/s", "57.3 deg", "mm^2 deg"]
    assert [shown(0.0598, LENGTH, 3), shown(1.5, SPEED), shown(-0.0, LENGTH)] == ["0.0598 m", "1.5 m/s", "0 m"]
