"""Rewards: ground truth, reward networks, learned rewards."""
