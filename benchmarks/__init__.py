"""Measured ratios against the peers; `make bench` runs all of them."""
