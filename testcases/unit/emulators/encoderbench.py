"""An emulated CiA 406 encoder on a segment in virtual time, with the `canopen` library as its client."""

from __future__ import annotations

from functools import cache
from typing import Any

import canopen
import numpy as np

from emulators.encoder import Mounting
from emulators.encoder.cia406 import EDS, CiA406Encoder, EncoderDeviceConfig, family_of
from emulators.mechanics import DrivenShaft
from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenMaster, NmtCommand, PumpedNetwork
from testcases.rigs import VirtualRig

NODE = 7


@cache
def library_dictionary(path: str) -> canopen.ObjectDictionary:
    """Return what the library reads in an EDS file, once."""
    return canopen.import_od(path, NODE)


class EncoderBench(VirtualRig):
    """One encoder on a shaft of its own, powered on; `sdo` and `rotate` are what most tests need.

    `count` places the shaft so that the sensor counts exactly that many raw steps from zero.
    """

    def __init__(
        self, *, mounting: dict[str, float] | None = None, start: float = 0.0, **config: Any
    ) -> None:
        super().__init__()
        self.config = EncoderDeviceConfig(node_id=NODE, **config)
        self.medium = CanMedium(self.scheduler, history=self.history)
        self.shaft = DrivenShaft(self.scheduler, position=start)
        self.encoder = CiA406Encoder(
            self.scheduler,
            self.medium,
            self.config,
            Mounting(lambda: self.shaft.position, **(mounting or {})),
            name="encoder",
            history=self.history,
            rng=np.random.default_rng(1),
            shaft=self.shaft,
        )
        self.master = CanopenMaster(self.scheduler, self.medium, history=self.history)
        self.emcys: list[tuple[int, int]] = []
        self.master.on_emcy(NODE, lambda code, register, _data: self.emcys.append((code, register)))
        self.network = PumpedNetwork(self.medium)
        self.node: canopen.RemoteNode = self.network.add_node(
            NODE, library_dictionary(str(EDS[family_of(self.config.kind)].path))
        )
        self.encoder.power_on()
        self.run(0.002)

    @property
    def step(self) -> float:
        """Raw step, rad or m."""
        return self.encoder.channels[0].sensor.coordinate_per_step

    def count(self, steps: int) -> None:
        self.shaft.place(steps * self.step)
        self.run(0.001)

    def get(self, index: int, sub: int | None = None) -> Any:
        sdo = self.node.sdo
        return sdo[index].raw if sub is None else sdo[index][sub].raw

    def put(self, index: int, value: int, sub: int | None = None) -> None:
        sdo = self.node.sdo
        (sdo[index] if sub is None else sdo[index][sub]).raw = value

    @property
    def position(self) -> int:
        return int(self.get(0x6004))

    def start(self) -> None:
        self.master.nmt(NmtCommand.START, NODE)
        self.run(0.001)

    def frames(self, can_id: int, since_ns: int = 0) -> list[tuple[int, bytes]]:
        return [
            (time_ns, frame.data)
            for time_ns, _, frame, error in self.medium.log
            if frame.can_id == can_id and time_ns >= since_ns and not error
        ]

    def restart_cams(self) -> None:
        """Forget which cams were active while they were being set up."""
        enable = self.get(0x6301, 1)
        self.put(0x6301, 0, 1)
        self.run(0.002)
        self.put(0x6301, enable, 1)

    def restart(self) -> None:
        """Take the supply away and give it back."""
        self.encoder.power_off()
        self.run(0.01)
        self.encoder.power_on()
        self.run(0.002)
