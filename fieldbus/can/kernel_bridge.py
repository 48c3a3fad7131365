"""Two SocketCAN interfaces made one by the kernel, with the faults that its gateway can do."""

from __future__ import annotations

import os
from dataclasses import replace

from fieldbus.can.gateway import Gateway, GatewayRule, Modification
from fieldbus.errors import BusError, UnsupportedFaultError


class KernelBridge:
    """Two interfaces made one by the kernel, with the frame faults that its rules can express.

    Args:
        near: Interface with the controller.
        far: Interface with the drives.
        fd: Whether frames of CAN FD pass too.

    Raises:
        BusError: The kernel refuses the rules.

    """

    def __init__(self, near: str, far: str, *, fd: bool = False) -> None:
        self.sides = (near, far)
        self._fd = fd
        self._identity = (
            os.getpid() & 0xFF_FFFF
        ) << 8  # the kernel wants a number to stand for one rule only
        self._gateway = Gateway()
        self._present: dict[str, tuple[GatewayRule, ...]] = {}
        try:
            for source, destination in ((near, far), (far, near)):
                self._put(source, self._everything(source, destination))
        except BusError:
            self._gateway.close()
            raise

    def _other(self, side: str) -> str:
        near, far = self.sides
        return far if side == near else near

    def _everything(self, source: str, destination: str) -> tuple[GatewayRule, ...]:
        """Return the rules that pass whatever comes."""
        rule = GatewayRule(source, destination)
        return (rule, replace(rule, fd=True)) if self._fd else (rule,)

    def _put(self, source: str, rules: tuple[GatewayRule, ...]) -> None:
        self._gateway.exchange(self._present.get(source, ()), rules)
        self._present[source] = rules

    def check_free(self, sender: str = "") -> list[str]:
        """Return the sides whose frames a fault at `sender` (empty: both) would hit.

        Raises:
            UnsupportedFaultError: There is no such side, or it has a fault already: a rule can leave out
                one pattern of identifiers only.

        """
        sources = [side for side in self.sides if sender in ("", side)]
        if not sources:
            raise UnsupportedFaultError(
                f"the gateway of the kernel knows no sender {sender!r}, only its sides: "
                f"{', '.join(self.sides)}"
            )
        for source in sources:
            if self._present[source] != self._everything(source, self._other(source)):
                raise UnsupportedFaultError(
                    f"the gateway of the kernel takes one fault at a time for what comes from {source}"
                )
        return sources

    def treat(
        self, can_id: int, mask: int, *, sender: str = "", data: bytes | None = None
    ) -> KernelTreatment:
        """Drop the frames whose identifier agrees, or exchange their data, until the result is withdrawn.

        Frames of CAN FD are dropped, too; their data are not exchanged.

        Args:
            can_id: Identifier.
            mask: Bits of it that are compared; 0: every frame.
            sender: Only frames from this side; empty: from both.
            data: New payload, with its length; None: drop.

        Raises:
            UnsupportedFaultError: See `check_free`.
            BusError: The kernel refuses.

        """
        sources = self.check_free(sender)
        for source in sources:
            destination = self._other(source)
            rules: list[GatewayRule] = []
            others = GatewayRule(source, destination, can_id, mask, inverted=True)
            if mask:
                rules.append(others)
            if self._fd and data is not None:
                rules.append(GatewayRule(source, destination, fd=True))
            elif self._fd and mask:
                rules.append(replace(others, fd=True))
            if data is not None:
                change = Modification("SET", length=len(data), data=data)
                self._identity = self._identity & ~0xFF | self._identity + 1 & 0xFF
                rules.append(
                    GatewayRule(
                        source, destination, can_id, mask, modifications=(change,), identity=self._identity
                    )
                )
            self._put(source, tuple(rules))
        return KernelTreatment(self, tuple(sources))

    def restore(self, sources: tuple[str, ...]) -> int:
        """Pass everything on again; returns how many frames were changed, as
        far as the kernel counts them.
        """
        changing = {rule.identity for source in sources for rule in self._present[source] if rule.identity}
        hits = sum(one.handled for one in self._gateway.counts() if one.identity in changing)
        for source in sources:
            self._put(source, self._everything(source, self._other(source)))
        return hits

    def close(self) -> None:
        """Remove all rules; harmless to repeat."""
        self._gateway.close()


class KernelTreatment:
    """A fault that the kernel carries out."""

    def __init__(self, bridge: KernelBridge, sources: tuple[str, ...]) -> None:
        self._bridge = bridge
        self._sources: tuple[str, ...] | None = sources
        self.hits: int | None = None
        """Frames changed, known after `withdraw`; dropped ones are not counted by the kernel."""

    def withdraw(self) -> None:
        """End it; harmless to repeat."""
        if self._sources is not None:
            self.hits = self._bridge.restore(self._sources)
            self._sources = None
