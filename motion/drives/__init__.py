"""Ports to drives: what an axis asks of its drive (`port`), and one module for each profile and bus that
carries it.
"""
