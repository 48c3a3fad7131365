"""The dictionary of a small servo drive with every kind of object, as an EDS."""

from __future__ import annotations

TYPES = {
    "BOOL": 0x01,
    "I8": 0x02,
    "I16": 0x03,
    "I32": 0x04,
    "U8": 0x05,
    "U16": 0x06,
    "U32": 0x07,
    "F32": 0x08,
    "STR": 0x09,
    "OCT": 0x0A,
    "DOM": 0x0F,
    "I24": 0x10,
    "I64": 0x15,
    "U24": 0x16,
    "U64": 0x1B,
}

# index sub name type access mappable default low high
OBJECTS = """
1000 0 Device_type U32 ro 0 0x00020192 - -
1001 0 Error_register U8 ro 1 0 - -
1003 0 Count U8 rw 0 0 - -
1003 1 Error_1 U32 ro 0 - - -
1003 2 Error_2 U32 ro 0 - - -
1003 3 Error_3 U32 ro 0 - - -
1003 4 Error_4 U32 ro 0 - - -
1005 0 COB-ID_SYNC U32 rw 0 0x80 - -
1006 0 Cycle_period U32 rw 0 0 - -
1007 0 Window U32 rw 0 0 - -
1008 0 Device_name STR const 0 Emulated_servo_drive - -
1009 0 Hardware STR const 0 A1 - -
100C 0 Guard_time U16 rw 0 0 - -
100D 0 Life_time_factor U8 rw 0 0 - -
1010 0 Highest U8 const 0 3 - -
1010 1 Save_all U32 rw 0 1 - -
1010 2 Save_communication U32 rw 0 1 - -
1010 3 Save_application U32 rw 0 1 - -
1011 0 Highest U8 const 0 3 - -
1011 1 Restore_all U32 rw 0 1 - -
1011 2 Restore_communication U32 rw 0 1 - -
1011 3 Restore_application U32 rw 0 1 - -
1012 0 COB-ID_TIME U32 rw 0 0x100 - -
1014 0 COB-ID_EMCY U32 rw 0 $NODEID+0x80 - -
1015 0 Inhibit_EMCY U16 rw 0 0 - -
1016 0 Highest U8 const 0 3 - -
1016 1 Consumer_1 U32 rw 0 0 - -
1016 2 Consumer_2 U32 rw 0 0 - -
1016 3 Consumer_3 U32 rw 0 0 - -
1017 0 Producer_heartbeat U16 rw 0 0 - -
1018 0 Highest U8 const 0 4 - -
1018 1 Vendor U32 ro 0 0x1234 - -
1018 2 Product U32 ro 0 0x5678 - -
1018 3 Revision U32 ro 0 0x00010000 - -
1018 4 Serial U32 ro 0 42 - -
1019 0 Counter_overflow U8 rw 0 0 - -
1020 0 Highest U8 const 0 2 - -
1020 1 Date U32 rw 0 0 - -
1020 2 Time U32 rw 0 0 - -
1029 0 Highest U8 const 0 1 - -
1029 1 Communication_error U8 rw 0 0 - -
1200 0 Highest U8 const 0 2 - -
1200 1 Client_to_server U32 ro 0 $NODEID+0x600 - -
1200 2 Server_to_client U32 ro 0 $NODEID+0x580 - -
1201 0 Highest U8 const 0 2 - -
1201 1 Client_to_server U32 rw 0 0x80000000 - -
1201 2 Server_to_client U32 rw 0 0x80000000 - -
2000 0 Limited U16 rw 1 3 1 5
2001 0 Long_string STR rw 0 - - -
2002 0 Domain DOM rw 0 - - -
2003 0 Write_only U16 wo 1 0 - -
2004 0 Bit_0 BOOL rw 1 0 - -
2005 0 Bit_1 BOOL rw 1 0 - -
2006 0 Number_24 I24 rw 1 0 - -
2007 0 Number_64 I64 rw 1 0 - -
2008 0 Real F32 rw 1 1.5 - -
2009 0 Crossed U16 rw 0 4 9 2
200A 0 Read_only_domain DOM ro 0 - - -
200B 0 Octets OCT rw 0 - - -
603F 0 Error_code U16 ro 1 0 - -
6040 0 Controlword U16 rw 1 0 - -
6041 0 Statusword U16 ro 1 0 - -
6060 0 Modes_of_operation I8 rw 1 0 - -
6061 0 Modes_of_operation_display I8 ro 1 0 - -
6064 0 Position_actual_value I32 ro 1 0 - -
606C 0 Velocity_actual_value I32 ro 1 0 - -
6077 0 Torque_actual_value I16 ro 1 0 - -
607A 0 Target_position I32 rw 1 0 - -
607D 0 Highest U8 const 0 2 - -
607D 1 Minimum_position_limit I32 rw 0 0x80000000 - -
607D 2 Maximum_position_limit I32 rw 0 0x7FFFFFFF - -
6083 0 Profile_acceleration U32 rw 1 1000 - -
60FD 0 Digital_inputs U32 ro 1 0 - -
60FF 0 Target_velocity I32 rw 1 0 - -
6502 0 Supported_drive_modes U32 ro 0 0x3EF - -
"""

RPDOS = [
    ("$NODEID+0x200", 255, ["60400010"]),
    ("$NODEID+0x300", 1, ["60400010", "60FF0020", "60600008"]),
    ("$NODEID+0x80000400", 1, []),
    ("$NODEID+0x80000500", 255, []),
    *[("0x80000000", 255, [])] * 4,
]
TPDOS = [
    ("$NODEID+0x40000180", 255, ["60410010"]),
    ("$NODEID+0x40000280", 1, ["60410010", "60640020"]),
    ("$NODEID+0xC0000380", 1, []),
    ("$NODEID+0xC0000480", 255, []),
    *[("0xC0000000", 255, [])] * 4,
]


def _pdo_rows() -> list[str]:
    rows = []
    for base, pdos, transmit in ((0x1400, RPDOS, False), (0x1800, TPDOS, True)):
        for number, (cob_id, kind, mapping) in enumerate(pdos):
            index = base + number
            rows += [
                f"{index:04X} 0 Highest U8 const 0 {6 if transmit else 5} - -",
                f"{index:04X} 1 COB-ID U32 rw 0 {cob_id} - -",
                f"{index:04X} 2 Transmission_type U8 rw 0 {kind} - -",
                f"{index:04X} 3 Inhibit_time U16 rw 0 0 - -",
                f"{index:04X} 5 Event_timer U16 rw 0 0 - -",
            ]
            if transmit:
                rows.append(f"{index:04X} 6 SYNC_start_value U8 rw 0 0 - -")
            index += 0x200
            rows.append(f"{index:04X} 0 Number_of_mapped_objects U8 rw 0 {len(mapping)} - -")
            for sub in range(1, 9):
                entry = f"0x{mapping[sub - 1]}" if sub <= len(mapping) else "0"
                rows.append(f"{index:04X} {sub} Mapping_{sub} U32 rw 0 {entry} - -")
    return rows


def eds_text() -> str:
    """Return the EDS of a small servo drive with eight PDOs in each direction."""
    rows = [line.split() for line in OBJECTS.strip().splitlines()] + [row.split() for row in _pdo_rows()]
    subs: dict[str, int] = {}
    for index, *_ in rows:
        subs[index] = subs.get(index, 0) + 1
    lines = ["[DeviceInfo]", "VendorName=Test", "BaudRate_1000=1"]
    seen = set()
    for index, sub, name, kind, access, mappable, default, low, high in rows:
        section = index
        if subs[index] > 1:
            if index not in seen:
                seen.add(index)
                object_type = 8 if index in ("1003", "1010", "1011", "1016", "1029", "607D") else 9
                lines += ["", f"[{index}]", f"ParameterName=Record_{index}", f"ObjectType={object_type}"]
                lines.append(f"SubNumber={subs[index]}")
            section = f"{index}sub{int(sub):X}"
        lines += ["", f"[{section}]", f"ParameterName={name.replace('_', ' ')}", "ObjectType=7"]
        lines += [f"DataType=0x{TYPES[kind]:04X}", f"AccessType={access}", f"PDOMapping={mappable}"]
        if default != "-":
            lines.append(f"DefaultValue={default}")
        if low != "-":
            lines += [f"LowLimit={low}", f"HighLimit={high}"]
    return "\n".join(lines) + "\n"
