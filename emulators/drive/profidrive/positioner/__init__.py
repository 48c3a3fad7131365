"""Basic positioner: traversing blocks, MDI, jog, homing."""
