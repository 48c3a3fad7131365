"""Formats of Gx_XIST1 and Gx_XIST2, and P979, which tells them."""

from __future__ import annotations

import math

import pytest

from emulators.encoder import AbsoluteEncoder, IncrementalEncoder
from emulators.encoder.profidrive import EncoderAbilities, EncoderFormat, EncoderInterface, p979
from fieldbus.errors import ConfigurationError

ABSOLUTE = 0x2000


def at(interface, encoder, turns):
    """Return both values with the encoder at a number of turns."""
    encoder.sample(turns * math.tau)
    return interface.step(ABSOLUTE if interface.form.absolute else 0, 0)[1:]


@pytest.mark.requirement("PD-171", "PD-172")
def test_fine_bits_of_an_incremental_encoder():
    """Gx_XIST1 = lines * 2^shift; one that the model counts fourfold has two of the bits from that."""
    encoder = IncrementalEncoder(counts_per_revolution=8192)
    encoder.power_on(1.25 * math.tau)
    interface = EncoderInterface(encoder, EncoderFormat(periods=2048, interpolation_bits=2))
    assert at(interface, encoder, 1.25) == (0, 0)
    assert at(interface, encoder, 2.25) == (2048 << 11, 0)
    assert at(interface, encoder, 1.25 + 1 / 8192) == (1 << 9, 0)
    assert at(interface, encoder, 1.0) == (-(512 << 11), 0)


def test_coarse_counter():
    """A shift below the model's own fineness drops its last bits."""
    encoder = IncrementalEncoder(counts_per_revolution=8192)
    interface = EncoderInterface(encoder, EncoderFormat(periods=2048, interpolation_bits=2, shift_xist1=0))
    assert at(interface, encoder, 3 / 8192) == (0, 0)
    assert at(interface, encoder, 4 / 8192) == (1, 0)
    assert at(interface, encoder, -1 / 8192) == (-1, 0)


@pytest.mark.requirement("PD-172", "PD-173")
def test_start_with_the_absolute_value():
    """Gx_XIST1 begins at 0, or with the absolute value when P979[1] bit 1 says so."""
    encoder = AbsoluteEncoder(turns=8, counts_per_revolution=512)
    encoder.power_on(5.5 * math.tau)
    form = EncoderFormat(periods=512, revolutions=8, shift_xist1=11, shift_xist2=9)
    plain = EncoderInterface(encoder, form)
    assert at(plain, encoder, 5.5) == (0, 2816 << 9)
    loaded = EncoderInterface(
        encoder, EncoderFormat(periods=512, revolutions=8, shift_xist1=11, shift_xist2=9, load_absolute=True)
    )
    assert at(loaded, encoder, 5.5) == (2816 << 11, 2816 << 9)
    assert at(loaded, encoder, 9.0) == (9 * 512 << 11, 512 << 9)


@pytest.mark.requirement("PD-171")
@pytest.mark.parametrize(
    ("bits", "start", "after"), [(16, 0xFFFF, 0), (32, 0x7FFF_FFFF, -0x8000_0000), (32, 0xFFFF_FFFF, 0)]
)
def test_counter_wraps(bits, start, after):
    """The counter wraps at its width, without a jump of anything else."""
    encoder = IncrementalEncoder(counts_per_revolution=200)
    interface = EncoderInterface(
        encoder, EncoderFormat(periods=200, shift_xist1=0, counter_bits=bits, start_value=start)
    )
    assert at(interface, encoder, 0)[0] & (1 << bits) - 1 == start
    assert at(interface, encoder, 1 / 200)[0] == after
    assert at(interface, encoder, 0)[0] & (1 << bits) - 1 == start


@pytest.mark.requirement("PD-174")
def test_encoder_profile_formats():
    """Profile 4.0: Gx_XIST1 left-aligned, so that it wraps with the encoder; 4.1: right-aligned; Gx_XIST2
    always right-aligned.
    """
    encoder = AbsoluteEncoder(turns=4096, counts_per_revolution=8192)
    turns = 4095 + 8191 / 8192
    encoder.power_on(turns * math.tau)
    old = EncoderInterface(encoder, EncoderFormat.profile_4_0(periods=8192, revolutions=4096))
    new = EncoderInterface(encoder, EncoderFormat.profile_4_1(periods=8192, revolutions=4096))
    last = 4096 * 8192 - 1
    assert old.form.shift_xist1 == 32 - 25
    assert at(old, encoder, turns) == ((last << 7) - (1 << 32), last)
    assert at(new, encoder, turns) == (last, last)
    assert at(old, encoder, 4096) == (0, 0)
    assert at(new, encoder, 4096) == (last + 1, 0)


@pytest.mark.requirement("PD-013")
def test_64_bits():
    """The wide counter does not wrap with Gx_XIST1."""
    encoder = IncrementalEncoder(counts_per_revolution=1 << 20)
    interface = EncoderInterface(encoder, EncoderFormat(periods=1 << 20, shift_xist1=11, wide=True))
    at(interface, encoder, 3)
    assert interface.xist3 == 3 << 31
    at(interface, encoder, -3)
    assert interface.xist3 == -(3 << 31)
    interface.step(0x4000, 0)
    assert interface.xist3 == 0


@pytest.mark.requirement("PD-188", "PD-189", "PD-190", "PD-191", "PD-192", "PD-193", "PD-194")
def test_p979():
    """The array tells the format that is in force, for up to three encoders, in 31 elements."""
    incremental = EncoderFormat(periods=2048)
    multi = EncoderFormat(periods=512, revolutions=4096, load_absolute=True, shift_xist1=11, shift_xist2=9)
    linear = EncoderFormat(periods=1_000_000, grid_nm=20_000, shift_xist1=8, shift_xist2=0, wide=True)
    array = p979(incremental, multi, linear)
    assert len(array) == 31
    assert array[0] == 0x5312
    assert p979(incremental)[0] == 0x5112
    assert array[1:11] == (0xC000_0000, 2048, 11, 9, 0, 0, 0, 0, 0, 0)
    assert array[11:21] == (0xC000_0002, 512, 11, 9, 4096, 0, 0, 0, 0, 0)
    assert array[21:31] == (0xC000_0005, 20_000, 8, 0, 0, 0, 0, 0, 0, 0)
    assert p979(incremental)[11:] == (0,) * 20


@pytest.mark.requirement("PD-190", "PD-191")
def test_position_from_p979():
    """A controller that knows P979 alone gets the true position from Gx_XIST1."""
    encoder = IncrementalEncoder(counts_per_revolution=2500 << 4)
    interface = EncoderInterface(encoder, EncoderFormat(periods=2500, interpolation_bits=4, shift_xist1=7))
    _, _, resolution, shift, *_ = p979(interface.form)
    xist1, _ = at(interface, encoder, 12.3456)
    assert xist1 / (resolution << shift) == pytest.approx(12.3456, abs=1 / (2500 << 4))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"periods": 0}, "periods"),
        ({"shift_xist1": 32}, "shift_xist1"),
        ({"shift_xist2": -1}, "shift_xist2"),
        ({"counter_bits": 33}, "counter_bits"),
        ({"counter_bits": 16, "start_value": 65536}, "start_value"),
        ({"load_absolute": True}, "load_absolute"),
        ({"revolutions": 1, "load_absolute": True, "start_value": 5}, "start_value"),
        ({"grid_nm": 20_000, "revolutions": 2}, "revolutions"),
        ({"revolutions": 65536, "periods": 8192}, "shift_xist2"),
    ],
)
def test_format_is_checked(wrong, message):
    """A format that cannot be is refused with the name of the value."""
    with pytest.raises(ConfigurationError, match=message):
        EncoderFormat(**wrong)


def test_encoder_has_to_fit():
    """An encoder that counts otherwise than the format says is refused, and so are abilities out of their
    range.
    """
    with pytest.raises(ConfigurationError, match="1000 increments"):
        EncoderInterface(IncrementalEncoder(counts_per_revolution=1000), EncoderFormat(periods=1024))
    with pytest.raises(ConfigurationError, match="reference_marks"):
        EncoderAbilities(reference_marks=5)
    with pytest.raises(ConfigurationError, match="zero_mark_tolerance"):
        EncoderAbilities(zero_mark_tolerance=-1)
    with pytest.raises(ConfigurationError, match="encoders"):
        p979()
