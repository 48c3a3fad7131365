"""Counters that overflow on the way, in every format that comes from a bus: the position goes on, to the
increment.
"""

from __future__ import annotations

from math import degrees

import pytest

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read

pytestmark = pytest.mark.exhaustive

PROFILE = "[encoder.enc1.shaft]\nprofile = [[0.3, 0.0], [0.05, {speed}], [1.2, {speed}], [0.05, 0.0]]\n"
TURNING = '"Properties.MotionType" = 1\n"Modulo.Enable" = true\n"Modulo.Length" = 360.0\n'
CIA406 = {
    "single_turn": "steps_per_revolution = 1000",
    "multi_turn": "steps_per_revolution = 1000\nrevolutions = 3",
    "single_turn_counting": "steps_per_revolution = 1000\nrevolutions = 3",
    "incremental_rotary": "steps_per_revolution = 1000",
    "incremental_rotary_counting": "steps_per_revolution = 1000",
}
"""Ranges that no power of two divides, and that are passed many times per second."""
PROFIDRIVE = {
    "81 single_turn": 'type = "single_turn"\nsteps_per_revolution = 4096',
    "82 multi_turn": 'type = "multi_turn"\nsteps_per_revolution = 4096\nrevolutions = 4',
    "83 incremental_rotary": 'type = "incremental_rotary"\nsteps_per_revolution = 2500',
    "84 multi_turn": 'type = "multi_turn"\nsteps_per_revolution = 4096\nrevolutions = 4',
}
SPEED = 900.0
"""rpm: fifteen revolutions per second."""


def encoder_bench(device, *, speed, profile="", variables=TURNING):
    text = (
        f'[encoder.enc1]\nsegment = "can0"\nnode_id = 20\n{device}\n{profile}'
        + PROFILE.format(speed=speed)
        + f'[external_encoder.ext1]\nencoder = "enc1"\n[external_encoder.ext1.variables]\n{variables}'
    )
    return Bench(parse(read("reference")[1] + text, "bench.toml"), seed=1)


def travelled(bench, way, *, length=360.0):
    """Return how far the object has come while the shaft made its way, and the way of the shaft, from rest to
    rest.
    """
    encoder = bench.external_encoder("ext1")
    shaft = bench.encoder("enc1").shaft

    def shown():
        return encoder.var("ActualModuloCycle") * length + encoder.var("ActualPosition")

    assert bench.run_until(lambda: encoder.var("StatusSensor.State") == 2, 0.25)
    before, start = shown(), shaft.position
    bench.run_for(1.8)
    assert shaft.velocity == 0.0
    return shown() - before, way(shaft.position - start)


@pytest.mark.requirement("LIM-098", "LIM-102")
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("kind", CIA406)
def test_cia406(kind, direction):
    """Ranges of 1000 and 3000 steps, passed many times: the way is that of the shaft, but for the increment
    at either end.
    """
    bench = encoder_bench(f'type = "{kind}"\n{CIA406[kind]}', speed=direction * SPEED)
    found, wanted = travelled(bench, degrees)
    assert abs(wanted) > 16 * 360.0
    assert found == pytest.approx(wanted, abs=2 * 360.0 / 1000)
    assert not bench.external_encoder("ext1").var("ErrorWord")


@pytest.mark.requirement("LIM-098")
@pytest.mark.parametrize("kind", ["incremental_linear", "incremental_linear_counting", "cyclic_linear"])
def test_cia406_linear(kind):
    """A slide of 2 m/s over a code that repeats every 97 mm, or counts: the way is that of the slide."""
    bench = encoder_bench(
        f'type = "{kind}"\nlength_mm = 97.0',
        speed=2000.0,
        variables='"Sensor.System" = 0\n"Modulo.Enable" = true\n"Modulo.Length" = 250.0\n',
    )
    found, wanted = travelled(bench, lambda way: way * 1000.0, length=250.0)
    assert wanted > 2000.0
    assert found == pytest.approx(wanted, abs=0.002)


@pytest.mark.requirement("LIM-098", "LIM-102")
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("kind", PROFIDRIVE)
def test_profidrive_encoders(kind, direction):
    """Telegrams 81 to 84 with a counter that is as narrow as it can be: it overflows all the time."""
    telegram = kind.split()[0]
    bits = 18 if "multi_turn" in kind else 16
    profile = (
        f"[encoder.enc1.profidrive]\ntelegram = {telegram}\nfine_xist1_bits = 4\ncounter_bits = {bits}\n"
    )
    bench = encoder_bench(
        f'profile = "profidrive"\n{PROFIDRIVE[kind]}',
        speed=direction * SPEED,
        profile=profile,
        variables=TURNING + '"Sensor.Parameter.BehaviorGx_XIST1" = 0\n',
    )
    assert bench.external_encoder("ext1").feedback.scale.bits == bits
    found, wanted = travelled(bench, degrees)
    assert found == pytest.approx(wanted, abs=2 * 360.0 / 2500)


DRIVES = {
    "CiA 402": ("reference", 0, 1),
    **{f"telegram {number}": ("profidrive", number, 2048) for number in (3, 5, 102, 103, 105)},
}


@pytest.mark.requirement("LIM-098", "LIM-102")
@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("name", DRIVES)
def test_the_counter_of_a_drive(name, direction):
    """6064h and G1_XIST1 over the end of their 32 bits while the axis moves in position control: nothing
    jumps, the target is met.
    """
    embedded, telegram, fine = DRIVES[name]
    text = read(embedded)[1]
    if telegram:
        text = text.replace("telegram = 105", f"telegram = {telegram}")
    bench = Bench(parse(text, "bench.toml"), seed=1)
    axis, drive = bench.axis(), bench.drive()
    bench.run_for(0.1)
    end = (1 << 31) - 3000 * fine // 2
    drive.jump_encoder(direction * end)
    bench.run_for(0.02)
    raw = axis.port.encoder_increments
    assert abs(raw - direction * end) <= 2 * fine
    assert bench.run_until(axis.power().status, 2.0)
    assert bench.run_until(axis.home(0.0).done, 1.0)
    start = drive.mechanics.position
    job = axis.move_absolute(20.0 * direction)
    assert bench.run_until(job.done, 5.0)
    bench.run_for(0.1)
    after = axis.port.encoder_increments
    assert (raw > 0) is not (after > 0)  # it has overflowed
    assert axis.var("ActualPosition") == pytest.approx(20.0 * direction, abs=0.01)
    assert (drive.mechanics.position - start) * 1000.0 == pytest.approx(20.0 * direction, abs=0.02)
    assert not list(bench.history.select(kind="alarm.raised"))
