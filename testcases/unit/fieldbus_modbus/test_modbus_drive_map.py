"""Register maps from files, and a drive's parameters, telegram and time-out behind them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.profidrive.parameters.access import ParameterChannel
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import DriveMap, ModbusServer, Request, load_map
from fieldbus.profidrive import telegram
from fieldbus.profidrive.requests import Address, RequestId, decode_answer
from fieldbus.profidrive.requests import Request as ParameterRequest


class Drive:
    """The parameters of the emulated drive, and a telegram that only keeps what it gets."""

    def __init__(self):
        self.store = ParameterStore()
        self.server = ParameterServer({1: self.store})
        self.channel = ParameterChannel(self.server)
        self.received = []
        self.accesses = 0
        self.sent = bytes.fromhex("0237 1000")

    def receive(self, frame):
        self.received.append(frame)

    def transmit(self):
        return self.sent

    def accessed(self):
        self.accesses += 1

    def request(self, data):
        return self.server.request(data)

    def value(self, number, sub_index=0):
        answer = decode_answer(
            self.request(ParameterRequest(1, RequestId.READ, 1, (Address(number, sub_index),)).encode())
        )
        return answer.results[0].values[0]


class Rig:
    def __init__(self, name, **options):
        self.scheduler = VirtualScheduler()
        self.drive = Drive()
        file = load_map(name)
        self.map = DriveMap(
            self.scheduler, self.drive, file, telegram=telegram(1), channel=self.drive.channel, **options
        )
        self.server = ModbusServer(
            self.map.registers, functions=set(file.functions) - {43}, limits=file.limits
        )
        self.first = file.first

    def read(self, number, quantity=1):
        answer = self.server.respond(Request(3, number - self.first, quantity).encode())
        if answer[0] & 0x80:
            return f"exception {answer[1]}"
        return [answer[at] << 8 | answer[at + 1] for at in range(2, len(answer), 2)]

    def write(self, number, *words):
        answer = self.server.respond(Request(16, number - self.first, len(words), words).encode())
        return f"exception {answer[1]}" if answer[0] & 0x80 else "done"


@pytest.fixture
def g120():
    return Rig("sinamics_g120")


@pytest.fixture
def festo():
    return Rig("festo")


@pytest.mark.requirement("PD-286", "PD-295", "PD-296", "PD-299", "PD-300", "MODB-034")
def test_process_data_words(g120):
    """40100 on is the telegram to the drive, address 0063h on the wire; 40110 on the one from it,
    read-only.
    """
    assert g120.server.respond(bytes.fromhex("10 0063 0002 04 047f 1000")) == bytes.fromhex("10 0063 0002")
    assert g120.drive.received == [bytes.fromhex("047f 1000")]
    assert g120.write(40101, 0x2000) == "done"
    assert g120.drive.received[-1] == bytes.fromhex("047f 2000")
    assert g120.read(40100, 3) == [0x047F, 0x2000, 0]
    assert g120.read(40110, 4) == [0x0237, 0x1000, 0, 0]
    assert g120.write(40110, 1) == "exception 4"


@pytest.mark.requirement("PD-287", "PD-288", "PD-334", "PD-335", "PD-336")
def test_what_there_is_not(g120):
    """Registers between the blocks do not exist, other functions neither, 123 registers are too many to
    write.
    """
    assert g120.read(40099) == g120.read(40120) == g120.read(40723) == "exception 2"
    assert g120.read(40119, 2) == "exception 2"
    assert g120.server.respond(Request(4, 99, 1).encode()) == b"\x84\x01"
    assert g120.write(40601, *[0] * 122) == "done"
    assert g120.write(40600, *[0] * 123) == "exception 3"


@pytest.mark.requirement("PD-326", "PD-327", "PD-328", "PD-332")
def test_the_example_of_ds47(g120):
    """Reading r0002 word by word: not ready with code 4, then the answer with value 31."""
    assert g120.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000) == "done"
    assert g120.read(40601, 3) == [0x0001, 0x2F00, 0x0004]
    g120.scheduler.run_for(20 * MS)
    assert g120.read(40601, 6) == [0x0002, 0x2F08, 0x8001, 0x0101, 0x0301, 0x001F]
    assert g120.read(40607, 2) == [0, 0]


@pytest.mark.requirement("PD-206", "PD-326")
def test_ds47_in_two_steps_and_one_at_a_time(g120):
    """Values written with control 0 wait for control 1; while a request is carried out another one is
    refused.
    """
    assert g120.write(40601, 0, 0x2F0A, 0x8101, 0x0101, 0x1001, 0x0002, 0x0000) == "done"
    g120.scheduler.run_for(S)
    assert g120.read(40601) == [0]
    assert g120.write(40601, 1) == "done"
    assert g120.write(40601, 1, 0x2F0A, 0x8201) == "exception 4"
    g120.scheduler.run_for(S)
    assert g120.read(40603) == [0x8101]


@pytest.mark.requirement("PD-329", "PD-331")
@pytest.mark.parametrize(("header", "code"), [(0x2F00, 1), (0x2FF1, 1), (0x300A, 3), (0x000A, 3)])
def test_wrong_headers_of_ds47(g120, header, code):
    """A length of 0 or beyond 240 bytes, and another function than 2Fh, are reported in 40603."""
    assert g120.write(40601, 1, header, 0x8001) == "done"
    g120.scheduler.run_for(S)
    assert g120.read(40601, 3) == [2, 0x2F00, code]


@pytest.mark.requirement("PD-311", "PD-323", "PD-337")
def test_parameters_by_register(g120):
    """A register is its parameter times the scale, both ways; a refusal is exception 04 with the error in
    40499.
    """
    assert g120.read(40322) == [round(g120.drive.value(1120) * 100)]
    assert g120.write(40322, 150) == "done"
    assert g120.drive.value(1120) == pytest.approx(1.5)
    assert g120.read(40322) == [150]
    assert g120.write(40322, 65001) == "exception 4"
    assert g120.read(40499) == [0]
    broken = load_map("sinamics_g120").model_copy(
        update={
            "block": tuple(
                block.model_copy(update={"parameter": 4999}) if block.register_ == 40322 else block
                for block in load_map("sinamics_g120").block
            )
        }
    )
    map_ = DriveMap(g120.scheduler, g120.drive, broken, telegram=telegram(1), channel=g120.drive.channel)
    server = ModbusServer(map_.registers)
    map_.error_code = 0x7F
    assert server.respond(Request(3, 40322 - 40001, 1).encode()) == b"\x83\x04"
    assert server.respond(Request(3, 40499 - 40001, 1).encode()) == b"\x03\x02\x00\x00"


@pytest.mark.requirement("PD-294")
def test_values_that_do_not_fit_saturate(g120):
    """A value beyond 16 bits is shown as the largest number of the register."""
    map_ = DriveMap(
        g120.scheduler,
        g120.drive,
        load_map("sinamics_g120").model_copy(
            update={
                "block": tuple(
                    block.model_copy(update={"scale": 1e9})
                    for block in load_map("sinamics_g120").block
                    if block.register_ == 40322
                )
            }
        ),
        telegram=telegram(1),
    )
    assert ModbusServer(map_.registers).respond(Request(3, 321, 1).encode()) == b"\x03\x02\xff\xff"


@pytest.mark.requirement("PD-292")
@pytest.mark.parametrize(
    ("options", "counting"), [({}, (40100, 40101, 40110, 40111)), ({"watch_all": True}, range(40100, 40120))]
)
def test_which_registers_keep_the_process_data(options, counting):
    """On the line the first two of either direction, over TCP all of them; parameters never."""
    rig = Rig("sinamics_g120", **options)
    for register in (*range(40100, 40120), 40322, 40499, 40601):
        before = rig.drive.accesses
        rig.read(register)
        assert rig.drive.accesses - before == (register in counting), register
        if register < 40110 or register > 40601:
            rig.write(register, 0)
            assert rig.drive.accesses - before == 2 * (register in counting), register


@pytest.mark.exhaustive
@settings(max_examples=40)
@given(
    st.sampled_from(("sinamics_g120", "festo")),
    st.lists(
        st.tuples(
            st.one_of(
                st.integers(0, 130), st.integers(495, 515), st.integers(320, 350), st.integers(600, 610)
            ),
            st.lists(st.one_of(st.integers(0, 65535), st.integers(0, 3), st.just(0x2F0A)), max_size=40),
            st.integers(1, 40),
        ),
        max_size=12,
    ),
)
def test_any_words_at_any_register(name, orders):
    """Whatever is written anywhere, every request is answered, and afterwards a plain request of DS47 or the
    mailbox is.
    """
    rig = Rig(name)
    for address, words, quantity in orders:
        if words:
            answer = rig.server.respond(Request(16, address, len(words), tuple(words)).encode())
            assert answer[0] & 0x7F == 16
        assert rig.server.respond(Request(3, address, quantity).encode())[0] & 0x7F == 3
        rig.scheduler.run_for(7 * MS)
    rig.drive.store.factory_reset()
    if name == "festo":
        assert rig.write(500, 2, 0, 1, 1) == "done"
        assert rig.read(510) == [31]
    else:
        rig.scheduler.run_for(S)
        rig.write(40601, 1, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000)
        rig.scheduler.run_for(S)
        assert rig.read(40601, 6) == [0x0002, 0x2F08, 0x8001, 0x0101, 0x0301, 0x001F]


def test_festo_words(festo):
    """Words stand in the registers as they are, double words with the low word first, as telegram 111
    shows.
    """
    assert festo.write(0, 0x047F, 0x1000) == "done"
    assert festo.drive.received == [bytes.fromhex("047f 1000")]
    assert festo.read(100, 3) == [0x0237, 0x1000, 0]
    drive = Drive()
    chosen = telegram(111)
    drive.sent = chosen.actual.encode({"ZSW1": 0x0237, "XIST_A": 0x12345678, "NIST_B": -2, "FAULT_CODE": 7})
    map_ = DriveMap(festo.scheduler, drive, load_map("festo"), telegram=chosen)
    server = ModbusServer(map_.registers)
    words = [0x047F, 0, 0, 0, 0x4000, 0x5678, 0x1234, 0xFFFE, 0xFFFF, 0x2000, 0x4000]
    server.respond(Request(16, 0, len(words), tuple(words)).encode())
    sent = chosen.setpoint.decode(drive.received[-1])
    assert (sent["STW1"], sent["OVERRIDE"], sent["MDI_TARPOS"], sent["MDI_VELOCITY"]) == (
        0x047F,
        0x4000,
        0x12345678,
        -2,
    )
    assert (sent["MDI_ACC"], sent["MDI_DEC"]) == (0x2000, 0x4000)
    answer = server.respond(Request(3, 100, 12).encode())
    shown = [answer[at] << 8 | answer[at + 1] for at in range(2, len(answer), 2)]
    assert shown == [0x0237, 0, 0, 0, 0, 0x5678, 0x1234, 0xFFFE, 0xFFFF, 7, 0, 0]


def test_festo_time_out(festo):
    """Registers 400 and 401 are p2040 in milliseconds, low word first, with the limits of the parameter."""
    assert festo.write(400, 250, 0) == "done"
    assert festo.read(400, 2) == [250, 0]
    assert festo.drive.value(2040) == 250.0
    assert festo.write(401, 1) == "done"
    assert festo.drive.value(2040) == 65536.0 + 250.0
    assert festo.write(400, 0) == "done"
    assert [festo.read(400), festo.read(401)] == [[0], [1]]
    assert festo.write(401, 0x7FFF) == "exception 4"  # p2040 has its limits
    assert festo.read(400, 2) == [0, 1]


def test_festo_mailbox(festo):
    """Number, sub-index, elements, order: the state is 10h with the data from 510 on, or 3."""
    for register, word in ((500, 2), (501, 0), (502, 1), (503, 1)):
        assert festo.write(register, word) == "done"
    assert festo.read(503, 2) == [0x10, 2]
    assert festo.read(510) == [31]
    festo.write(500, 1120)
    festo.write(504, 4)
    festo.write(510, 0x0000, 0x4020)  # 2.5 as a float, low byte first
    festo.write(503, 2)
    assert festo.read(503) == [0x10]
    assert festo.drive.value(1120) == 2.5
    for register, word in ((500, 4999), (503, 1), (500, 2), (503, 7), (502, 0xFFFF), (503, 1)):
        festo.write(register, word)
        if register == 503:
            assert festo.read(503) == [3]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name = 3", "name"),
        ("name = 'x'", "block"),
        ("name = 'x'\n[[block]]\nregister = 1\nhook = 'no'", "hook"),
        ("name = 'x'\n[[block]]\nregister = 1\nwrong = 1", "wrong"),
        ("name = 'x'\nfirst = 2\n[[block]]\nregister = 1", "2 or more"),
        ("name = 'x'\n[[block]]\nregister = 1\nhook = 'ds47'\nparameter = 1", "not both"),
        ("name =", "TOML"),
    ],
)
def test_bad_files_say_where(tmp_path, text, said):
    """The message names the file and the key."""
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"bad.toml.*{said}"):
        load_map(path)
    with pytest.raises(ConfigurationError, match="sinamics_g120"):
        load_map("nothing")
