"""The Magellan's language: every packet that is whole is used, and nothing else."""

import re

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mouse_streams import NIBBLES, counts, cut, magellan_keys, magellan_motion, magellan_twist, nibbles

from cinegen.devices.magellan import Magellan
from cinegen.devices.mouse_events import MouseFault, MouseKeys, MouseModel, MouseMotion

STUMP = re.compile(rb"d[%b]{19,21}$" % re.escape(NIBBLES))
packets = st.one_of(counts.map(magellan_motion), st.integers(0, 0xFFF).map(magellan_keys))


def test_the_example_of_the_makers_manual():
    (event,) = Magellan().feed(b"dHBA5G?HKH000H0A6GNA6H06B\r")
    x, y, z, a, b, c = 533, -117, 0, 22, -490, 98
    assert event == MouseMotion(magellan_twist((x, y, z, a, b, c)))


def test_who_it_is():
    decoder = Magellan()
    said = b"vMAGELLAN  Version 6.60  by LOGITECH INC. 10/10/02\r"
    assert decoder.feed(said) == [MouseModel("Magellan SpaceMouse", 11)]
    assert decoder.feed(b"vCadMan  Version 1.0\r") == [MouseModel("CadMan", 4)]
    assert decoder.feed(b"vQ\r") == []  # an echo is no answer
    assert decoder.feed(b"m3\rc3B\rz\r") == []
    assert decoder.damaged == 1
    (fault,) = decoder.feed(b"eA0\r")
    assert isinstance(fault, MouseFault)
    assert "unknown command" in fault.message


_parts = packets | st.binary(max_size=12) | st.sampled_from([b"\r", b"d", b"k", b"v", b"e"])
_texts = st.text(NIBBLES.decode() + "dkve\r", max_size=600).map(str.encode)
_streams = st.binary(max_size=700) | st.lists(_parts).map(b"".join) | _texts


@settings(max_examples=200)
@given(_streams, st.lists(st.integers(0, 10**6), max_size=12))
def test_however_it_is_cut_the_events_are_the_same(stream, places):
    whole, parts = Magellan(), Magellan()
    events = whole.feed(stream)
    assert [event for part in cut(stream, places) for event in parts.feed(part)] == events
    assert parts.damaged == whole.damaged


@given(st.lists(st.tuples(packets, st.binary(max_size=30)), min_size=1, max_size=6))
@example([(magellan_motion([1, 2, 3, 4, 5, 6]), b"v")])  # the letter that begins the answer who it is
def test_noise_before_a_packet_of_motion_does_no_harm(sent):
    """Whatever stands in the line before it, CR or not: the packet itself is whole."""
    for packet, noise in sent:
        if packet.startswith(b"d"):
            assert Magellan().feed(noise + packet)[-1:] == Magellan().feed(packet)


@st.composite
def damaged(draw) -> tuple[bytes, bytes]:
    """A packet, and the same with one byte damaged, left out or put in."""
    packet = draw(packets)
    at = draw(st.integers(0, len(packet) - 1))
    bits = st.sampled_from([1 << i for i in range(8)] + [0b111, 0b10101, 0b1110000])
    kinds = {
        "flip": lambda: packet[:at] + bytes([packet[at] ^ draw(bits)]) + packet[at + 1 :],
        "drop": lambda: packet[:at] + packet[at + 1 :],
        "insert": lambda: packet[:at] + draw(st.binary(min_size=1, max_size=1)) + packet[at:],
        "cut": lambda: packet[: max(at, 1)],
    }
    return packet, kinds[draw(st.sampled_from(list(kinds)))]()


@settings(max_examples=500)
@given(st.lists(st.one_of(packets.map(lambda p: (p, p)), damaged()), max_size=10))
def test_every_whole_packet_is_used_and_nothing_else(sent):
    """Between two packets no noise: a packet that lost its CR runs into the next one, which is used all the same."""
    # Two packets of keys with four nibbles are what a model with more keys sends.
    assume(sum(bool(re.fullmatch(rb"k[%b]{4}\r" % re.escape(NIBBLES), received)) for _, received in sent) < 2)
    decoder = Magellan()
    decoded = decoder.feed(magellan_keys(0)) + decoder.feed(b"".join(received for _, received in sent))
    stumps = [b"", *(received for _, received in sent)]
    whole = [
        packet
        for (packet, received), before in zip(sent, stumps, strict=False)
        # Behind a packet of motion that is cut just there, a k may as well be a nibble of it that was damaged.
        if packet == received and not (packet.startswith(b"k") and STUMP.search(before))
    ]
    expected = [event for packet in whole for event in Magellan().feed(packet)]
    allowed = [event for packet, received in sent for event in Magellan().feed(packet)]
    for kind, before in ((MouseMotion, []), (MouseKeys, [MouseKeys(frozenset())])):
        must, may, used = ([e for e in events if isinstance(e, kind)] for events in (expected, allowed, decoded))
        assert _within(must, used)
        # A damage that leaves the packet itself whole (noise in front of it) may leave it used.
        assert _within(used, [*before, *may])


def _within(some: list, more: list) -> bool:
    """Whether these come among those, in the same order."""
    rest = iter(more)
    return all(any(event == other for other in rest) for event in some)


@pytest.mark.parametrize("noise", [b"\xff" * 5000, b"k" * 5000, b"d" * 5000, bytes(range(256)) * 20])
def test_noise_without_end_takes_no_memory(noise):
    decoder = Magellan()
    for _ in range(20):
        assert decoder.feed(noise.replace(b"\r", b"")) == []
    assert len(decoder._line) <= 256
    values = (1, -2, 3, -4, 5, -6)
    assert decoder.feed(magellan_motion(values)) == [MouseMotion(magellan_twist(values))]


def test_the_first_packet_of_another_length_is_not_used_and_the_second_is():
    """One may be damaged; two in a row are another model. A packet of the usual length between them starts anew."""
    three, four = magellan_keys(0b101), b"k" + nibbles(0, 3) + b"A\r"
    used = [bool(decoder.feed(packet)) for decoder in [Magellan()] for packet in (three, four, three, four, four, four)]
    assert used == [True, False, True, False, True, True]


@given(st.lists(counts, max_size=8), st.lists(st.integers(0, 0xFFF), max_size=8))
def test_what_was_sent_comes_out(motions, keys):
    decoder = Magellan()
    events = decoder.feed(b"".join([*map(magellan_motion, motions), *map(magellan_keys, keys)]))
    pressed = [MouseKeys(frozenset(i for i in range(12) if bits >> i & 1)) for bits in keys]
    assert events == [*(MouseMotion(magellan_twist(values)) for values in motions), *pressed]
    assert decoder.damaged == 0
