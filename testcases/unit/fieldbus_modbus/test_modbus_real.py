"""The server on real sockets and on a pseudo-terminal, with pymodbus as the client; our client over real
sockets.
"""

import socket
import struct
from threading import Event

import pytest
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import BusError
from fieldbus.modbus import (
    Area,
    ModbusServer,
    Outcome,
    Request,
    SocketNetwork,
    TcpClient,
    TcpStation,
    tcp_frame,
)
from testcases.unit.fieldbus_modbus.conftest import new_map
from testcases.unit.fieldbus_modbus.real_server import real_device

READ = tcp_frame(1, 5, Request(3, 10, 2).encode())
ANSWER = tcp_frame(1, 5, bytes.fromhex("03 04 100a 100b"))


@pytest.fixture(scope="module")
def shared():
    with real_device() as device:
        yield device


@pytest.fixture
def device(shared):
    for offset in range(40):
        shared.server.registers.set(Area.HOLDING_REGISTERS, 10 + offset, 0x1000 + 10 + offset)
    return shared


@pytest.fixture(params=["tcp", "rtu"])
def client(request, device):
    """Pymodbus over either link."""
    if request.param == "tcp":
        made = ModbusTcpClient(device.host, port=device.port, timeout=5, retries=0)
    else:
        # no parity: a pseudo-terminal has none, and pyserial insists on what it asks for
        made = ModbusSerialClient(device.path, baudrate=19200, parity="N", timeout=5, retries=0)
    assert made.connect()
    yield made
    made.close()


@pytest.mark.requirement(
    "MODB-012", "MODB-013", "MODB-014", "MODB-015", "MODB-017", "MODB-018", "MODB-019", "MODB-020"
)
def test_pymodbus_reads_and_writes(client, device):
    """Every function of data, with the values that another implementation makes of the bytes."""
    registers = device.server.registers
    assert client.read_coils(10, count=20, device_id=5).bits[:20] == [n % 3 == 0 for n in range(10, 30)]
    assert client.read_discrete_inputs(11, count=3, device_id=5).bits[:3] == [False, True, False]
    assert client.read_holding_registers(10, count=125, device_id=5).registers[:2] == [0x100A, 0x100B]
    assert client.read_input_registers(20, count=1, device_id=5).registers == [0x1014]
    assert not client.write_coil(100, True, device_id=5).isError()
    assert not client.write_coils(101, [True, False, True], device_id=5).isError()
    assert [registers.get(Area.COILS, n) for n in range(100, 104)] == [1, 1, 0, 1]
    assert client.write_register(30, 0xBEEF, device_id=5).registers == [0xBEEF]
    assert client.write_registers(31, list(range(10)), device_id=5).count == 10
    assert not client.mask_write_register(address=30, and_mask=0xFF00, or_mask=0x12, device_id=5).isError()
    answer = client.readwrite_registers(
        read_address=30, read_count=3, write_address=31, values=[7], device_id=5
    )
    assert answer.registers == [0xBE12, 7, 1]


@pytest.mark.requirement("MODB-021", "MODB-022", "MODB-023", "MODB-032")
def test_pymodbus_sees_exceptions_and_identification(client):
    """Exception codes and the objects of the identification as pymodbus reads them."""
    assert client.read_holding_registers(0, count=1, device_id=5).exception_code == 2
    assert client.read_exception_status(device_id=5).exception_code == 1
    information = client.read_device_information(read_code=2, device_id=5).information
    assert information == {0: b"ACME", 1: b"D-1", 2: b"1.0", 4: b"drive"}


@pytest.mark.requirement("MODB-016")
def test_pymodbus_diagnoses_on_the_serial_line_only(client):
    """Sub-function 0 is echoed on the serial line, and unknown over TCP."""
    answer = client.diag_query_data(b"\x12\x34", device_id=5)
    if isinstance(client, ModbusTcpClient):
        assert answer.exception_code == 1
    else:
        assert answer.message == b"\x12\x34"


def connect(device):
    connection = socket.create_connection((device.host, device.port), timeout=10)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def receive(connection, size):
    data = b""
    while len(data) < size:
        piece = connection.recv(size - len(data))
        assert piece, "closed"
        data += piece
    return data


@pytest.mark.requirement("MODB-037", "MODB-038")
def test_pieces_and_wrong_headers_on_a_socket(device):
    """Requests in any pieces are answered; a wrong header closes this connection and no other."""
    with connect(device) as one, connect(device) as two:
        for byte in READ + READ:
            one.sendall(bytes((byte,)))
        assert receive(one, 2 * len(ANSWER)) == ANSWER * 2
        one.sendall(READ + bytes.fromhex("0001 0007 0006 05 03"))
        assert receive(one, len(ANSWER)) == ANSWER
        assert one.recv(1) == b""
        two.sendall(READ)
        assert receive(two, len(ANSWER)) == ANSWER


@pytest.mark.exhaustive
def test_a_reset_and_a_peer_that_never_reads(device):
    """A connection that is reset, and one that sends requests but takes no responses, end; the server goes
    on.
    """
    with connect(device) as gone:
        gone.sendall(READ)
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    deaf = connect(device)
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    long_request = tcp_frame(1, 5, Request(3, 10, 125).encode())
    with deaf, pytest.raises(OSError):  # noqa: PT011 - reset or broken pipe
        deaf.sendall(long_request * 1_000_000)
    with connect(device) as good:
        good.sendall(READ)
        assert receive(good, len(ANSWER)) == ANSWER


def test_a_request_before_the_end_is_carried_out(device):
    """A client that writes and closes at once has written."""
    with connect(device) as hasty:
        hasty.sendall(tcp_frame(1, 5, Request(6, 45, 1, (4711,)).encode()))
    seen = Event()

    def look():
        if device.server.registers.get(Area.HOLDING_REGISTERS, 45) == 4711:
            seen.set()
        else:
            device.scheduler.after(MS, look)

    device.scheduler.post(look)
    assert seen.wait(20)


def test_the_server_is_for_this_machine_only(device):
    """Without an address it listens on loopback; an address that is taken is reported."""
    assert device.host == "127.0.0.1"
    with pytest.raises(BusError, match=str(device.port)):
        device.network.serve(port=device.port)


@pytest.mark.requirement("MODB-039")
def test_our_client_over_real_sockets():
    """The client that runs on the virtual link runs on sockets: requests, several under way, a refused
    connection.
    """
    scheduler = RealtimeScheduler()
    network = SocketNetwork(scheduler)
    try:
        with real_device() as device:
            host, port = device.host, device.port
            client = TcpClient(scheduler, lambda handler: network.connect(host, port, handler), outstanding=8)
            jobs = [client.submit(Request(3, 10 + n, 1), 5) for n in range(50)]
            assert scheduler.run_until(lambda: all(job.result for job in jobs), 20 * S)
            assert [job.result.response.values for job in jobs] == [(0x100A + n,) for n in range(50)]
        assert scheduler.run_until(lambda: not client.connected, 20 * S)
        job = client.submit(Request(3, 10, 1), 5)
        assert scheduler.run_until(lambda: job.result, 20 * S)
        assert job.result.outcome is Outcome.LOST
    finally:
        network.close()
        network.close()


def test_client_and_server_on_one_scheduler():
    """Both ends in one process and on one scheduler, nothing in a thread but the sockets."""
    scheduler = RealtimeScheduler()
    network = SocketNetwork(scheduler)
    try:
        TcpStation(scheduler, network, ModbusServer(new_map()), processing_ns=MS)
        host, port = network.serve()
        client = TcpClient(scheduler, lambda handler: network.connect(host, port, handler))
        job = client.submit(Request(16, 10, 2, (1, 2)))
        assert scheduler.run_until(lambda: job.result, 20 * S)
        assert job.result.outcome is Outcome.DONE
    finally:
        network.close()
