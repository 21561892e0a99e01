import pytest

from mtcsirl.settings import Settings
from tests.figures.made_up import made_up_data


@pytest.fixture(scope="session")
def settings():
    return Settings(seeds=(0, 1, 2), irl_seeds=(0, 1, 2), methods=("mt_csirl",))


@pytest.fixture(scope="session")
def data(settings):
    return made_up_data(settings)
