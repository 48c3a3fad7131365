"""What every axis has whatever its make: ratios, actual values, setpoint pipeline, position control."""
