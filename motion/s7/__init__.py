"""The S7-1500 dialect: technology objects with their variables and alarms, `MC_` instructions, CPU."""
