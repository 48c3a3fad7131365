"""A program around Festo's festo-edcon: led by lines on its standard input, one JSON object per line answers.

    python edcon_motion.py HOST PORT

The package asks for port 502, which only an administrator can offer; the default of the library below it is
changed instead.
"""

from __future__ import annotations

import json
import sys

from pymodbus.client.tcp import ModbusTcpClient

ModbusTcpClient.__init__.__kwdefaults__["port"] = int(sys.argv[2])

from edcon.edrive.com_modbus import ComModbus  # noqa: E402 - behind the change
from edcon.edrive.motion_handler import MotionHandler  # noqa: E402


def main() -> None:
    """Answer orders until there are no more."""
    com = ComModbus(sys.argv[1], cycle_time=10, timeout_ms=1000)
    orders = {
        "info": lambda: com.device_info,
        "read": lambda number, sub, kind: com.read_pnu(number, sub, forced_format=kind),
        "write": lambda number, sub, kind, value: com.write_pnu(number, sub, value, forced_format=kind),
    }
    print(json.dumps("ready"), flush=True)
    with MotionHandler(com) as motion:
        for line in sys.stdin:
            name, *arguments = json.loads(line)
            order = orders.get(name) or getattr(motion, name)
            print(json.dumps(order(*arguments)), flush=True)


if __name__ == "__main__":
    main()
