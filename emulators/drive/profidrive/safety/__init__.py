"""Safety functions of a PROFIdrive axis, what they monitor, and the safe brake test."""
