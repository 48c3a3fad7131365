"""A CiA 402 master made of the unmodified `canopen` library, for virtual and for real time.

`LibraryMaster` uses nothing but the library's public classes: `Network`, `BaseNode402` with its SDO client,
PDO maps,
NMT master and EMCY consumer. What it does differently from the library's own examples, and why, is described
in `docs/reference/interoperation.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from canopen.profiles.p402 import BaseNode402, State402

REVOLUTION: Final = 131072
"""Increments per motor revolution: the position unit."""
RPM: Final = 1000
"""Velocity units per rpm: 60A9h is set to 10^-3 rpm; accelerations are in 10^-3 rpm/s."""
MILLI_RPM: Final = 0xFDB44700

CONTROL: Final = (0x6040, 0x6060)
"""RPDO1: control word and mode, so that no PDO carries a control word that nobody has written."""
SETPOINTS: Final = (0x607A, 0x60FF)
"""RPDO2: setpoints, latched by SYNC."""
STATUS: Final = (0x6041, 0x6061, 0x6064)
"""TPDO1, with every SYNC."""
VALUES: Final = (0x606C, 0x6077)
"""TPDO2, with every SYNC."""

VELOCITY_WINDOW: Final = 5 * RPM
"""606Dh."""

NEW_SETPOINT: Final = 0x10
IMMEDIATELY: Final = 0x20
RELATIVE: Final = 0x40
REACHED: Final = 1 << 10
ACKNOWLEDGED: Final = 1 << 12


class LibraryMaster:
    """Commissions and moves a drive.

    Args:
        network: The library's network, or one that pumps a scheduler.
        node_id: Node of the drive.
        dictionary: EDS file or parsed dictionary.
        sleep: Lets seconds pass: `time.sleep`, or the scheduler's time.
        patience_s: How long to wait for anything at most, s. It decides only how long a failure takes.

    """

    def __init__(
        self,
        network: Any,
        node_id: int,
        dictionary: Any,
        *,
        sleep: Callable[[float], object],
        patience_s: float = 5.0,
    ) -> None:
        self.network = network
        self.sleep = sleep
        self.patience_s = patience_s
        self.node: Any = BaseNode402(node_id, dictionary)
        self.error_control: list[int] = []
        """Boot-ups (0) and heartbeats (4, 5, 127) in the order in which they came."""
        network.add_node(self.node)
        self.node.nmt.add_heartbeat_callback(self.error_control.append)

    def be_patient(self, seconds: float) -> None:
        """Widen the library's own time-outs, for a slow machine."""
        self.node.sdo.RESPONSE_TIMEOUT = seconds
        for name in (
            "TIMEOUT_SWITCH_OP_MODE",
            "TIMEOUT_SWITCH_STATE_FINAL",
            "TIMEOUT_SWITCH_STATE_SINGLE",
            "TIMEOUT_CHECK_TPDO",
        ):
            setattr(self.node, name, seconds)

    def until(self, condition: Callable[[], object], what: str, timeout_s: float | None = None) -> None:
        """Wait for a condition; an AssertionError says what did not come."""
        step, waited = 0.005, 0.0
        while not condition():
            assert waited < (timeout_s or self.patience_s), f"waited {waited:.1f} s in vain: {what}"
            self.sleep(step)
            waited += step

    # -- commissioning
    # ----------------------------------------------------------------------------------------

    def commission(self, *, cycle_ms: int = 10, quick_stop: int = 6, heartbeat_ms: int = 100) -> None:
        """Reset the communication, write parameters and PDO mapping, start SYNC and the node."""
        node = self.node
        self.error_control.clear()
        node.nmt.state = "RESET COMMUNICATION"
        self.until(lambda: 0 in self.error_control, "boot-up")
        for index, sub, value in (
            (0x60A9, None, MILLI_RPM),
            (0x608F, 1, REVOLUTION),
            (0x608F, 2, 1),
            (0x6092, 1, REVOLUTION),
            (0x6092, 2, 1),
            (0x607F, None, 3000 * RPM),
            (0x6080, None, 3000),
            (0x6081, None, 1200 * RPM),
            (0x6083, None, 6000 * RPM),
            (0x6084, None, 3000 * RPM),
            (0x6085, None, 12000 * RPM),
            (0x606D, None, VELOCITY_WINDOW),
            (0x606E, None, 20),
            (0x605A, None, quick_stop),
            (0x60C2, 1, cycle_ms),
            (0x60C2, 2, -3),
            (0x1017, None, heartbeat_ms),
        ):
            entry = node.sdo[index] if sub is None else node.sdo[index][sub]
            entry.raw = value
        self.map_pdos()
        node.setup_402_state_machine(read_pdos=False)
        self.network.sync.start(cycle_ms / 1000.0)
        node.nmt.state = "OPERATIONAL"
        assert node.tpdo[1].wait_for_reception(self.patience_s), "no TPDO1"

    def map_pdos(self) -> None:
        """Write `CONTROL`, `SETPOINTS`, `STATUS` and `VALUES`; all other PDOs become invalid."""
        node = self.node
        # What the library has not read it would overwrite with its own idea of "remote request allowed".
        node.pdo.read()
        for maps in (node.rpdo, node.tpdo):
            for pdo in maps.values():
                pdo.enabled = False
        for pdo, objects, kind in (
            (node.rpdo[1], CONTROL, 255),
            (node.rpdo[2], SETPOINTS, 1),
            (node.tpdo[1], STATUS, 1),
            (node.tpdo[2], VALUES, 1),
        ):
            pdo.clear()
            for index in objects:
                pdo.add_variable(index)
            pdo.trans_type = kind
            pdo.cob_id = pdo.predefined_cob_id
            pdo.enabled = True
        node.pdo.save()

    def close(self) -> None:
        """Stop everything periodic."""
        self.node.rpdo.stop()
        self.network.sync.stop()

    # -- actual values, as the TPDOs brought them
    # -------------------------------------------------------------

    @property
    def position(self) -> int:
        """6064h, increments."""
        return int(self.node.tpdo_values[0x6064])

    @property
    def velocity(self) -> int:
        """606Ch, 10^-3 rpm."""
        return int(self.node.tpdo_values[0x606C])

    def status_bit(self, mask: int) -> bool:
        """Return whether a bit of the last status word is set."""
        return bool(self.node.statusword & mask)

    # -- motion
    # -----------------------------------------------------------------------------------------------

    def enable(self, mode: str) -> None:
        """Select a mode by its name in the library and go to Operation enabled."""
        self.node.op_mode = mode
        # The library only logs when the mode does not come.
        assert self.node.op_mode == mode, f"mode is {self.node.op_mode}, not {mode}"
        self.node.state = "OPERATION ENABLED"

    def give_setpoint(self, position: int, flags: int = 0) -> None:
        """Hand over a target in profile position mode, with the handshake of bits 4 and 12."""
        node = self.node
        node.sdo[0x607A].raw = position
        node.controlword = State402.CW_OPERATION_ENABLED | flags
        self.until(lambda: not self.status_bit(ACKNOWLEDGED), "setpoint acknowledge gone")
        node.controlword = State402.CW_OPERATION_ENABLED | NEW_SETPOINT | flags
        self.until(lambda: self.status_bit(ACKNOWLEDGED), "setpoint acknowledge")
        node.controlword = State402.CW_OPERATION_ENABLED | flags

    def move_to(self, position: int, *, relative: bool = False) -> None:
        """Move in profile position mode and wait until the drive reports the target as reached."""
        self.give_setpoint(position, RELATIVE if relative else 0)
        self.until(
            lambda: self.status_bit(REACHED) and not self.status_bit(ACKNOWLEDGED),
            f"target {position}",
            10 * self.patience_s,
        )

    def run_at(self, rpm: float) -> None:
        """Run in profile velocity mode and wait until the drive reports the velocity as reached."""
        target = round(rpm * RPM)
        self.node.sdo[0x60FF].raw = target
        self.until(
            lambda: abs(self.velocity - target) <= VELOCITY_WINDOW and self.status_bit(REACHED),
            f"{rpm} rpm",
            10 * self.patience_s,
        )

    def home(self, method: int, offset: int = 0) -> bool:
        """Make a homing run by a method without motion; returns what the library says about it."""
        self.node.sdo[0x607C].raw = offset
        self.node.sdo[0x6098].raw = method
        homed = bool(self.node.homing(timeout=10 * self.patience_s))
        self.node.controlword = State402.CW_OPERATION_ENABLED  # the library leaves the start bit set
        return homed

    def start_cyclic(self, index: int, value: int, *, period_s: float) -> None:
        """Let the library send RPDO2 periodically, with `value` in the entry of object `index`."""
        pdo = self.node.rpdo[2]
        pdo[index].raw = value
        pdo.start(period_s)

    def follow(self, index: int, values: list[int]) -> list[int]:
        """Change the cyclic setpoint once per SYNC; returns the 6064h that came with each SYNC."""
        pdo = self.node.rpdo[2]
        positions = []
        for value in values:
            pdo[index].raw = value
            assert self.node.tpdo[1].wait_for_reception(self.patience_s), "no TPDO1"
            positions.append(self.position)
        return positions
