"""Meta-World's environments, bit for bit, in less time."""

from mtcsirl.fast_metaworld.factory import FastEnvironment, make_fast_environment

__all__ = ["FastEnvironment", "make_fast_environment"]
