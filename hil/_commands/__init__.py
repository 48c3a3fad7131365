"""What the commands of `hil` do; one module each, loaded when the command runs."""
