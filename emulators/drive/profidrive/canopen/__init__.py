"""The PROFIdrive axis as a CANopen node."""
