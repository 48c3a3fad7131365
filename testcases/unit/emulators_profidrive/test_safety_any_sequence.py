"""Any words, selections and acknowledgements in any order: the axis lives on, and the safety functions keep
their promises.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.machine import BrakeConfig
from emulators.drive.profidrive import AxisState, ProfidriveConfig
from emulators.drive.safety_config import SafeMotionConfig
from emulators.drive.second_encoder_config import RotarySecondEncoder
from testcases.unit.emulators_profidrive.profidrive_rig import READY, RUN, Rig

pytestmark = pytest.mark.exhaustive

FLAG = st.booleans()
DOORS = st.one_of(
    st.tuples(st.sampled_from(["set_sto", "set_ss1", "set_ss2", "set_sos", "set_sbc"]), FLAG),
    st.tuples(st.just("set_sls"), st.sampled_from([None, 1, 2])),
    st.tuples(st.just("set_sdi"), st.sampled_from([None, 1, -1])),
    st.tuples(st.just("set_slp"), st.sampled_from([None, 1])),
    st.tuples(st.just("acknowledge")),
)
WORD = st.integers(0, 0xFFFF)
STEPS = st.lists(
    st.tuples(
        st.one_of(st.sampled_from([RUN, READY, RUN | 0x1000]), WORD),
        st.integers(-0x7FFF_FFFF, 0x7FFF_FFFF),
        WORD,
        WORD,
        st.sampled_from([0, 1, 3, 9, 11]),
        st.none() | DOORS,
        st.integers(1, 40),
    ),
    max_size=15,
)


@settings(max_examples=40)
@given(STEPS, FLAG, FLAG)
def test_any_sequence(steps, external, with_fault):
    """STO and SBC never leave torque or an open brake; what SS1 selects ends without torque; words stay
    within 16 bits.
    """
    config = replace(
        ProfidriveConfig.reference(telegram=4),
        safety_telegram=701,
        brake=BrakeConfig(torque_nm=5.0),
        encoder2=RotarySecondEncoder(type="incremental_rotary"),
        safety=SafeMotionConfig(
            sto="fault" if with_fault else "inhibit",
            ss1_time_ms=100.0,
            ss1_external=external,
            ss2_external=external,
            ss2_time_ms=100.0,
            sls_limits_mm_s=(50.0, 200.0),
            slp_ranges_mm=((-100.0, 100.0),),
            sbt_torque_nm=3.0,
            sbt_time_ms=50.0,
        ),
    )
    rig = Rig(config)
    safety, core = rig.drive.safety, rig.drive.core
    rig.enable()
    for stw1, nsoll, g1, g2, test, door, count in steps:
        if door is not None:
            getattr(safety, door[0])(*door[1:])
        rig.cycle(stw1, count=count, NSOLL_B=nsoll, G1_STW=g1, G2_STW=g2, S_STW3B=test)
        if safety.sto_input or safety.sbc_input:
            assert safety.torque_off
            assert core.torque == 0.0
            assert core.brake.closed
        if safety.torque_off:
            assert not core.enabled
            assert rig.drive.state not in {AxisState.S4, AxisState.S5A, AxisState.S5B}
        for word in (safety.s_zsw1b(), safety.s_zsw2b(), safety.s_zsw3b()):
            assert 0 <= word <= 0xFFFF
    for release in ("set_sto", "set_ss1", "set_ss2", "set_sos", "set_sbc"):
        getattr(safety, release)(False)
    for release in ("set_sls", "set_sdi", "set_slp"):
        getattr(safety, release)(None)
    safety.acknowledge()
    rig.drive.faults.acknowledge()
    assert safety.s_zsw1b() == 0
    assert not safety.torque_off
    assert not safety.holding
