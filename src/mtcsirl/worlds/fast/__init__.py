"""Meta-World's environments, bit for bit, in less time."""

from mtcsirl.worlds.fast.loading import import_meta_world

import_meta_world()  # before any other module of this folder imports it

from mtcsirl.worlds.fast.environment import FastEnvironment  # noqa: E402
from mtcsirl.worlds.fast.factory import make_fast_environment  # noqa: E402
from mtcsirl.worlds.fast.following import follow_set_task  # noqa: E402

follow_set_task(FastEnvironment)

__all__ = ["FastEnvironment", "make_fast_environment"]
