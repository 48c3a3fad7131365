"""Stored parameters in a file: what 1010h and 1011h do, over the end of the process."""

from __future__ import annotations

import json
import math
import re

import pytest

from fieldbus.canopen import AbortCode, NmtCommand, PumpedNetwork
from fieldbus.errors import ConfigurationError

SAVE = 0x65766173
LOAD = 0x64616F6C


@pytest.fixture
def path(tmp_path):
    return tmp_path / "drive1.json"


@pytest.fixture
def start(kit, path):
    """Start a new device on the same file, as a new process would."""

    def start(od=None):
        bench = kit.Bench(od, storage=path)
        bench.slave.power_on()
        bench.run()
        return bench

    return start


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-018", "C301-140")
def test_saved_values_survive_the_process(start, kit, path):
    """What 1010h:1 has saved is there in a new device on the same file; what was not saved is not."""
    bench = start()
    assert not path.exists()
    with PumpedNetwork(bench.segment) as network:
        sdo = network.add_node(kit.NODE, kit.dictionary(kit.NODE)).sdo
        sdo[0x6083].raw = 4711
        sdo[0x607D][1].raw = -77
        sdo[0x2001].raw = "name of the axis"
        sdo[0x2008].raw = 0.1
        sdo[0x200B].raw = b"\x00\xff\x10"
        sdo[0x2007].raw = -(1 << 63)
        sdo[0x1017].raw = 100
        network[kit.NODE].store()
        sdo[0x6083].raw = 4712
    get = start().slave.get
    assert [get(0x6083), get(0x607D, 1), get(0x2001), get(0x200B), get(0x2007), get(0x1017)] == [
        4711,
        -77,
        "name of the axis",
        b"\x00\xff\x10",
        -(1 << 63),
        100,
    ]
    assert math.isclose(get(0x2008), 0.1, rel_tol=1e-6)


@pytest.mark.requirement("C301-140", "C301-141")
def test_groups_and_restore_over_processes(start):
    """Saving and restoring act on their group in the file too; a restore ordered before the end is carried
    out at the next start.
    """
    bench = start()
    bench.write(0x6083, 0, 7, 4)
    bench.write(0x1017, 0, 500, 2)
    assert bench.write(0x1010, 2, SAVE, 4) == 0
    bench = start()
    assert (bench.read(0x6083), bench.read(0x1017)) == (1000, 500)
    bench.write(0x6083, 0, 7, 4)
    assert bench.write(0x1010, 3, SAVE, 4) == 0
    assert bench.write(0x1011, 2, LOAD, 4) == 0
    bench = start()
    assert (bench.read(0x6083), bench.read(0x1017)) == (7, 0)
    bench = start()
    assert (bench.read(0x6083), bench.read(0x1017)) == (7, 0)
    assert bench.write(0x1011, 1, LOAD, 4) == 0
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6083) == 1000
    assert start().read(0x6083) == 1000


@pytest.mark.requirement("C301-148")
def test_date_of_the_configuration_is_stored(start):
    """1020h survives with the configuration that it dates."""
    bench = start()
    bench.write(0x1020, 1, 15000, 4)
    bench.write(0x1020, 2, 300, 4)
    assert bench.write(0x1010, 1, SAVE, 4) == 0
    bench = start()
    assert (bench.read(0x1020, 1), bench.read(0x1020, 2)) == (15000, 300)


@pytest.mark.requirement("C301-092", "C301-140")
@pytest.mark.parametrize(("index", "signature"), [(0x1010, SAVE), (0x1011, LOAD)])
def test_a_file_that_cannot_be_written_is_a_hardware_error(kit, tmp_path, index, signature):
    """The command is aborted with 06060000h, and the memory is what it was."""
    folder = tmp_path / "folder"
    folder.mkdir()
    bench = kit.Bench(storage=folder / "drive.json")
    bench.slave.power_on()
    bench.run()
    bench.write(0x6083, 0, 7, 4)
    folder.rmdir()
    assert bench.write(index, 1, signature, 4) == AbortCode.HARDWARE
    (event,) = [event for event in bench.history.events if event.kind == "storage.failed"]
    assert "drive.json" in event.data["reason"]
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6083) == 1000
    folder.mkdir()
    bench.write(0x6083, 0, 7, 4)
    assert bench.write(0x1010, 1, SAVE, 4) == 0
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6083) == 7


def test_the_file_is_replaced_as_a_whole(start, path):
    """Saving leaves one complete file and no draft of it."""
    bench = start()
    for value in range(3):
        bench.write(0x6083, 0, value, 4)
        assert bench.write(0x1010, 1, SAVE, 4) == 0
        assert json.loads(path.read_text())["memory"]["values"]["6083:00"] == f"{value:02x}000000"
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def saved(start, path):
    bench = start()
    bench.write(0x6083, 0, 7, 4)
    bench.write(0x1010, 1, SAVE, 4)
    return json.loads(path.read_text())


@pytest.mark.parametrize("cut", [0, 1, 100, -3])
def test_a_damaged_file_is_refused(start, path, cut):
    """A file that is cut off is refused with its name."""
    saved(start, path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(ConfigurationError, match=r"storage: .*drive1.json"):
        start()


@pytest.mark.exhaustive
def test_every_changed_character_of_the_values_is_noticed(start, path):
    """The checksum covers every value: changing a digit of any number is noticed."""
    saved(start, path)
    text = path.read_text()
    numbers = [match.span() for match in re.finditer(r"\d+", text)]
    for count, (first, end) in [*enumerate(numbers)][::3]:
        place = first + count % (end - first)
        path.write_text(text[:place] + ("1" if text[place] == "0" else "0") + text[place + 1 :])
        with pytest.raises(ConfigurationError, match="drive1"):
            start()


@pytest.mark.parametrize(
    "content", ["[]", "{}", '{"format": 2}', "null", "7", '{"memory": 3, "format": 1, "sha256": ""}']
)
def test_other_files_are_refused(start, path, content):
    """Other JSON is no memory."""
    path.write_text(content)
    with pytest.raises(ConfigurationError, match="drive1"):
        start()


def test_binary_content_and_folders_are_refused(start, path):
    """Neither bytes that are no text nor a folder are a memory."""
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigurationError, match="readable"):
        start()
    path.unlink()
    path.mkdir()
    with pytest.raises(ConfigurationError, match="readable"):
        start()


def test_a_missing_folder_is_refused(kit, tmp_path):
    """A file in a folder that does not exist could never be written: refused at the start."""
    with pytest.raises(ConfigurationError, match="existing folder"):
        kit.Bench(storage=tmp_path / "nowhere" / "drive.json")


def test_the_memory_of_another_device_is_refused(start, kit, path):
    """Vendor and product have to be those of the EDS."""
    saved(start, path)
    od = kit.dictionary()
    od[0x1018][2].default = 1
    with pytest.raises(ConfigurationError, match="not of"):
        start(od)


@pytest.mark.exhaustive
@pytest.mark.parametrize("change", ["gone", "longer"])
def test_a_memory_that_does_not_fit_the_eds_is_refused(start, kit, path, change):
    """An object that the EDS no longer has, or has with another length, is named."""
    saved(start, path)
    od = kit.dictionary()
    if change == "gone":
        del od[0x6083]
    else:
        od[0x6083].data_type = 0x1B
    with pytest.raises(ConfigurationError, match="6083h:0"):
        start(od)
