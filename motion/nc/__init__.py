"""A controller of the NC PTP style: tasks, axes with encoder, drive and controller components, `MC_`
blocks.
"""
