"""A bench with three axes: x and y are CiA 402 drives on CAN, z a PROFIdrive drive on Modbus TCP."""

from hil.bench import BenchFile

_LIMITS = {
    "Mechanics.LeadScrew": 10.0,
    "DynamicLimits.MaxVelocity": 200.0,
    "DynamicLimits.MaxAcceleration": 1000.0,
    "DynamicLimits.MaxDeceleration": 1000.0,
    "DynamicLimits.MaxJerk": 20000.0,
    "DynamicDefaults.Velocity": 100.0,
    "DynamicDefaults.Acceleration": 500.0,
    "DynamicDefaults.Deceleration": 500.0,
    "DynamicDefaults.Jerk": 10000.0,
    "DynamicDefaults.EmergencyDeceleration": 2000.0,
    "PositionControl.Kv": 20.0,
    "PositionControl.Kpc": 100.0,
    "DynamicAxisModel.VelocityTimeConstant": 0.00025,
    "FollowingError.MinValue": 2.0,
    "FollowingError.MaxValue": 10.0,
    "FollowingError.MinVelocity": 50.0,
}


def _axis(name: str, steps: int, fine: int) -> str:
    sensor = {
        "Sensor[1].Parameter.StepsPerRevolution": steps,
        "Sensor[1].Parameter.FineResolutionXist1": fine,
    }
    rows = "\n".join(f'"{path}" = {value}' for path, value in {**_LIMITS, **sensor}.items())
    return f'[axis.{name}]\ndrive = "{name}_drive"\n[axis.{name}.variables]\n{rows}\n'


def text(*, z_steps: int = 2048, z_fine: int = 11) -> str:
    """Return the bench file; with another resolution of the encoder of z than its drive has (2048, 11 bits)
    the first move of z ends with alarm 521.
    """
    return f"""
[bench]
name = "three axes"
[segment.can0]
[segment.net0]
kind = "modbus_tcp"
[drive.x_drive]
segment = "can0"
node_id = 5
off3_ramp_s = 0.3
[drive.y_drive]
segment = "can0"
node_id = 6
[drive.z_drive]
profile = "profidrive"
telegram = 105
segment = "net0"
map = "sinamics_g120"
increments_per_revolution = 2048
off1_ramp_s = 0.8
off3_ramp_s = 0.3
{_axis("x", 131072, 0)}
{_axis("y", 131072, 0)}
{_axis("z", z_steps, z_fine)}
"""


BENCH = BenchFile("three_axes.toml", text())
WRONG_ENCODER = BenchFile("wrong_encoder.toml", text(z_steps=131072, z_fine=0))
