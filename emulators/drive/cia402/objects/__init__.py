"""The object dictionary of the CiA 402 drive: table, and what reading and writing does."""
