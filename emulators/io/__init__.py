"""Modules between controller and machine: pulse outputs. One package each; none knows a bus."""
