"""Were the discriminators of an IRL run saturated, asleep or at work? One row per run, task and discriminator.

Judged on the last quarter of the iterations, from what every run logs (``diagnostics.csv``, see docs/methods.md). The
share of transitions on the right side of the logit, averaged over experts and generator, is 1 for a discriminator that
tells all apart and 0.5 for one that tells nothing apart:

- ``saturated``: at least ``SATURATED``; f then grows along what told them apart and says little about the rest
- ``asleep``: at most ``BLIND`` although the generator is below its gate, so there is something to tell apart
- ``matched``: at most ``BLIND`` and the generator passed
- ``at work``: between the two
- ``no number``: an accuracy, f's mean or its gradient is none in one of these iterations
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from mtcsirl.errors import UserError
from mtcsirl.files import storage
from mtcsirl.names import DIAGNOSTIC_COLUMNS
from mtcsirl.results.agents import run_key
from mtcsirl.results.gate_file import read_verdict
from mtcsirl.study.runs import IrlRun

SATURATED, BLIND = 0.99, 0.55
LAST_SHARE = 0.25
RUN = ("experiment", "method", "cs_reward", "source", "seed")
OF_GENERATOR = ("log_pi_expert_q05", "log_pi_expert_q95", "log_pi_generator_q05", "log_pi_generator_q95", "temperature")
OF_DISCRIMINATOR = ("accuracy_expert", "accuracy_generator", "gradient_norm", "f_expert_mean", "f_generator_mean")
COLUMNS = (
    *RUN, "task", "target", "discriminator", "state", *OF_DISCRIMINATOR, *OF_GENERATOR, "metric", "success", "passed",
)  # fmt: skip


def read_diagnoses(runs: Sequence[IrlRun], results: Path | str) -> pd.DataFrame:
    """``diagnose`` of all ``runs``, columns ``COLUMNS``.

    Raises:
        UserError: a file is missing or unreadable.
    """
    frames = []
    for run in runs:
        folder = Path(results) / run.folder
        rows = storage.read_csv(folder / "diagnostics.csv", DIAGNOSTIC_COLUMNS)
        gate = read_verdict(folder / "gate.json")
        try:
            found = diagnose(rows, gate["members"])
        except (KeyError, TypeError) as error:
            raise UserError(
                f"{folder}: gate.json or diagnostics.csv lacks {error} of a generator; make the run again"
            ) from error
        frames.append(found.assign(**run_key(run) | {"seed": run.seed}).drop(columns="stage"))
    return pd.concat(frames, ignore_index=True)[list(COLUMNS)] if frames else pd.DataFrame(columns=list(COLUMNS))


def diagnose(diagnostics: pd.DataFrame, gates: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """One row per generator and discriminator: means over the last quarter of the iterations, and the state.

    ``gates`` are the generators' gates as in ``gate.json``: task, target, metric, success, passed.
    """
    late = diagnostics[diagnostics["step"] > (1 - LAST_SHARE) * diagnostics["step"].max()]
    key = ["task", "target", "discriminator"]
    values = late.groupby([*key, "metric"])["value"]
    # A mean over some of the iterations is none: NaN logits count as wrong ones and would look like a sleeping network.
    means = values.mean().where(values.count() == values.size()).unstack("metric")
    rows = []
    for gate in gates:
        member = means.loc[(gate["task"], gate["target"])]
        judged = {name: gate[name] for name in ("task", "target", "metric", "success", "passed")}
        judged |= {name: float(member.at["", name]) for name in OF_GENERATOR}
        for name in member.index.drop(""):
            own = {metric: float(member.at[name, metric]) for metric in OF_DISCRIMINATOR}
            known = all(map(math.isfinite, own.values()))
            accuracy = (own["accuracy_expert"] + own["accuracy_generator"]) / 2 if known else math.nan
            rows.append(judged | own | {"discriminator": name, "state": state(accuracy, gate["passed"])})
    return pd.DataFrame(rows)


def state(accuracy: float, passed: bool) -> str:
    """What a balanced accuracy means for a generator that passed its gate or did not."""
    if not math.isfinite(accuracy):
        return "no number"
    if accuracy >= SATURATED:
        return "saturated"
    if accuracy > BLIND:
        return "at work"
    return "matched" if passed else "asleep"


def diagnoses_markdown(rows: pd.DataFrame, notes: Sequence[str] = ()) -> str:
    """A table with one line per generator and discriminator, and how many are in which state."""
    counts = rows.groupby(["experiment", "method", "cs_reward", "discriminator", "state"]).size().reset_index()
    totals = ["- {} {} {}, {}: {} {}".format(*row[:4], row[5], row[4]) for row in counts.to_numpy()]
    head = ("run", "task", "f", "state", "accuracy, expert", "generator", "f, expert", "generator", "gradient norm",
            "log pi, expert", "generator", "temperature", "generator reaches")  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for row in rows.to_dict("records"):
        lines.append("| " + " | ".join(_cells(row)) + " |")
    explained = (
        "Means over the last quarter of the iterations. Accuracy: share of transitions on the right side of the logit. "
        f"State: saturated (mean of both accuracies at least {SATURATED}), at work, or at most {BLIND}: matched where "
        "the generator passed its gate, asleep where it did not. log pi: 5 % to 95 % quantile. * below its gate."
    )
    return "\n".join([explained, *notes, "", *totals, "", *lines]) + "\n"


def _cells(row: Mapping[Any, Any]) -> list[str]:
    run = f"{row['experiment']} {row['method']} {row['cs_reward']} {row['source']} s{row['seed']}"
    spans = [f"{row[f'log_pi_{side}_q05']:.1f} to {row[f'log_pi_{side}_q95']:.1f}" for side in ("expert", "generator")]
    reached = f"{row['metric']:.2f}, success {row['success']:.1f}{'' if row['passed'] else ' *'}"
    accuracies = [f"{row[f'accuracy_{side}']:.2f}" for side in ("expert", "generator")]
    means = [f"{row[f'f_{side}_mean']:.1f}" for side in ("expert", "generator")]
    name = f"{row['task']}-t{row['target']}"
    return [run, name, row["discriminator"], row["state"], *accuracies, *means, f"{row['gradient_norm']:.3g}", *spans,
            f"{row['temperature']:.3g}", reached]  # fmt: skip
