"""Parameters of a PROFIdrive axis: list, values, access by requests, and what they stand for."""
