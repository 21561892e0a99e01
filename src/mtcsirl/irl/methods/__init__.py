"""The IRL methods, a file each: the function ``<name>`` of ``<name>.py`` here, its name in ``names.py``."""

from mtcsirl.extensions import METHODS

__all__ = ["METHODS"]
