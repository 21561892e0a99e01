"""The paper's tables: pure functions of ``evaluation_rows``, one module per table."""

from collections.abc import Callable

from mtcsirl.tables.table import Table
from mtcsirl.tables.table_1 import table_1
from mtcsirl.tables.table_2 import table_2
from mtcsirl.tables.table_3 import table_3
from mtcsirl.tables.table_4 import table_4
from mtcsirl.tables.table_5 import table_5

TABLES: dict[str, Callable[..., Table]] = {
    "table_1": table_1,
    "table_2": table_2,
    "table_3": table_3,
    "table_4": table_4,
    "table_5": table_5,
}
"""(rows, settings) -> Table, by name."""
