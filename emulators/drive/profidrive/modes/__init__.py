"""Operating modes of a PROFIdrive axis: speed and position."""
