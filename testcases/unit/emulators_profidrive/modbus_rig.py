"""A PROFIdrive axis on a virtual Modbus link, and a client that talks to it in register numbers."""

from __future__ import annotations

from emulators.drive.profidrive import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.history import History
from fieldbus.modbus import (
    Outcome,
    Request,
    RtuClient,
    SerialFormat,
    SerialLine,
    TcpClient,
    TcpLink,
    load_map,
)

UNIT = 7
READY, RUN, ACKNOWLEDGE = 0x047E, 0x047F, 0x04FE
FAST = DriveSettings(operating_mode=1, ramp_up_s=0.2, ramp_down_s=0.2, quick_stop_s=0.1)


class ModbusRig:
    """A drive on a link: `tcp`, `rtu`. What is read and written are numbers of the register map."""

    def __init__(
        self, link="tcp", *, registers="sinamics_g120", format_=None, power=True, drive=None, **options
    ):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        own = ProfidriveConfig(telegram=1, settings=FAST) if drive is None else drive
        self.config = ProfidriveModbusConfig(unit=UNIT, map=registers, drive=own, **options)
        self.drive = ProfidriveModbusDrive(self.scheduler, self.config, name="drive", history=self.history)
        self.first = load_map(registers).first
        if link == "tcp":
            self.link = TcpLink(self.scheduler)
            self.drive.listen(self.link)
            self.client = TcpClient(
                self.scheduler, lambda handler: self.link.connect("client", handler), retries=0
            )
        else:
            self.link = SerialLine(self.scheduler, format_=format_ or SerialFormat())
            self.drive.attach(self.link)
            self.client = RtuClient(self.scheduler, self.link, retries=0)
        if power:
            self.drive.power_on()

    def ask(self, request, unit=UNIT):
        """Return the response, or why there is none."""
        job = self.client.submit(request, unit)
        self.scheduler.run_until(lambda: job.result is not None, 10 * S)
        result = job.result
        if result.outcome is Outcome.EXCEPTION:
            return f"exception {result.response.exception}"
        return result.response if result.outcome is Outcome.DONE else result.outcome

    def read(self, register, quantity=1):
        answer = self.ask(Request(3, register - self.first, quantity))
        return list(answer.values) if hasattr(answer, "values") else answer

    def write(self, register, *words):
        answer = self.ask(
            Request(16, register - self.first, len(words), tuple(word & 0xFFFF for word in words))
        )
        return "done" if hasattr(answer, "values") else answer

    def write_one(self, register, word):
        answer = self.ask(Request(6, register - self.first, 1, (word & 0xFFFF,)))
        return "done" if hasattr(answer, "values") else answer

    def keep(self, seconds, *words, every_ms=20):
        """Write the telegram again and again; returns the actual values at the end."""
        end = self.scheduler.now + round(seconds * S)
        while self.scheduler.now < end:
            assert self.write(40100, *words) == "done"
            self.scheduler.run_for(every_ms * MS)
        return self.read(40110, 2)

    def enable(self):
        self.keep(0.1, READY, 0)
        zsw1, _ = self.keep(0.2, RUN, 0)
        assert zsw1 & 0x47 == 0x07

    @property
    def fault(self):
        return self.drive.drive.faults.number
