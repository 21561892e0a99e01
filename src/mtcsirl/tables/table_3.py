"""Table 3 (tab:mtl_velocity): velocity ratio of agents across tasks, rewards of several targets of one task."""

import pandas as pd

from mtcsirl.results.published import Published, load_published
from mtcsirl.settings import Settings
from mtcsirl.tables.cross_transfer import cross_transfer_table
from mtcsirl.tables.table import Table


def table_3(rows: pd.DataFrame, settings: Settings, published: Published | None = None) -> Table:
    """Build the table from ``evaluation_rows``."""
    return cross_transfer_table("table_3", "velocity", rows, settings, published or load_published())
