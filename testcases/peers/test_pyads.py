"""The ADS client pyads with Beckhoff's library against `hil emulate --ads`."""

import os
import queue
import re
import signal

import pytest

from testcases.processes import Reader, hil_command

NET = "5.71.3.9.1.1"
PLC, NC = 851, 501


@pytest.fixture(scope="module")
def plc():
    """Connect to the PLC of an emulated NC; its library knows one TCP port only, so each run has its own
    address.
    """
    import pyads

    host = f"127.{1 + os.getpid() % 250}.{os.getpid() // 250 % 250}.9"
    command = [*hil_command(), "emulate", "nc-axes:reference", "--ads", "--host", host, "--net-id", NET]
    served = Reader(command, stream="stderr")
    try:
        served.wait_for("ready")
        pyads.open_port()
        pyads.set_local_address("10.77.1.1.1.1")
        pyads.add_route(NET, host)
        pyads.close_port()
        connection = pyads.Connection(NET, PLC, host)
        connection.open()
        yield connection
        connection.close()
    finally:
        served.end(signal.SIGINT)


def until(plc, name, value, *, seconds=5.0):
    """Wait for a notification that a value has come."""
    import pyads

    came = queue.Queue()

    kind = pyads.PLCTYPE_BOOL if isinstance(value, bool) else pyads.PLCTYPE_LREAL

    @plc.notification(kind)
    def take(handle, name, time, found):
        came.put(found)

    size = 1 if isinstance(value, bool) else 8
    handles = plc.add_device_notification(name, pyads.NotificationAttrib(size), take)
    try:
        while came.get(timeout=seconds) != value:
            pass
    finally:
        plc.del_device_notification(*handles)


def enable(plc):
    """Enable the axis; in each test that needs it, because tests may run in processes of their own."""
    inputs = {f"MAIN.axis1_Power.{one}": True for one in ("Enable", "Enable_Positive", "Enable_Negative")}
    assert set(plc.write_list_by_name(inputs).values()) == {"no error"}
    until(plc, "GVL.axis1.Status.Operational", True)


def test_an_axis_moves_by_symbols(plc):
    """Blocks are started by writing symbols, alone and in sums; their outputs and the process image come
    back.
    """
    import pyads

    name, version = plc.read_device_info()
    assert (name, version.version, plc.read_state()) == ("Plc30 App", 3, (pyads.ADSSTATE_RUN, 0))
    names = {symbol.name for symbol in plc.get_all_symbols()}
    assert {"GVL.axis1.NcToPlc.ActPos", "GVL.axis1.Status.Homed", "MAIN.axis1_Stop.Execute"} <= names
    enable(plc)
    plc.write_list_by_name(
        {"MAIN.axis1_MoveAbsolute.Position": 20.0, "MAIN.axis1_MoveAbsolute.Velocity": 200.0}
    )
    plc.write_by_name("MAIN.axis1_MoveAbsolute.Execute", True)
    until(plc, "MAIN.axis1_MoveAbsolute.Done", True)
    found = plc.read_list_by_name(["GVL.axis1.NcToPlc.ActPos", "GVL.axis1.NcToPlc.SetPos"])
    assert found["GVL.axis1.NcToPlc.SetPos"] == 20.0
    assert found["GVL.axis1.NcToPlc.ActPos"] == pytest.approx(20.0, abs=0.1)
    symbol = plc.get_symbol("GVL.axis1.NcToPlc.SetPos")
    assert (symbol.plc_type, symbol.read()) == (pyads.PLCTYPE_LREAL, 20.0)
    handle = plc.get_handle("GVL.axis1.NcToPlc.SetPos")
    assert plc.read_by_name("", pyads.PLCTYPE_LREAL, handle=handle) == 20.0
    plc.release_handle(handle)
    image = bytes(plc.read_by_name("GVL.axis1.NcToPlc", pyads.PLCTYPE_BYTE * 256))
    assert len(image) == 256


def test_what_pyads_is_told(plc):
    """Wrong names, types and values come back as the errors that pyads knows; the connection stays."""
    import pyads

    for wrong, words in (
        (lambda: plc.read_by_name("GVL.axis2.NcToPlc.ActPos", pyads.PLCTYPE_LREAL), "symbol not found"),
        (lambda: plc.write_by_name("GVL.axis1.NcToPlc.ActPos", 1.0, pyads.PLCTYPE_LREAL), "not permitted"),
        (lambda: plc.write_by_name("MAIN.axis1_Power.Enable", 1.0, pyads.PLCTYPE_LREAL), "size not correct"),
        (lambda: plc.read(0x1234, 0, pyads.PLCTYPE_INT), "invalid index group"),
        (lambda: plc.read(0x4040, 1 << 24, pyads.PLCTYPE_INT), "invalid index offset"),
    ):
        with pytest.raises(pyads.ADSError, match=re.escape(words)):
            wrong()
    nc = pyads.Connection(NET, NC, plc.ip_address)
    nc.open()
    assert nc.read_by_name("Axes.axis1.ctrl.pos_kv") == 20.0
    nc.write_by_name("Axes.axis1.ctrl.pos_kv", 25.0)
    assert nc.read_by_name("Axes.axis1.ctrl.pos_kv") == 25.0
    with pytest.raises(pyads.ADSError, match="invalid parameter value"):
        nc.write_by_name("Axes.axis1.ctrl.pos_kv", -1.0)
    nc.close()
    absent = pyads.Connection(NET, 900, plc.ip_address)
    absent.open()
    with pytest.raises(pyads.ADSError, match="port not found"):
        absent.read_state()


def test_the_plc_stops_by_control(plc):
    """Write control stops the PLC: the watchdog takes the enables; another one starts it again."""
    import pyads

    enable(plc)
    plc.write_control(pyads.ADSSTATE_STOP, 0, 0, pyads.PLCTYPE_INT)
    assert plc.read_state() == (pyads.ADSSTATE_STOP, 0)
    plc.write_control(pyads.ADSSTATE_RUN, 0, 0, pyads.PLCTYPE_INT)
    until(plc, "GVL.axis1.Status.Operational", True)
    with pytest.raises(pyads.ADSError, match="invalid state"):
        plc.write_control(pyads.ADSSTATE_CONFIG, 0, 0, pyads.PLCTYPE_INT)
