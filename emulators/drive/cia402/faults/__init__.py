"""Faults of the CiA 402 drive: codes, rules, memory, reactions."""
