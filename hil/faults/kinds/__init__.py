"""The kinds of faults, one module per seam."""
