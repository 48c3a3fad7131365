"""Faults of Modbus segments: what is hit, how often, what becomes of it, what is refused."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import load_bench
from hil.faults import CATALOGUE, Fault, Injector

KINDS = [entry for entry in CATALOGUE if entry.name.startswith("modbus.")]
ON_LINE = {"modbus.crc", "modbus.broadcast", "modbus.noise"}
ON_NETWORK = {"modbus.transaction", "modbus.reset", "modbus.cut"}


def bench(name="profidrive_tcp"):
    return load_bench(name).build(seed=1)


def hits(machine):
    return [event.data["change"] for event in machine.history.select(kind="fault.hit")]


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_every_kind_is_applied_logged_and_taken_back(entry):
    """The example reads back from its TOML form, hits frames of its segment, and afterwards the link is as
    before.
    """
    fault = Fault.from_dict(dict(entry.example))
    assert Fault.from_dict(fault.to_dict()) == fault
    with bench("profidrive_rtu" if entry.name in ON_LINE else "profidrive_tcp") as machine:
        machine.run_for(0.5)
        link = machine.segment().link()
        hooks = len(link._hooks._entries)
        armed = Injector(machine).arm(fault)
        machine.run_for(1.5)
        armed.remove()
        assert entry.name in ("modbus.cut", "modbus.noise") or hits(machine)
        if fault.count is not None:
            assert len(hits(machine)) == fault.count
            assert armed.over
        assert len(link._hooks._entries) == hooks
        assert machine.drive().server.exception_hook is None
        assert machine.run_until(lambda: machine.port().link_ok, 5.0)


@pytest.mark.exhaustive
def test_faults_of_a_network_hit_an_io_station():
    """What a station sends, and its refusals, are hit as those of a drive are; its link can be cut, and comes
    back.
    """
    of_the_network = [entry for entry in KINDS if entry.name not in ON_LINE]
    with bench("analog") as machine:
        for entry in of_the_network:
            before = len(hits(machine))
            example = dict(entry.example)
            parameters = {**example.get("parameters", {}), "function": 23}  # with which a station is asked
            known = {parameter.name for parameter in entry.parameters}
            example["parameters"] = {name: one for name, one in parameters.items() if name in known}
            armed = Injector(machine).arm(Fault.from_dict(example))
            machine.run_for(0.2)
            armed.remove()
            assert entry.name == "modbus.cut" or len(hits(machine)) > before, entry.name
            machine.run_for(0.6)
        with pytest.raises(ConfigurationError, match=r"io \(on net0\)"):
            Injector(machine).inject("modbus.drop", drive="drive1")
        machine.run_until(machine.axis().reset().done, 1.0)
        assert machine.run_until(machine.axis().power().status, 3.0)


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_what_a_segment_has_not_is_refused(entry):
    """What needs a line is refused on a network, and the other way round; on CAN all of them are."""
    if entry.name in ON_LINE | ON_NETWORK:
        other = "profidrive_tcp" if entry.name in ON_LINE else "profidrive_rtu"
        with bench(other) as machine, pytest.raises(UnsupportedFaultError, match="needs a segment of kind"):
            Injector(machine).arm(Fault.from_dict(dict(entry.example)))
    with (
        bench("profidrive") as machine,
        pytest.raises(UnsupportedFaultError, match="can0 is no Modbus segment"),
    ):
        Injector(machine).arm(Fault.from_dict(dict(entry.example)))


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("modbus.drop", {"drive": "drive9"}, "drive1 .on net0."),
        ("modbus.exception", {"code": 9}, "1, 2, 3, 4"),
        ("modbus.exception", {"code": 12}, "1..11"),
        ("modbus.cut", {"count": 2}, "hits no frames"),
        ("modbus.drop", {"direction": "both"}, "request, response"),
    ],
)
def test_what_does_not_fit_is_refused(kind, options, message):
    """A drive of another segment, a code that there is not, a count of nothing."""
    with bench() as machine, pytest.raises(ConfigurationError, match=message):
        Injector(machine).inject(kind, **options)


@pytest.mark.exhaustive
def test_a_choice_of_frames_is_kept():
    """The third read and then every second one, four times: functions, first, every and count."""
    with bench() as machine:
        machine.run_for(0.2)
        Injector(machine).inject(
            "modbus.corrupt", count=4, function=3, first=3, every=2, register=1, mask=0x0001
        )
        machine.run_for(0.3)
        assert len(hits(machine)) == 4
        assert all(text.startswith("register 1: ") for text in hits(machine))


@pytest.mark.exhaustive
@pytest.mark.requirement("MODB-006")
def test_a_corrupt_register_on_a_line_has_a_right_crc():
    """The frame is right, its content is not: the axis takes it over."""
    with bench("profidrive_rtu") as machine:
        machine.run_for(0.5)
        missed = machine.port().missed
        Injector(machine).inject("modbus.corrupt", function=3, register=0, mask=0x0080, duration_s=0.3)
        machine.run_for(0.2)
        assert machine.port().zsw1 & 0x0080
        assert machine.port().missed == missed


@pytest.mark.requirement("MODB-032", "MODB-025")
def test_an_exception_keeps_the_drive_from_doing_it():
    """A write that is refused is not carried out: the drive keeps its last telegram."""
    with bench() as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, 3.0)
        before = machine.drive().drive.stw1
        Injector(machine).inject("modbus.exception", count=2, function=16, code=4)
        machine.run_for(0.006)
        assert machine.drive().drive.stw1 == before
        assert hits(machine)[0] == "function 10: exception 04"


# -- words
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["profidrive", "profidrive_tcp", "profidrive_rtu"])
def test_signals_of_telegrams_are_named_on_every_bus(name):
    """The log of a bus names the signals, in hexadecimal and in their unit."""
    with bench(name) as machine:
        axis = machine.axis()
        power = axis.power()
        assert machine.run_until(power.status, 4.0)
        job = axis.move_velocity(75.0)
        assert machine.run_until(job.in_velocity, 4.0)
        machine.run_for(0.2)
        segment = machine.segment()
        texts = [machine.decode(entry[2]) for entry in segment.log[-40:]]
    whole = "\n".join(texts)
    assert "STW1 = 047Fh (operate)" in whole
    assert "(S4 operation" in whole
    assert "rpm)" in whole
    assert any("NSOLL_B = " in text and " %, 4" in text for text in texts)


@pytest.mark.parametrize(
    ("word", "text"),
    [
        (0x047F, "operate"),
        (0x047E, "OFF1"),
        (0x047B, "OFF3"),
        (0x047C, "OFF2"),
        (0x0477, "operation disabled"),
        (0x007F, "no control by PLC"),
        (0x04FF, "operate, acknowledge"),
        (0x046F, "ramp generator off"),
        (0x043F, "no setpoint"),
        (0x057E, "OFF1, jog 1"),
    ],
)
def test_a_control_word_says_what_it_asks_for(word, text):
    """OFF2 goes before OFF3, OFF3 before OFF1, as in the drive (PD-114)."""
    from hil.bench.signal_texts import command

    assert command(word) == text


def test_a_signal_that_stands_in_two_frames_is_shown_in_parts():
    """Of a double word half of which is in the next PDO the words are named."""
    from fieldbus.profidrive import Layout
    from hil.bench.signal_texts import SignalTexts

    words = SignalTexts(
        Layout(["ZSW1", "NIST_B", "M_ACT", "G1_XIST1"]), reference_speed_rpm=3000.0, reference_torque_nm=2.0
    )
    assert words.describe(0, [0x0208, 0x2000]) == [
        "ZSW1 = 0208h (no state, fault)",
        "NIST_B word 1 of 2 = 2000h",
    ]
    assert words.describe(2, [0x0000, 0xE000, 0xFFFF, 0xFFFE]) == [
        "NIST_B word 2 of 2 = 0000h",
        "M_ACT = E000h (-50 %, -1 Nm)",
        "G1_XIST1 = FFFFFFFEh (-2)",
    ]
