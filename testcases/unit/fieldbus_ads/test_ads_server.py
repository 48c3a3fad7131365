"""The ADS server on real sockets under rude clients, and the symbols of an NC axis."""

import socket
import struct

import pytest

from fieldbus.ads import AdsServer, AdsState, Area, Frame, FrameReader, Memory, Port, Symbol, net_id
from fieldbus.ads.server import MOST_CONNECTIONS
from fieldbus.clock import RealtimeScheduler
from fieldbus.modbus.sockets import SocketNetwork
from hil.bench.ads_face import ads_ports
from hil.campaign import load_bench_file
from motion.nc.interface import NC_TO_PLC, PLC_TO_NC, NcToPlc, PlcToNc

OWN, PEER = net_id("5.1.2.3.1.1"), net_id("10.0.0.1.1.1")


@pytest.mark.realtime
def test_rude_clients():
    """Garbage, floods, half frames and too many connections end the connections that do it and no other."""
    memory = Memory()
    memory.name(Symbol("a", "BYTE", memory.add(Area(1, lambda: b"\7")), 1))
    scheduler = RealtimeScheduler()
    network = SocketNetwork(scheduler)
    server = AdsServer(network, OWN, {851: Port(memory, lambda: AdsState.RUN, lambda _: 0, "x")})
    where = network.serve()
    ask = Frame(OWN, 851, PEER, 1, 2, 4, 0, 9, struct.pack("<III", 0x4040, 0, 1)).pack()
    try:
        good = socket.create_connection(where)
        rude = [socket.create_connection(where) for _ in range(4)]
        for client, data in zip(
            rude, (b"\xff" * 4000, ask[:20], struct.pack("<HI", 0, 1 << 31), ask * 50), strict=True
        ):
            client.sendall(data)
        many = [socket.create_connection(where) for _ in range(MOST_CONNECTIONS)]
        scheduler.run_until(
            lambda: server.malformed == 2 and server.connections == MOST_CONNECTIONS, 3_000_000_000
        )
        assert server.malformed == 2
        assert server.connections == MOST_CONNECTIONS
        good.sendall(ask)
        reader, found = FrameReader(), []
        good.setblocking(False)

        def answered():
            try:
                found.extend(reader.feed(good.recv(1000)))
            except BlockingIOError:
                return False
            return bool(found)

        assert scheduler.run_until(answered, 3_000_000_000)
        assert found[0].data == struct.pack("<IIB", 0, 1, 7)
        for client in (good, *rude, *many):
            client.close()
        assert scheduler.run_until(lambda: server.connections == 0, 3_000_000_000)
    finally:
        network.close()


@pytest.mark.parametrize(("image", "members"), [(PlcToNc, PLC_TO_NC), (NcToPlc, NC_TO_PLC)])
def test_members_lie_where_the_image_has_them(image, members):
    """Every member of a process image is found at its offset with its type (NC-429 to NC-471)."""
    formats = {"DWORD": "<I", "UDINT": "<I", "DINT": "<i", "LREAL": "<d", "UINT": "<H", "BYTE": "<B"}
    empty = image().pack()
    for name, kind, offset in members:
        one = image()
        source = f"{name[6:9]}Pos" if name.startswith("Modulo") else ""
        if source:  # it follows from a position
            one.modulo_factor = 2.0
            setattr(one, source, 3.0)
            empty_then = bytearray(empty)
            for other, of, place in members:
                if other == source or (other != name and other.startswith(f"Modulo{source[:3]}")):
                    struct.pack_into(formats[of], empty_then, place, 3 if other == source else 1)
        else:
            setattr(one, name, 1)
            empty_then = empty
        packed = one.pack()
        assert struct.unpack_from(formats[kind], packed, offset) == (1,)
        size = struct.calcsize(formats[kind])
        assert packed[:offset] + packed[offset + size :] == empty_then[:offset] + empty_then[offset + size :]
    left_out = {name for name in image.__slots__ if not name.startswith("CamCoupling")} - {
        "modulo_factor",
        *(one[0] for one in members),
    }
    assert not left_out


@pytest.mark.exhaustive
def test_an_axis_by_its_symbols():
    """What is written to the symbols of a block commands the axis; no number that is none gets in."""
    with load_bench_file("nc-axes:reference").build(seed=0) as bench:
        axis = bench.axis(controller="nc")
        ports = ads_ports(bench.nc, {"axis1": axis})
        plc = ports[851].memory

        def write(name, form, value):
            return plc.write(plc.find(name).offset, struct.pack(form, value))

        for one in ("Enable", "Enable_Positive", "Enable_Negative"):
            assert write(f"MAIN.axis1_Power.{one}", "<?", True) == 0
        bench.wait_until(lambda: axis.operational, 1.0)
        assert write("MAIN.axis1_MoveRelative.Distance", "<d", 10.0) == 0
        assert write("MAIN.axis1_MoveRelative.Velocity", "<d", 100.0) == 0
        assert write("MAIN.axis1_MoveRelative.Velocity", "<d", float("nan")) == 0x706
        assert write("GVL.axis1.PlcToNc.ExtSetPos", "<d", float("inf")) == 0x706
        assert write("MAIN.axis1_MoveRelative.Execute", "<?", True) == 0
        done = plc.find("MAIN.axis1_MoveRelative.Done")
        bench.wait_until(lambda: plc.read(done.offset, 1) == b"\1", 2.0)
        actual = plc.find("GVL.axis1.NcToPlc.ActPos")
        assert struct.unpack("<d", plc.read(actual.offset, 8))[0] == pytest.approx(10.0, abs=0.1)
        assert bench.history.events
        bench.recorder.forget()  # what `hil emulate --ads` does every second
        assert not bench.history.events
        assert not bench.trace().raw_frames("can0")
        assert ports[851].control(AdsState.STOP) == 0
        bench.run_for(0.1)
        assert not axis.operational
        online = ports[501].memory
        mode = online.find("Axes.axis1.enc.reference_mode")
        assert online.write(mode.offset, struct.pack("<i", 99)) == 0x706
        assert online.write(mode.offset, struct.pack("<i", 1)) == 0
        assert axis.read_parameter("enc.reference_mode").startswith("Hardware Sync")
