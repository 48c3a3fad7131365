"""Rules of the kernel's CAN gateway as netlink bytes. What the kernel makes of them: `testcases/vcan`."""

import errno
import socket
import struct

import pytest

from fieldbus.can.gateway import Gateway, GatewayRule, Modification, XorChecksum
from fieldbus.can.kernel_bridge import KernelBridge
from fieldbus.errors import BusError


def attributes(data):
    found = []
    while data:
        size, kind = struct.unpack_from("=HH", data)
        found.append((kind, data[4:size]))
        data = data[(size + 3) & ~3 :]
    return found


def test_a_rule_as_the_kernel_reads_it():
    """Filter, operation, checksum, hop limit and interfaces have the numbers and layouts of
    linux/can/gw.h.
    """
    index = struct.pack("=I", socket.if_nametoindex("lo"))
    rule = GatewayRule(
        "lo",
        "lo",
        0x185,
        0x7FF,
        inverted=True,
        hops=3,
        identity=7,
        modifications=(Modification("SET", can_id=0x123, extended=True, length=2, data=b"\x01\x02"),),
        checksum=XorChecksum(0, -2, -1, 0xFF),
    )
    assert attributes(rule.attributes()) == [
        (4, struct.pack("=IB3x8sB", 0x8000_0123, 2, b"\x01\x02" + bytes(6), 7)),
        (5, struct.pack("=bbbB", 0, -2, -1, 0xFF)),
        (11, struct.pack("=II", 0x2000_0185, 0x7FF)),
        (13, b"\x03"),
        (14, struct.pack("=I", 7)),
        (9, index),
        (10, index),
    ]
    assert [kind for kind, _ in attributes(GatewayRule("lo", "lo").attributes())] == [9, 10]


class Kernel:
    """Answers of a kernel, in place of the socket."""

    def __init__(self, code):
        self.code = code
        self.kinds = []

    def send(self, messages):
        while messages:
            size, kind, _, sequence, _ = struct.unpack_from("=IHHII", messages)
            self.kinds.append((kind, sequence))
            messages = messages[size:]

    def recv(self, _size):
        [*answers], self.kinds = self.kinds, []
        return b"".join(struct.pack("=IHHIIi", 20, 2, 0, sequence, 0, -self.code) for _, sequence in answers)

    def fileno(self):
        return 3

    def close(self):
        pass


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (errno.EPERM, "CAP_NET_ADMIN"),
        (errno.EOPNOTSUPP, "has not loaded the module can-gw"),
        (errno.EINVAL, "Invalid argument"),
    ],
)
def test_what_the_kernel_refuses_has_a_reason(monkeypatch, code, reason):
    """The missing right and the missing module are named; a refused rule is not remembered as one that
    exists.
    """
    monkeypatch.setattr(
        Gateway, "__init__", lambda self: self.__dict__.update(_socket=Kernel(code), _sequence=0, _rules=[])
    )
    with Gateway() as gateway:
        with pytest.raises(BusError, match=reason):
            gateway.add(GatewayRule("lo", "lo"))
        assert gateway._rules == []
    with pytest.raises(BusError, match=reason):
        KernelBridge("lo", "lo")
