"""Faults and warnings of a PROFIdrive axis: catalogue, fault buffer, present state."""
