"""Record what rliable computes on fixed data; tests/results/test_statistics.py holds our statistics against it.

rliable is archived and pins old packages, so it gets an environment of its own:

    python -m venv /tmp/rliable && /tmp/rliable/bin/pip install rliable "pandas<3"
    /tmp/rliable/bin/python benchmarks/compare_with_rliable.py tests/data/rliable.json

Its interval estimates draw from its own generator, whose seed argument has no effect; they are recorded with many
resamples, and compared with a tolerance.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from rliable import library, metrics

RESAMPLES = 20_000


def main(path: Path) -> None:
    """Write the fixed data and rliable's numbers as JSON."""
    generator = np.random.default_rng(2402_11367)
    first = np.round(generator.normal(0.73, 0.1, (5, 4)), 3)
    second = np.round(generator.normal(0.66, 0.15, (7, 4)), 3)
    tied = np.round(first[:, :2], 1)
    shifted = np.round(tied[::-1] + 0.1, 1)
    scores = {"first": first}
    points, intervals = library.get_interval_estimates(
        scores, lambda x: np.array([metrics.aggregate_mean(x), metrics.aggregate_iqm(x)]), reps=RESAMPLES
    )
    pair = {"pair": (first, second)}
    improvement, improvement_interval = library.get_interval_estimates(
        pair, metrics.probability_of_improvement, reps=RESAMPLES
    )
    record = {
        "rliable": version("rliable"),
        "numpy": version("numpy"),
        "resamples": RESAMPLES,
        "data": {
            "first": first.tolist(),
            "second": second.tolist(),
            "tied": tied.tolist(),
            "shifted": shifted.tolist(),
        },
        "mean": points["first"][0],
        "mean_interval": intervals["first"][:, 0].tolist(),
        "iqm": points["first"][1],
        "iqm_interval": intervals["first"][:, 1].tolist(),
        "iqm_second": metrics.aggregate_iqm(second),
        "probability_of_improvement": float(improvement["pair"]),
        "probability_of_improvement_interval": improvement_interval["pair"].ravel().tolist(),
        "probability_of_improvement_tied": metrics.probability_of_improvement(tied, shifted),
    }
    path.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
