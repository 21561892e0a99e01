import ctypes.util

import pytest

from mtcsirl.settings import Settings
from tests.figures.made_up import made_up_data

needs_osmesa = pytest.mark.skipif(
    ctypes.util.find_library("OSMesa") is None, reason="rendering needs Debian's libosmesa6"
)


@pytest.fixture(scope="session")
def settings():
    return Settings(seeds=(0, 1, 2), irl_seeds=(0, 1, 2), methods=("mt_csirl",))


@pytest.fixture(scope="session")
def data(settings):
    return made_up_data(settings)
