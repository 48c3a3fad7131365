"""Personalities: the files, every quirk compared with the profile's behaviour, and a drive of each that can
be moved.
"""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from emulators.drive.cia402 import (
    DriveConfig,
    EmcyCode,
    Personality,
    Quirks,
    load_personality,
    personality_names,
)
from emulators.drive.machine import NO_SWITCHES
from fieldbus.canopen import NmtCommand
from fieldbus.canopen.abort import SdoAbort
from fieldbus.cia402 import DriveState as S
from fieldbus.errors import ConfigurationError

REFERENCE = DriveConfig.reference()
REV = 131072


@pytest.fixture
def pair(make_bench):
    """Return a function that builds two benches: one as the profile says, one with quirks."""

    def build(config=REFERENCE, **quirks):
        return [make_bench(config), make_bench(replace(config, quirks=Quirks(**quirks)))]

    return build


# -- files ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", personality_names())
def test_every_file_is_sound_and_every_deviation_has_a_source(name):
    """Name and file agree, and each deviation says where it is documented."""
    personality = load_personality(name)
    assert personality.name == name
    assert personality.summary.endswith(".")
    assert set(personality.sources) == {
        one for one in personality.deviations if one != "quirks.auto_reset_attempts"
    }


def test_every_quirk_is_used_by_a_personality():
    """No switch in the code without a drive that needs it; one personality has none."""
    used = {
        one.removeprefix("quirks.")
        for name in personality_names()
        for one in load_personality(name).deviations
        if one.startswith("quirks.")
    }
    assert used | {"auto_reset_attempts"} == {one.name for one in fields(Quirks)}
    assert load_personality("standard").deviations == ()
    assert len(personality_names()) >= 9


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "x"\nsummary = "s"\n[quirk]\n', "quirk.*name, summary, quirks"),
        ('name = "X y"\nsummary = "s"\n', "lower-case words"),
        ('name = "x"\n', "summary.*a text"),
        (
            'name = "x"\nsummary = "s"\n[quirks]\nhalt_block = true\n',
            "quirks.halt_block.*halt_blocks_acknowledge",
        ),
        (
            'name = "x"\nsummary = "s"\n[quirks]\nsingle_setpoint = 1\n',
            "quirks.single_setpoint.*a value like False",
        ),
        ('name = "x"\nsummary = "s"\n[quirks]\nauto_reset_s = -1.0\n', r"quirks.auto_reset_s.*0\.\.3600 s"),
        ('name = "x"\nsummary = "s"\n[quirks]\nstatus_homed = 1\n', "status_homed.*0100h, 4000h, 8000h"),
        ('name = "x"\nsummary = "s"\n[drive]\nnode_id = 3\n', "drive.node_id.*home_offset, self_test_s"),
        ('name = "x"\nsummary = "s"\n[drive]\nhome_offset = "up"\n', "home_offset.*profile, vendor"),
        ('name = "x"\nsummary = "s"\n[objects]\n"60FFh" = 1\n', "1800:2"),
        ('name = "x"\nsummary = "s"\n[objects]\n"1800:2" = "a"\n', "a whole number"),
        ('name = "x"\nsummary = "s"\n[emcy.86]\ncode = 1\n', "four hexadecimal digits"),
        ('name = "x"\nsummary = "s"\n[emcy.8611]\ndata = "zz"\n', "hexadecimal text"),
        ('name = "x"\nsummary = "s"\n[emcy.8611]\ncode = 0\n', r"1\.\.65535"),
        ('name = "x"\nsummary = "s"\n[sources]\nemcy = "manual"\n', "there is no deviation"),
        ("name = ", "TOML"),
    ],
)
def test_a_wrong_file_says_what_is_allowed(tmp_path, text, message):
    """Every mistake is refused with file, key and what is allowed."""
    file = tmp_path / "own.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=message):
        load_personality(file)


def test_unknown_names_and_missing_files():
    """A name that is none lists those that there are; a file that is missing says so."""
    with pytest.raises(ConfigurationError, match="standard"):
        load_personality("sinamics")
    with pytest.raises(ConfigurationError, match="readable file"):
        load_personality("no/such.toml")


def test_objects_of_the_user_win_over_those_of_the_personality(make_bench):
    """A personality changes defaults; what the configuration sets itself stays."""
    personality = Personality(name="x", summary="s", objects={(0x605A, 0): 6, (0x605E, 0): 1})
    bench = make_bench(personality.apply(replace(REFERENCE, objects={**REFERENCE.objects, (0x605E, 0): 0})))
    assert (bench.read(0x605A), bench.read(0x605E)) == (6, 0)


# -- quirks --------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-091", "C402-076")
def test_halt_blocks_acknowledge(pair):
    """Profile: a setpoint is acknowledged during halt. Quirk: bit 12 stays 0 until halt goes, then it is
    taken.
    """
    acknowledged = []
    for bench in pair(halt_blocks_acknowledge=True):
        bench.enable(1)
        bench.write(0x607A, REV)
        bench.control(0x10F)
        bench.control(0x11F, 0.05)
        acknowledged.append(bool(bench.status & 0x1000))
        bench.control(0x1F, 0.01)
        assert bench.status & 0x1000
        bench.control(0x0F, 3.0)
        assert bench.read(0x6064) == pytest.approx(REV, abs=2)
    assert acknowledged == [True, False]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-091", "C402-092")
def test_single_setpoint(pair):
    """Profile: a second setpoint waits in the buffer. Quirk: it is lost unless bit 5 is set."""
    ends = []
    for bench in pair(single_setpoint=True):
        bench.enable(1)
        bench.write(0x607A, REV)
        bench.control(0x1F)
        bench.control(0x0F)
        bench.write(0x607A, 2 * REV)
        bench.control(0x1F, 0.1)
        bench.control(0x0F, 5.0)
        ends.append(round(bench.read(0x6064) / REV, 3))
        bench.write(0x607A, 3 * REV)
        bench.control(0x3F)
        bench.control(0x2F)
        bench.write(0x607A, 4 * REV)
        bench.control(0x3F)
        bench.control(0x2F, 5.0)
        assert bench.read(0x6064) == pytest.approx(4 * REV, abs=2)
    assert ends == [2, 1]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-091", "C402-092")
def test_setpoint_needs_bit_5(pair):
    """Profile: bit 4 alone starts. Quirk: without bit 5 nothing is taken and nothing acknowledged."""
    moved = []
    for bench in pair(setpoint_needs_bit_5=True):
        bench.enable(1)
        bench.write(0x607A, REV)
        bench.control(0x1F, 3.0)
        moved.append((abs(bench.read(0x6064) - REV) <= 2, bool(bench.status & 0x1000)))
        bench.control(0x0F)
        bench.write(0x607A, 2 * REV)
        bench.control(0x3F, 3.0)
        assert bench.read(0x6064) == pytest.approx(2 * REV, abs=2)
    assert moved == [(True, True), (False, False)]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-005", "C402-089", "C402-100")
def test_csp_without_primed_target(pair):
    """Profile: csp holds where it is until a target has been given. Quirk: it goes to 607Ah = 0 at once."""
    ends = []
    for bench in pair(
        config=replace(
            REFERENCE,
            encoder=replace(REFERENCE.encoder, kind="absolute"),
            mechanics=replace(REFERENCE.mechanics, start_position_mm=20.0),
        ),
        csp_jumps_unprimed=True,
    ):
        start = bench.read(0x6064)
        assert start == 2 * REV
        bench.enable(8)
        bench.run(2.0)
        ends.append(bench.read(0x6064))
        bench.write(0x607A, REV)
        bench.run(2.0)
        assert bench.read(0x6064) == REV
    assert ends == [2 * REV, 0]


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-016", "C402-025")
def test_faults_that_clear_themselves(pair):
    """Profile: Fault stays. Quirk: Switch on disabled after the time, not before the cause is gone, and so
    often only.
    """
    standard, quirky = pair(auto_reset_s=0.5, auto_reset_attempts=2)
    for bench in (standard, quirky):
        bench.drive.raise_fault(0x4310, persistent=True)
        bench.run(2.0)
        assert bench.state is S.FAULT
        bench.drive.clear_fault_cause()
        bench.run(0.6)
    assert (standard.state, quirky.state) == (S.FAULT, S.SWITCH_ON_DISABLED)
    assert quirky.emcys == [(0x4310, 0x09), (0, 0)]
    quirky.drive.raise_fault(0x4310)
    quirky.run(0.4)
    assert quirky.state is S.FAULT
    quirky.run(0.2)
    assert quirky.state is S.SWITCH_ON_DISABLED
    quirky.drive.raise_fault(0x4310)
    quirky.run(5.0)
    assert quirky.state is S.FAULT, "the attempts are used up"
    quirky.control(0x80)
    quirky.drive.raise_fault(0x4310)
    quirky.run(0.6)
    assert quirky.state is S.SWITCH_ON_DISABLED, "a reset by the controller lets them count again"


@pytest.mark.requirement("C402-004", "C402-010", "C402-011", "C402-029")
def test_switched_on_without_mains(pair):
    """Profile: transition 3 waits for the DC link. Quirk: Switched on without, and back to Switch on disabled
    after 3 s.
    """
    states = []
    for bench in pair(falls_back_without_power_s=3.0):
        bench.drive.set_dc_link_voltage(0.0)
        bench.control(0x06)
        bench.control(0x07)
        states.append(bench.state)
        bench.control(0x0F)
        assert bench.state is states[-1], "there is no operation without DC link"
        bench.run(2.9)
        assert bench.state is states[-1]
        bench.run(0.2)
        states.append(bench.state)
        bench.drive.restore_dc_link()
    assert states == [S.READY_TO_SWITCH_ON] * 2 + [S.SWITCHED_ON, S.SWITCH_ON_DISABLED]


def test_mains_that_come_back_in_time_keep_switched_on(make_bench):
    """A DC link that returns within the time leaves the drive in Switched on."""
    bench = make_bench(replace(REFERENCE, quirks=Quirks(falls_back_without_power_s=3.0)))
    bench.to_state(S.SWITCHED_ON)
    bench.drive.set_dc_link_voltage(0.0)
    bench.run(2.0)
    bench.drive.restore_dc_link()
    bench.run(5.0)
    assert bench.state is S.SWITCHED_ON


@pytest.mark.requirement("C402-001", "C402-002")
def test_not_ready_to_switch_on(make_bench):
    """Profile: during the self-test the status word shows Not ready. Quirk: it cannot be read and no TPDO
    carries it.
    """
    for silent in (False, True):
        bench = make_bench(
            replace(REFERENCE, self_test_s=0.5, quirks=Quirks(silent_until_ready=silent)), power=False
        )
        bench.map_tpdo(1, (0x60410010, 0x60640020))
        bench.map_tpdo(2, (0x606C0020,))
        bench.write(0x1010, 0x65766173, 1)
        bench.drive.power_on()
        bench.run(0.1)
        bench.master.nmt(NmtCommand.START, 1)
        bench.master.start_sync(4_000_000)
        bench.run(0.2)
        seen = {entry[2].can_id for entry in bench.medium.log}
        assert bench.state is S.NOT_READY_TO_SWITCH_ON
        assert 0x281 in seen
        assert (0x181 in seen) is not silent
        if silent:
            with pytest.raises(SdoAbort):
                bench.read(0x6041)
        else:
            assert bench.status & 0x4F == 0
        bench.run(0.3)
        assert bench.state is S.SWITCH_ON_DISABLED
        assert bench.status & 0x4F == 0x40
        assert 0x181 in {entry[2].can_id for entry in bench.medium.log}


@pytest.mark.requirement("C402-042", "C402-048")
def test_homed_and_homing_refused_in_the_status_word(pair):
    """Profile: bits 8 and 15 are 0. Quirk: 15 after a homing that was refused, 8 from success until
    power-off.
    """
    words = []
    for bench in pair(status_homed=0x100, status_homing_refused=0x8000):
        bench.enable(6)
        for method in (0, 37):
            bench.write(0x6098, method)
            bench.control(0x0F)
            bench.control(0x1F, 0.05)
            words.append(bench.status & 0x8100)
        bench.control(0x00)
        words.append(bench.status & 0x8100)
        bench.drive.power_off()
        bench.drive.power_on()
        bench.run(0.01)
        words.append(bench.status & 0x8100)
    assert words == [0, 0, 0, 0, 0x8000, 0x100, 0x100, 0]


@pytest.mark.requirement("C402-135")
def test_homing_that_finishes_when_it_is_released(pair):
    """Profile: bits 12 and 10 together. Quirk: 010 "attained" while bit 4 is set, 011 "finished" when it is
    withdrawn.
    """
    words = []
    for bench in pair(homing_finishes_on_release=True):
        bench.enable(6)
        bench.write(0x6098, 37)
        bench.control(0x1F, 0.05)
        words.append(bench.status & 0x3400)
        bench.control(0x0F, 0.05)
        words.append(bench.status & 0x3400)
    assert words == [0x1400, 0x1400, 0x1000, 0x1400]


@pytest.mark.requirement("C402-020")
def test_switched_on_is_skipped(pair):
    """Profile: 000Fh in Ready shows Switched on before Operation enabled. Quirk: it is never seen on the
    bus.
    """
    seen = []
    for bench in pair(skips_switched_on=True):
        bench.start_cyclic(9)
        bench.word = 0x06
        bench.run(0.02)
        before = len(bench.medium.log)
        bench.word = 0x0F
        bench.run(0.05)
        assert bench.state is S.OPERATION_ENABLED
        words = [
            entry[2].data[0] & 0x6F for entry in list(bench.medium.log)[before:] if entry[2].can_id == 0x181
        ]
        assert words[-1] == 0x27
        seen.append(0x23 in words)
    assert seen == [True, False]


@pytest.mark.requirement("C402-138")
def test_sign_of_the_home_offset(make_bench):
    """Profile: 6064h = -607Ch at the home point; the personality with the other sign: +607Ch."""
    positions = []
    for name in ("standard", "auto-retry-inverter"):
        bench = make_bench(load_personality(name).apply(REFERENCE))
        bench.enable(6)
        bench.configure({0x6098: 37, 0x607C: 1000})
        bench.control(0x1F, 0.05)
        positions.append(bench.read(0x6064))
    assert positions == [-1000, 1000]


@pytest.mark.requirement("C301-108", "C402-306", "C402-308")
def test_emcy_codes_of_a_personality(make_bench):
    """Other code, register and bytes on the wire, in 603Fh and 1003h; the reset clears what was sent."""
    bench = make_bench(load_personality("compact-motion-controller").apply(REFERENCE))
    bench.drive.raise_fault(0x8611)
    bench.drive.raise_fault(0x7305)
    bench.run(0.01)
    frames = [entry[2].data.hex() for entry in bench.medium.log if entry[2].can_id == 0x81]
    # The first is the worked example of the manual: 11 86 20 02 00 00 00 00, with the generic bit of 1001h.
    assert frames == ["1186210200000000", "0073a14000000000"]
    assert bench.read(0x603F) == 0x7300
    assert bench.read(0x1003, 1) == 0x7300 | 0x40 << 16
    assert bench.drive.faults.latest == 0x7305
    bench.control(0x80)
    assert bench.emcys[-1] == (0, 0)
    assert bench.read(0x1001) == 0


@pytest.mark.requirement("C301-123")
def test_emcy_codes_of_communication_errors_too(make_bench):
    """What the slave itself reports, here a lost heartbeat, is sent in the way of the manufacturer as
    well.
    """
    bench = make_bench(load_personality("compact-motion-controller").apply(REFERENCE))
    bench.write(0x1016, 127 << 16 | 50, 1)
    bench.master.produce_heartbeat(20_000_000)
    bench.run(0.1)
    bench.master.produce_heartbeat(0)
    bench.run(0.1)
    frames = [entry[2].data.hex() for entry in bench.medium.log if entry[2].can_id == 0x81]
    assert frames == ["3081110008000000"]


def test_fault_number_as_text(make_bench):
    """A personality may put its display text behind code and register."""
    bench = make_bench(load_personality("halt-blocks-setpoints").apply(REFERENCE))
    bench.drive.raise_fault(0x3210)
    bench.run(0.01)
    (frame,) = [entry[2].data for entry in bench.medium.log if entry[2].can_id == 0x81]
    assert frame[3:7] == b"F501"


@pytest.mark.requirement("C402-279", "C402-287")
def test_default_pdos_of_a_personality(make_bench):
    """The PDOs that a drive has before anybody maps them are data as well."""
    sizes = []
    for name in ("standard", "io-pdo-servo"):
        bench = make_bench(load_personality(name).apply(REFERENCE))
        bench.master.nmt(NmtCommand.START, 1)
        bench.run(0.01)
        sizes.append(next(len(entry[2].data) for entry in bench.medium.log if entry[2].can_id == 0x181))
    assert sizes == [2, 6]


def test_the_name_can_be_read(make_bench):
    """2109h tells which personality is in force."""
    bench = make_bench(load_personality("single-setpoint-servo").apply(REFERENCE))
    assert bench.drive.peek(0x2109) == "single-setpoint-servo"


# -- contract ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", personality_names())
def test_every_personality_can_be_driven(make_bench, name):
    """Whatever its quirks: enable, csv motion, quick stop, fault, reset, enable again, by PDO."""
    bench = make_bench(load_personality(name).apply(replace(REFERENCE, switches=NO_SWITCHES)))
    bench.until(lambda: bench.drive.state is S.SWITCH_ON_DISABLED)
    bench.start_cyclic(9)
    bench.enable_cyclic()
    bench.target = 600_000
    bench.run(0.3)
    assert bench.drive.core.speed_rpm == pytest.approx(600.0, rel=1e-3)
    bench.word = 0x02
    bench.run(0.4)
    assert bench.drive.core.standing
    bench.target = 0
    bench.enable_cyclic()
    bench.drive.raise_fault(0x4310)
    bench.run(0.02)
    assert bench.drive.faults.latest == 0x4310
    bench.word = 0x80
    bench.run(0.02)
    assert bench.state is S.SWITCH_ON_DISABLED
    bench.enable_cyclic()


def test_emcy_codes_are_checked():
    """Code, register and data of a replacement have their ranges."""
    for values in ({"code": 0}, {"code": 1, "register": 256}, {"code": 1, "data": bytes(6)}):
        with pytest.raises(ConfigurationError):
            EmcyCode(**values)
