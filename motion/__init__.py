"""The controller: from an instruction of the user program to the telegram of a drive, and back.

| package | what it is |
|---|---|
| `motion.s7` | an S7-1500 controller: technology objects, `MC_` instructions, alarms, CPU |
| `motion.kernel` | what every axis has whatever its make: ratios, actual values, setpoints, control |
| `motion.setpoint` | velocity and position profiles with limited jerk |
| `motion.drives` | ports to drives and encoders on every bus |

A dialect such as `motion.s7` imports the kernel, never another dialect.
"""
