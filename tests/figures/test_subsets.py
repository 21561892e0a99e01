"""Every figure of studies that leave out parts of the paper's design, with and without results."""

import pytest

from mtcsirl.figures import FIGURES, figure_spec
from mtcsirl.figures.data import FigureData
from mtcsirl.settings import Settings
from tests.figures.made_up import made_up_data
from tests.subsets import SUBSETS, subset

pytestmark = pytest.mark.slow

DRAWN = [name for name in FIGURES if not figure_spec(name).rendered]


@pytest.mark.parametrize("name", SUBSETS)
def test_no_subset_fails(name):
    settings = Settings(**subset(name))
    for data in (made_up_data(settings), FigureData(settings=settings)):
        for figure in DRAWN:
            spec = figure_spec(figure)
            spec.draw(data)
            assert spec.caption(data)
