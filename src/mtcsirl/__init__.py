"""Replication suite for "Multi Task Inverse Reinforcement Learning for Common Sense Reward"."""

__version__ = "0.1.0"
