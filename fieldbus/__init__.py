"""What is spoken on the wire, by either side: time, CAN, CANopen, CiA 402 words.

This package knows neither drives nor axes; `emulators` and `motion` stand on it and meet only here.
"""

from fieldbus import core_build

core_build.install()
