"""Meta-World's environments, bit for bit, in less time."""

from mtcsirl.worlds.fast.factory import FastEnvironment, make_fast_environment

__all__ = ["FastEnvironment", "make_fast_environment"]
