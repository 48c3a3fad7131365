"""Every fault of the profile's tables, injected into a turning drive: frames, objects, state, reaction,
reset.
"""

from __future__ import annotations

import pytest

from emulators.drive.cia402 import COASTING_FAULTS, RULES, fault_rule
from emulators.drive.cia402.faults.rules import Reaction, Reset
from fieldbus.cia402 import EMCY_TEXTS
from fieldbus.cia402 import DriveState as S
from testcases.catalogue import each, requirements_in

# The tables of the specification, row by row: requirement, codes, bits of 1001h besides bit 0.
TABLES = (
    ("C402-296", "2110 2120 2121-2123 2130 2131-2133", 0x02),
    ("C402-297", "2211 2212 2213 2214 2220-2222 2230 2240 2250", 0x02),
    ("C402-298", "2310 2311 2312 2320 2330 2331-2333 2340 2341-2343", 0x02),
    ("C402-299", "3110-3113 3120-3123 3130-3133 3134 3140-3142", 0x04),
    ("C402-300", "3210 3211 3212 3220 3221 3222 3230", 0x04),
    ("C402-301", "3310-3313 3320 3321 3330 3331", 0x04),
    ("C402-302", "4110 4120 4130 4140 4210 4220 4300 4310 4320 4400 4410 4420", 0x08),
    (
        "C402-303",
        "5100 5110-5113 5120 5200 5210 5220 5300 5400 5410 5420 5430 5440 5450-5453 5500 5510 5520 5530",
        0x00,
    ),
    ("C402-304", "6010 6301-630F 6310 6320", 0x00),
    ("C402-305", "7100 7110-7113 7120-7123 7200 7300-7307 7310 7320 7400 7500 7510 7520 7600", 0x20),
    ("C402-306", "8300 8311 8312 8313 8321 8331 8400 8500 8600 8611 8612 8700 8800 8A00 8900", 0x20),
    ("C402-307", "F001-F004", 0x00),
    ("C402-307", "FF00", 0x80),
    ("C301-114", "1000", 0x00),
    ("C301-115", "2000 2100 2200 2300", 0x02),
    ("C301-116", "3000 3100 3200 3300", 0x04),
    ("C301-117", "4000 4100 4200", 0x08),
    ("C301-118", "5000 6000 6100 6200 6300", 0x00),
    ("C301-119", "7000", 0x20),
    ("C301-120", "8000", 0x00),
    ("C301-120", "8100", 0x10),
    ("C301-121", "8110", 0x10),
    ("C301-122", "8120", 0x10),
    ("C301-123", "8130", 0x10),
    ("C301-124", "8140", 0x10),
    ("C301-125", "8150", 0x10),
    ("C301-126", "8200", 0x10),
    ("C301-127", "8210 8220", 0x10),
    ("C301-128", "8230", 0x10),
    ("C301-129", "8240", 0x10),
    ("C301-130", "8250", 0x10),
    ("C301-131", "9000 F000", 0x00),
)


def codes(text):
    for part in text.split():
        first, _, last = part.partition("-")
        yield from range(int(first, 16), int(last or first, 16) + 1)


CASES = [
    pytest.param(code, bits | 0x01, marks=pytest.mark.requirement(requirement, "C402-308"), id=f"{code:04X}h")
    for requirement, text, bits in TABLES
    for code in codes(text)
]

# Codes after which nobody can brake: written down again here, independent of the product's table.
NO_BRAKING = {
    *codes("2110 2120 2121-2123 2130 2131-2133 2211 2212 2230 2240 2250 2320 2330 2331-2333 2340 2341-2343"),
    *codes("3210 3211 3212 3220 3221 3222 3300 3310-3313 3320 3321 3330 3331"),
    *codes("5100 5110-5113 5120 5200 5210 5220 5400 5410 5430 5440 5450-5453 5500 5510 5520 5530 6010"),
    *codes("7122 7200 7300-7307 7310 7320"),
}
RESTART_ONLY = set(codes("5220 5500 5510 5520 5530 6010"))


def check_every_fault_code(make_bench, code, register):
    bench = make_bench()
    bench.spin()
    frames_before = len(bench.medium.log)
    bench.drive.raise_fault(code)
    coasts = code in NO_BRAKING
    assert bench.state is (S.FAULT if coasts else S.FAULT_REACTION_ACTIVE)
    bench.run(0.1)
    turning = bench.drive.core.speed_rpm
    if coasts:
        assert bench.drive.core.torque == 0.0
        assert turning > 1500.0, "without torque it hardly slows down within 0.1 s"
    else:
        # 6085h of the reference axis takes 6000 rpm per second.
        assert turning == pytest.approx(1800.0 - 600.0, abs=10.0)
        bench.run(0.5)
        assert bench.state is S.FAULT
        assert bench.drive.core.standing

    emcy = [
        entry[2].data
        for entry in list(bench.medium.log)[frames_before:]
        if entry[2].can_id == 0x81 and not entry[3]
    ]
    assert emcy == [code.to_bytes(2, "little") + bytes((register,)) + bytes(5)]
    assert bench.read(0x1001) == register
    assert bench.read(0x603F) == code
    assert (bench.read(0x1003), bench.read(0x1003, 1)) == (1, code)

    bench.control(0x80)
    if code in RESTART_ONLY:
        assert bench.state is S.FAULT
        bench.drive.power_off()
        bench.drive.power_on()
        bench.run(0.002)
    else:
        assert bench.emcys[-1] == (0, 0)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert (bench.read(0x1001), bench.read(0x603F)) == (0, 0)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-014", "C402-015", "C402-016", "C301-108", "C301-109", "C301-111", "C301-112")
@requirements_in(CASES)
def test_every_fault_code(make_bench, subtests):
    """EMCY bytes, 1001h, 603Fh, 1003h; coasting or ramp by 605Eh; reset by an edge with EMCY 0000h, or by
    restart only.
    """
    for label, values in each(CASES):
        with subtests.test(label):
            check_every_fault_code(make_bench, *values)


def test_the_tables_are_whole():
    """Rule and text exist for every code of the tables, and no further code of the texts is forgotten
    here.
    """
    listed = {code for _, text, _ in TABLES for code in codes(text)}
    assert listed <= set(RULES)
    # Group headings and codes that later editions of the profile add to these tables.
    assert {f"{code:04X}" for code in set(RULES) - listed} <= {
        "2350",
        "3320",
        "3330",
        "5111",
        "4320",
    }
    assert all(RULES[code].text == EMCY_TEXTS[code] for code in RULES)


def test_rules_beyond_the_table():
    """A code without text has a rule too; coasting and restart are those of its group."""
    rule = fault_rule(0x2335)
    assert (rule.reaction, rule.reset, rule.register) == (Reaction.COAST, Reset.EDGE, 0x03)
    assert fault_rule(0x5599).reset is Reset.RESTART
    assert fault_rule(0xFF42).reaction is Reaction.OPTION
    assert {rule.code for rule in RULES.values() if rule.reaction is Reaction.COAST} <= COASTING_FAULTS


@pytest.mark.requirement("C402-067", "C402-068", "C402-069", "C402-070", "C402-071")
@pytest.mark.parametrize("option", range(5))
def test_fault_reaction_option(make_bench, option):
    """605Eh: 0 coasts, 1 ramp 6084h, 2 ramp 6085h, 3 and 4 at the torque limit."""
    bench = make_bench()
    bench.spin()
    bench.write(0x605E, option)
    bench.drive.raise_fault(0x4310)
    bench.run(0.02)
    slopes = {1: 3000.0, 2: 6000.0}
    if option in slopes:
        assert bench.drive.core.speed_rpm == pytest.approx(1800.0 - 0.02 * slopes[option], abs=3.0)
    elif option == 0:
        assert (bench.state, bench.drive.core.torque) == (S.FAULT, 0.0)
    else:
        assert bench.drive.core.standing, "6 Nm on 3.5e-4 kg m^2 take 11 ms"


@pytest.mark.requirement("C402-014")
def test_fault_history_with_time(make_bench):
    """2104h and 2105h: code, state, mode and operating time of the last faults, newest first, also after
    power-off.
    """
    bench = make_bench()
    bench.run(0.498)
    bench.drive.raise_fault(0x4310)
    bench.run(0.5)
    bench.control(0x80)
    bench.control(0x00)
    bench.enable(3)
    struck = bench.drive.faults.log.operating_ms
    bench.drive.raise_fault(0x2310)
    bench.drive.power_off()
    bench.run(5.0)
    bench.drive.power_on()
    bench.run(0.002)
    assert bench.read(0x2104, 1) == 0x2310 | S.OPERATION_ENABLED << 16 | 3 << 24
    assert bench.read(0x2104, 2) == 0x4310 | S.SWITCH_ON_DISABLED << 16
    assert bench.read(0x2104, 3) == 0
    assert (bench.read(0x2105, 1), bench.read(0x2105, 2)) == (struck, 500)
    assert bench.read(0x2106) == struck + 2, "the operating time stands still while the drive is off"
    bench.write(0x2107, 1)
    assert (bench.read(0x2104, 1), bench.read(0x2106)) == (0, struck + 2)
