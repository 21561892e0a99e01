"""Measures what this machine trains in a second, for the plan and for the benchmarks."""
