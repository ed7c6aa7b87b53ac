"""The Spaceball's language: without a checksum, so what gets through wrongly is counted."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mouse_streams import counts, cut, escaped, spaceball_motion, spaceball_twist

from cinegen.devices.mouse_events import MouseFault, MouseKeys, MouseModel, MouseMotion
from cinegen.devices.spaceball import Spaceball

ALIVE = b"\r@1 Spaceball alive and well after a software reset.\r"
FIRMWARE = b"@2 Firmware version 2.%02d created on 29-Jan-1992.\r"

packets = st.one_of(
    counts.map(spaceball_motion),
    st.binary(min_size=2, max_size=2).map(lambda b: b"K" + escaped(b) + b"\r"),
    st.binary(min_size=2, max_size=2).map(lambda b: b"." + escaped(b) + b"\r"),
    st.sampled_from([ALIVE, FIRMWARE % 42, FIRMWARE % 35, b"MSSV\r", b"?\r", b"E1\r", b"^", b"^\r", b"\x11\x13"]),
)


@pytest.mark.parametrize(
    ("minor", "name", "buttons"),
    [(35, "Spaceball 3003", 2), (43, "Spaceball 4000FLX", 12), (2, "Spaceball 2003", 8), (99, "Spaceball", 8)],
)
def test_who_it_is(minor, name, buttons):
    decoder = Spaceball()
    assert decoder.feed(ALIVE + FIRMWARE % minor) == [MouseModel("Spaceball", 8), MouseModel(name, buttons)]


def test_a_4000flx_is_known_by_its_keys():
    decoder = Spaceball()
    decoder.feed(ALIVE + FIRMWARE % 42)
    assert decoder.feed(b"K\x10\x01\r") == [MouseKeys(frozenset({0, 7}))]
    assert decoder.feed(b".\x10\x81\r") == [MouseModel("Spaceball 4000FLX", 12), MouseKeys(frozenset({0, 6, 11}))]
    assert decoder.feed(b"K\x00\x01\r") == []  # it says the same by '.'


def test_left_and_right_of_a_3003():
    decoder = Spaceball()
    decoder.feed(ALIVE + FIRMWARE % 35)
    assert decoder.feed(b"K\x00\x10\r") == [MouseKeys(frozenset({0}))]
    assert decoder.feed(b"K\x00\x20\r") == [MouseKeys(frozenset({1}))]


def test_errors_and_what_it_does_not_know():
    decoder = Spaceball()
    (fault,) = decoder.feed(b"?\rE12\r")
    assert isinstance(fault, MouseFault)
    assert decoder.damaged == 0
    assert decoder.feed(b"hello\rD\r") == []
    assert decoder.damaged == 2


@given(st.lists(st.tuples(*[st.integers(-180, 180)] * 6), max_size=8))
def test_what_was_sent_comes_out(sent):
    """While the hand is not faster than one may be, escapes and all."""
    decoder = Spaceball()
    sent = [tuple(round(value / 2) for value in values) for values in sent]  # no two further apart than JUMP
    events = decoder.feed(b"".join(map(spaceball_motion, sent)))
    assert events == [MouseMotion(spaceball_twist(values)) for values in sent]


@settings(max_examples=200)
@given(
    st.one_of(st.binary(max_size=400), st.lists(packets).map(b"".join)), st.lists(st.integers(0, 10**6), max_size=12)
)
def test_however_it_is_cut_the_events_are_the_same(stream, places):
    whole, parts = Spaceball(), Spaceball()
    events = whole.feed(stream)
    assert [event for part in cut(stream, places) for event in parts.feed(part)] == events
    assert parts.damaged == whole.damaged


def test_flow_control_of_the_line_is_no_data():
    packet = spaceball_motion((0x11, 0x13, 0x0D, ord("^"), 5, 6))
    mixed = b"\x11" + packet[:5] + b"\x13\x11" + packet[5:]
    assert Spaceball().feed(mixed) == Spaceball().feed(packet) != []


def test_a_fast_hand_is_followed_and_letting_go_is_never_doubted():
    decoder = Spaceball()
    ramp = [(2700 * i, 0, 0, 0, 0, 0) for i in range(4)] + [(8100, 0, 0, 0, 0, 0)] * 2
    events = [decoder.feed(spaceball_motion(values)) for values in ramp]
    assert events[-1] == [MouseMotion((1.0, 0, 0, 0, 0, 0))]
    assert sum(map(bool, events)) >= 4  # each second packet of a jump at the latest
    assert decoder.feed(spaceball_motion((0,) * 6)) == [MouseMotion((0.0,) * 6)]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("start", [-2800, -1600, 0])
@pytest.mark.parametrize("axis", [0, 4])
def test_a_swing_at_constant_speed_is_confirmed_by_its_third_packet(axis, start, sign):
    """Wherever it begins: also where it passes through rest to the same deflection on the other side."""
    scale = sign * (1 if axis < 3 else 0.2)
    sent = [[round(scale * (start + k * 3200)) if i == axis else 0 for i in range(6)] for k in range(3)]
    decoder = Spaceball()
    decoder.feed(2 * spaceball_motion(sent[0]))
    second, third = (decoder.feed(spaceball_motion(values)) for values in sent[1:])
    assert second == []
    assert third == [MouseMotion(spaceball_twist(sent[2]))]


def test_wild_packets_are_left_out():
    decoder = Spaceball()
    still = spaceball_motion((100, 0, 0, 0, 0, 0))
    assert decoder.feed(still)
    for wild in (5000, -5000, 30000, 30000):
        assert decoder.feed(spaceball_motion((100, wild, 0, 0, 0, 0))) == []
    assert decoder.feed(still)
    assert decoder.damaged == 4
