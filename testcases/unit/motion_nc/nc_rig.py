"""An NC with one axis on a plant that follows its velocity exactly, or on the simulation of the product."""

from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from motion.nc.axis import NcAxis
from motion.nc.device import VELOCITY, SimulatedDevice
from motion.nc.handles import NcAxisHandle
from motion.nc.parameters import ParameterSet
from motion.nc.tasks import NcRuntime

T = 0.002


class Plant:
    """A drive whose encoder moves by velocity times cycle; a test may hold it, push it, or break it."""

    simulated = False
    signed = True

    def __init__(self, scaling):
        self.scaling = scaling
        self.position = 0.0
        self.velocity = 0.0
        self.frozen = False
        self.raw = 0
        self.valid = self.encoder_valid = True
        self.operating = False
        self.ready = True
        self.fault = False
        self.keeps_following = False
        self.encoder_fault = self.life_lost = False
        self.torque = 0.0
        self.lag = 0
        self.input_age = self.output_lead = 0.0
        self.mute = False
        self.interface = VELOCITY
        self.words = {}
        self.digital_inputs = self.direct_inputs = 0
        self.fast_stop = False
        self.restarts = 0
        self.enabled = False
        self.written = []
        self.searches = {}

    def search(self, mode):
        return self.searches.get(mode)

    def read(self):
        if not self.frozen:
            self.position += self.velocity * T
        self.raw = round(self.position / self.scaling)

    def write(self, outputs):
        if outputs.reset:
            self.fault = False
        self.enabled = outputs.enable
        self.operating = outputs.enable and (not self.fault or self.keeps_following)
        self.velocity = outputs.velocity if outputs.enable else 0.0
        self.written.append(outputs.velocity)


class Rig:
    """One axis and its program."""

    def __init__(
        self, *, with_=None, simulated=False, plc_cycles=1, noise=None, device=None, axis=(), **parameters
    ):
        values = {key.replace("__", "."): value for key, value in parameters.items()}
        tasks = {key: values.pop(key) for key in list(values) if key.startswith("task.")}
        if with_ is None:
            self.scheduler = VirtualScheduler()
            self.history = History(self.scheduler)
            self.runtime = NcRuntime(
                self.scheduler,
                cycle_ns=2_000_000,
                plc_cycles=plc_cycles,
                parameters=ParameterSet(tasks),
                history=self.history,
            )
        else:
            self.scheduler, self.history, self.runtime = with_.scheduler, with_.history, with_.runtime
        name = f"x{len(self.runtime.axes) or ''}"
        values = {"enc.encoder_mask": 0xFFFFFFFF, **values}
        kind = values.get("ctrl.type", "Position controller P")
        if ParameterSet({"ctrl.type": kind}).present("ctrl.pos_kv"):
            values = {"ctrl.pos_kv": 20.0, **values}
        self.parameters = ParameterSet(values, tasks=self.runtime.parameters)
        scaling = self.parameters.cell("enc.scaling_numerator").value
        if simulated:
            self.device = SimulatedDevice(
                scaling=lambda: scaling,
                noise_level=self.parameters.cell("enc.simulation_noise"),
                noise=noise or (lambda: 0.0),
            )
        else:
            self.device = Plant(scaling) if device is None else device(scaling)
        self.axis = NcAxis(
            name,
            number=len(self.runtime.axes) + 1,
            parameters=self.parameters,
            device=self.device,
            saf_cycle_s=T,
            tables=self.runtime.tables,
            history=self.history,
            **dict(axis),
        )
        self.ref = self.runtime.add(self.axis)
        self.handle = NcAxisHandle(self.runtime, self.ref)
        self.runtime.start()

    def cycles(self, count=1):
        self.scheduler.run_for(count * 2_000_000)

    def until(self, condition, seconds=20.0):
        assert self.scheduler.run_until(condition, int(seconds * 1e9)), self.handle

    def enabled(self):
        self.until(self.handle.power().status)
        self.cycles(3)
        return self

    @property
    def generator(self):
        return self.axis.motion.generator

    def status(self, name):
        self.ref.ReadStatus()
        return getattr(self.ref.Status, name)
