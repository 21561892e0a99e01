"""What all tests share: the checkout, and one thread for numerical libraries, as in every job."""

import os
from pathlib import Path

import pytest

from mtcsirl.cli import THREADS

for _name in THREADS:
    os.environ.setdefault(_name, "1")

CHECKOUT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def checkout() -> Path:
    return CHECKOUT
