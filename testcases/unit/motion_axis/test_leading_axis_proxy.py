"""A leading-axis proxy: synchronous operation across two controllers (SYN section 3.4)."""

from __future__ import annotations

from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import SynchronousAxis
from motion.s7.handles import AxisHandle, ProxyHandle
from motion.s7.proxy import LeadingAxisProxy, LeadingTelegram, LeadingValueLink
from motion.s7.runtime import Runtime
from testcases.unit.motion_axis.conftest import CYCLE, REFERENCE, Rig
from testcases.unit.motion_axis.test_gear_in import FIXTURE

ACROSS = "CrossPlcSynchronousOperation."
OUTPUT = f"{ACROSS}Interface[1].EnableLeadingValueOutput"
TOLERANCE = "Parameter.ToleranceTimeExternalLeadingValueInvalid"
VALID, MODULO, CONTROL = 1 << 4, 1 << 5, 1 << 6
MS = 1_000_000


def two_controllers(*, leader=None, proxy=None, follower=None, delay_ns=MS, phase_ns=None, enable=True):
    """A controller with a leading axis, and another one with a proxy and a following axis."""
    rig = Rig(variables=FIXTURE | {OUTPUT: True} | (leader or {}))
    rig.other = Runtime(rig.scheduler, cycle_ns=rig.cycle_ns, phase_ns=phase_ns, history=rig.history)
    rig.link = LeadingValueLink(rig.scheduler, rig.axis.object, delay_ns=delay_ns)
    rig.runtime.send_leading_value(rig.link)
    one = LeadingAxisProxy(
        "proxy",
        rig.link,
        cycle_ns=rig.cycle_ns,
        variables={TOLERANCE: 0.02} | (proxy or {}),
        history=rig.history,
    )
    rig.other.add_proxy(one)
    axis = SynchronousAxis(
        "follower",
        SimulatedDrivePort(cycle_s=CYCLE),
        cycle_ns=rig.cycle_ns,
        variables=REFERENCE | FIXTURE | (follower or {}),
        history=rig.history,
    )
    rig.other.add(axis)
    axis.leading_objects = (one,)
    rig.other.order_axes()
    rig.proxy, rig.follower = ProxyHandle(rig.other, one), AxisHandle(rig.other, axis)
    rig.other.start()
    rig.enabled()
    if enable:
        rig.until(rig.follower.power().status)
    rig.run(0.1)
    return rig


def following(velocity=100.0, **options):
    rig = two_controllers(**options)
    rig.until(rig.axis.move_velocity(velocity).in_velocity)
    rig.job = rig.follower.gear_in(rig.proxy)
    rig.until(rig.job.in_gear)
    rig.run(0.1)
    return rig


def alarms(rig, name):
    return [event.data["number"] for event in rig.events("alarm.raised") if event.source == name]


@pytest.mark.requirement("SYN-071", "SYN-072", "SYN-395", "SYN-396", "SYN-399", "SYN-400", "SYN-009")
def test_the_value_is_two_cycles_late_and_made_up_for():
    """With a local delay of two cycles the proxy shows the value of two cycles ago as it is; without one it
    is extrapolated by two cycles, to where the leading axis is now. Nothing comes without the output.
    """
    rig = two_controllers(leader={f"{ACROSS}LocalLeadingValueDelayTime": 2 * CYCLE})
    rig.until(rig.axis.move_velocity(100.0).in_velocity)
    rig.run(0.1)
    read = rig.proxy.var
    assert read("StatusExternalLeadingValue.AdjustmentTime") == pytest.approx(0.0)
    for _ in range(5):
        rig.cycles()
        delayed = rig.axis.var("StatusProvidedLeadingValue.DelayedLeadingValue.Position")
        assert read("Position") == pytest.approx(delayed, abs=1e-9)
        assert read("Velocity") == pytest.approx(100.0)
    assert int(read("StatusWord")) == 1 | VALID | CONTROL
    assert (read("StatusExternalLeadingValue.ModuloLength"), read("Interface.AddressIn")) == (0.0, 0)
    rig = two_controllers()
    rig.until(rig.axis.move_velocity(100.0).in_velocity)
    rig.run(0.1)
    assert rig.proxy.var("StatusExternalLeadingValue.AdjustmentTime") == pytest.approx(2 * CYCLE)
    assert rig.proxy.var("Position") == pytest.approx(rig.axis.var("Position"), abs=1e-9)
    rig = two_controllers(leader={OUTPUT: False})
    job = rig.follower.gear_in(rig.proxy)
    rig.run(0.2)
    assert (job.ErrorID, alarms(rig, "follower"), rig.proxy.var("StatusWord.X4")) == (0x8001, [601], False)


@pytest.mark.requirement("SYN-392", "SYN-397")
@pytest.mark.parametrize(
    ("leader", "proxy", "cycles"), [(0.0, 0.0, 2.0), (3.0, 0.0, -1.0), (5.5, 0.0, -3.5), (3.0, 4.0, 3.0)]
)
def test_the_adjustment_time(leader, proxy, cycles):
    """More delay at the leading axis: less extrapolation, then interpolation; at the proxy: the opposite.
    Interpolated values have no error when the leading axis accelerates.
    """
    rig = two_controllers(
        leader={f"{ACROSS}LocalLeadingValueDelayTime": leader * CYCLE},
        proxy={"Parameter.LocalLeadingValueDelayTime": proxy * CYCLE},
    )
    course = []
    rig.runtime.after_cycle.append(lambda: course.append(rig.axis.var("Position")))
    rig.axis.move_velocity(200.0, Acceleration=400.0, Jerk=0.0)
    rig.run(0.2)
    assert rig.proxy.var("StatusExternalLeadingValue.AdjustmentTime") == pytest.approx(cycles * CYCLE)
    if cycles < 0:
        # the value of 2 - cycles ago, between two of the course
        age = 2.0 - cycles
        whole = int(age)
        late, early = course[-1 - whole], course[-2 - whole]
        assert rig.proxy.var("Position") == pytest.approx(late + (early - late) * (age - whole), abs=1e-9)


@pytest.mark.requirement("SYN-135", "SYN-379", "SYN-016", "SYN-394")
@pytest.mark.parametrize("phase_ns", [None, 500_000, 3_500_000])
def test_a_gear_behind_a_proxy(phase_ns):
    """Whenever the other controller has its cycle: the gear is exact against the value of the proxy, on ramps
    too, and goes on while the leading axis is disabled.
    """
    rig = following(phase_ns=phase_ns)
    seen = []
    rig.other.after_cycle.append(
        lambda: seen.append((rig.proxy.object.leading_by("setpoint")()[0], rig.follower.object.servo.total.s))
    )
    rig.axis.move_velocity(30.0, Deceleration=200.0)
    rig.run(1.0)
    base = seen[0][1] - seen[0][0]
    assert all(y - x == pytest.approx(base, abs=1e-9) for x, y in seen)
    assert rig.follower.var("Velocity") == pytest.approx(30.0)
    rig.until(rig.axis.power(False).off)
    rig.run(0.1)
    assert (rig.job.InGear, alarms(rig, "follower")) == (True, [])
    assert not rig.proxy.var("StatusWord.X6")


@pytest.mark.requirement("SYN-073", "SYN-398", "SYN-314", "SYN-401", "SYN-402", "SYN-479", "SYN-357")
@pytest.mark.parametrize("invalid", [False, True])
def test_an_outage(invalid):
    """Shorter than the tolerance time: the follower goes on with the last velocity and nothing happens;
    longer: alarm 900 with reaction 13 at the proxy, 601 at the follower, which stops. Acknowledged, it works
    again.
    """
    rig = following()

    def outage(on):
        if invalid:
            rig.link.disturb = (lambda telegram: setattr(telegram, "valid", False)) if on else None
        else:
            rig.link.lost = on

    outage(True)
    rig.cycles(4)
    assert rig.follower.var("Velocity") == pytest.approx(100.0)
    outage(False)
    rig.run(0.1)
    assert (rig.job.InGear, alarms(rig, "proxy")) == (True, [])
    assert rig.proxy.var("Position") == pytest.approx(rig.axis.var("Position"), abs=1e-9)
    outage(True)
    rig.run(0.5)
    assert (alarms(rig, "proxy"), alarms(rig, "follower")) == ([900], [601])
    assert (rig.proxy.var("ErrorDetail.Reaction"), rig.proxy.var("ErrorWord.X2")) == (13, True)
    assert (rig.proxy.var("StatusWord.X4"), rig.proxy.var("StatusWord.X1")) == (False, True)
    assert (rig.job.ErrorID, rig.follower.var("Velocity")) == (0x8001, 0.0)
    outage(False)
    rig.run(0.1)
    again = rig.follower.gear_in(rig.proxy)
    rig.cycles(2)
    assert again.Error  # until both are acknowledged
    rig.until(rig.proxy.reset().done)
    rig.until(rig.follower.reset().done)
    rig.cycles(3)
    rig.until(rig.follower.gear_in(rig.proxy).in_gear)


FIELDS = [
    (1, "version", 9),
    (2, "modulo_start", nan),
    (3, "modulo_length", -1.0),
    (5, "position", nan),
    (6, "velocity", 1e300),
    (7, "acceleration", nan),
]


@pytest.mark.requirement("SYN-466", "SYN-479", "SYN-314")
@pytest.mark.parametrize(("cause", "name", "value"), FIELDS)
def test_telegrams_that_make_no_sense(cause, name, value):
    """Each field has its cause of alarm 901; the leading value is invalid, the follower stops with 601."""
    rig = following()
    rig.link.disturb = lambda telegram: setattr(telegram, name, value)
    rig.run(0.2)
    (event,) = [one for one in rig.events("alarm.raised") if one.source == "proxy"][:1]
    assert (event.data["number"], event.data["info"], event.data["reaction"]) == (901, cause, 13)
    assert 601 in alarms(rig, "follower")


@pytest.mark.requirement("SYN-466")
def test_a_sign_of_life_that_jumps():
    """Cause 4 of alarm 901; a few telegrams that are missing are none."""
    rig = following()
    rig.link.lost = True
    rig.cycles(3)
    rig.link.lost = False
    rig.cycles(5)
    assert alarms(rig, "proxy") == []
    rig.link.disturb = lambda telegram: setattr(
        telegram, "sign_of_life", (telegram.sign_of_life * 7919) % 60000
    )
    rig.cycles(10)
    (event,) = [one for one in rig.events("alarm.raised") if one.source == "proxy"][:1]
    assert (event.data["number"], event.data["info"]) == (901, 4)


@pytest.mark.requirement("SYN-314", "SYN-400")
def test_modulo_data_of_the_leading_axis():
    """They are shown and passed without a step; changed in operation they are alarm 903, until a restart."""
    modulo = {"Modulo.Enable": True, "Modulo.Length": 36.0}
    rig = following(leader=modulo)
    read = rig.proxy.var
    assert (read("StatusExternalLeadingValue.ModuloLength"), bool(read("StatusWord.X5"))) == (36.0, True)
    velocities = []
    rig.other.after_cycle.append(lambda: velocities.append(rig.follower.var("Velocity")))
    places = [rig.follower.var("Position")]
    rig.other.after_cycle.append(lambda: places.append(rig.follower.var("Position")))
    rig.run(1.0)
    assert velocities == pytest.approx([100.0] * len(velocities))
    assert places[-1] - places[0] == pytest.approx(100.0 * CYCLE * (len(places) - 1))
    assert 0.0 <= read("Position") < 36.0
    rig.link.disturb = lambda telegram: setattr(telegram, "modulo_length", 72.0)
    rig.run(0.2)
    assert alarms(rig, "proxy")[0] == 903
    rig.proxy.reset()
    rig.run(0.1)
    assert not rig.proxy.var("StatusWord.X4")
    rig.proxy.reset(restart=True)
    rig.run(0.1)
    assert (rig.proxy.var("StatusWord.X4"), read("StatusExternalLeadingValue.ModuloLength")) == (True, 72.0)


@pytest.mark.requirement("SYN-314", "SYN-402")
def test_a_delay_that_is_too_large():
    """More interpolation than there are values: warning 902, without a reaction."""
    rig = two_controllers(leader={f"{ACROSS}LocalLeadingValueDelayTime": 1.0})
    rig.run(0.5)
    assert alarms(rig, "proxy") == [902]
    assert (rig.proxy.var("ErrorDetail.Reaction"), rig.proxy.var("WarningWord.X2")) == (0, True)


@pytest.mark.requirement("SYN-393", "SYN-072")
@pytest.mark.parametrize("delay", [0.0, 2 * CYCLE])
def test_a_cascade(delay):
    """A virtual follower gives the value on to a third controller: two more cycles, and the same value again
    where its delay and that of the proxy in front of it are equal.
    """
    across = f"{ACROSS}LocalLeadingValueDelayTime"
    rig = following(
        proxy={"Parameter.LocalLeadingValueDelayTime": delay}, follower={OUTPUT: True, across: delay}
    )
    link = LeadingValueLink(rig.scheduler, rig.follower.object, delay_ns=MS)
    rig.other.send_leading_value(link)
    third = Runtime(rig.scheduler, cycle_ns=rig.cycle_ns, history=rig.history)
    last = LeadingAxisProxy(
        "last", link, cycle_ns=rig.cycle_ns, variables={TOLERANCE: 0.1}, history=rig.history
    )
    third.add_proxy(last)
    third.start()
    rig.run(0.2)
    assert last.var("StatusExternalLeadingValue.AdjustmentTime") == pytest.approx(2 * CYCLE - delay)
    # the first proxy is ahead by its own delay, the last one behind by that of the follower
    ahead = rig.proxy.var("Position") - rig.axis.var("Position")
    assert ahead == pytest.approx(100.0 * delay, abs=1e-9)
    base = rig.follower.var("Position") - rig.proxy.var("Position")
    assert last.var("Position") - base == pytest.approx(rig.axis.var("Position"), abs=1e-9)


@pytest.mark.requirement("SYN-304", "SYN-393")
def test_interconnections_that_do_not_fit():
    """Alarm 114 with reaction 4, ErrorWord.X1, cleared by a restart alone: at a proxy whose leading axis
    has no output, at a follower that gives the value on with another delay than that of its proxy.
    """
    proxy = two_controllers(leader={OUTPUT: False}).proxy
    across = f"{ACROSS}LocalLeadingValueDelayTime"
    rig = two_controllers(proxy={"Parameter.LocalLeadingValueDelayTime": 0.008}, enable=False,
                          follower={OUTPUT: True, across: 0.004})  # fmt: skip
    for rig_of, one in ((None, proxy), (rig, rig.follower)):
        (alarm,) = [entry for entry in one.object.engine.pending if entry.number == 114]
        assert (alarm.reaction, one.var("ErrorWord.X1")) == (4, True)
        one.reset()
        if rig_of is not None:
            rig_of.run(0.1)
        assert one.object.engine.is_pending(114)
    assert not rig.follower.var("StatusWord.X0")
    rig.follower.object.variables.write_start(across, 0.008)
    rig.until(rig.follower.reset(restart=True).done)
    assert rig.follower.object.engine.pending == ()
    rig.until(rig.follower.power().status)


@given(
    st.floats(-1e12, 1e12), st.floats(-1e9, 1e9), st.integers(0, 65535), st.floats(0.0, 1e6), st.booleans()
)
def test_telegrams_come_back(position, velocity, sign, length, valid):
    """48 bytes hold all of a leading value."""
    telegram = LeadingTelegram(position, velocity, 0.5, sign, 8000, -180.0, length, valid=valid)
    data = telegram.encode()
    assert (len(data), LeadingTelegram.decode(data), telegram.fault()) == (48, telegram, 0)
