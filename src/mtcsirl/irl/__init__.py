"""Inverse reinforcement learning: Algorithms 1 and 2 of the paper and the methods it compares."""
