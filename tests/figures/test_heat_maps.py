import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from mtcsirl.figures import heat_maps as heatmaps
from mtcsirl.figures.heat_maps import heat_map, heat_map_caption, heat_map_matrices
from mtcsirl.results.published import load_published
from mtcsirl.results.rows import BELOW_GATE
from mtcsirl.settings import Settings
from mtcsirl.study.design import design
from tests.results.made_up import evaluation

SETTINGS = Settings(
    seeds=(0, 1), multi_target={"tasks": ("reach-wall", "drawer-close", "push-back"), "train_targets": (1, 2)}
)
NAMES = {"action_norm": "table_1", "velocity": "table_3"}


def rows(cs_reward):
    def means(agent):
        return {cs_reward: 2.4 if agent["stage"] == "transfer" and agent["source"] == agent["task"] else 0.4}

    return evaluation(design(SETTINGS, NAMES[cs_reward]), means, spread=0.1)


@pytest.mark.parametrize("cs_reward", NAMES)
def test_both_panels_share_one_scale_that_holds_every_value(cs_reward):
    """Ours overshoots the target threefold on the diagonal (velocity): the scale stretches for both panels."""
    frame = rows(cs_reward)
    paper, ours, _, _ = heat_map_matrices(cs_reward, frame, SETTINGS, load_published())
    figure = heat_map(cs_reward, frame, SETTINGS)
    assert isinstance(figure, Figure)
    images = [image for axes in figure.axes for image in axes.get_images()]
    limits = {image.get_clim() for image in images}
    assert len(images) == 2
    assert len(limits) == 1
    (low, high), *_ = limits
    assert low == 0
    assert high >= max(np.nanmax(paper), np.nanmax(ours), 1.0)
    assert paper.shape == ours.shape == (4, 3)
    assert paper[0, 0] == load_published().cross_transfer(cs_reward, "reach-wall", "reach-wall").mean


def test_incomplete_cells_are_starred_and_missing_ones_empty():
    frame = rows("velocity")
    frame.loc[(frame["source"] == "push-back") & (frame["seed"] == 1), "value"] = np.nan
    frame.loc[(frame["source"] == "drawer-close") & (frame["task"] == "reach-wall"), "value"] = np.nan
    _, ours, incomplete, _ = heat_map_matrices("velocity", frame, SETTINGS, load_published())
    assert incomplete.sum() == 4
    assert np.isnan(ours).sum() == 1
    texts = [text.get_text() for text in heat_map("velocity", frame, SETTINGS).axes[1].texts]
    assert len(texts) == 11
    assert sum(text.endswith("*") for text in texts) == 3


def test_cells_whose_agents_lost_their_task_say_how_many():
    """A cell on target would be taken for a reward that serves."""
    frame = rows("velocity")
    lost = (frame["stage"] == "transfer") & (frame["source"] == "push-back") & (frame["task"] == "reach-wall")
    figure = heat_map("velocity", frame.assign(status=frame["status"].mask(lost, BELOW_GATE)), SETTINGS)
    marked = [text.get_text() for text in figure.axes[1].texts if "†" in text.get_text()]
    assert len(marked) == 1
    assert marked[0].endswith("\n†2")
    assert any("below their gate" in text.get_text() for text in figure.texts)
    assert not any("†" in text.get_text() for text in heat_map("velocity", frame, SETTINGS).findobj(Text))


def test_nothing_there_yet_still_shows_the_paper():
    frame = rows("velocity").assign(value=np.nan, status="missing")
    axes = heat_map("velocity", frame, SETTINGS).axes
    assert len(axes[0].texts) == 12
    assert len(axes[1].texts) == 0


def test_caption_names_the_table_and_n():
    assert "Table 3" in heat_map_caption("velocity", SETTINGS)
    assert "n = 2" in heat_map_caption("velocity", SETTINGS)


@pytest.mark.parametrize("part", np.linspace(0, 1, 21))
def test_numbers_can_be_read_on_every_colour(part):
    """Black or white ink, whichever is chosen, has the contrast of 4.5 that WCAG asks of small text."""
    luminance = heatmaps._luminance(part)
    contrast = 1.05 / (luminance + 0.05) if luminance < 0.18 else (luminance + 0.05) / 0.05
    assert contrast >= 4.5
