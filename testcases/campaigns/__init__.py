"""Campaigns that ship with the product: executable acceptance of stopping and of the reaction to faults."""
