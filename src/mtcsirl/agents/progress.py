"""Lines that a person can follow while agents train, and TensorBoard event files on request."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mtcsirl.errors import UserError

_SECONDS_BETWEEN_LINES = 5.0
_SHOWN = {"success": "success", "velocity": "velocity", "action_norm": "|a|_1", "task_reward": "task reward"}


class Progress:
    """Collects the metrics of finished episodes; logs their means every few seconds."""

    def __init__(self, steps: int, log: Callable[[str], None], events: Path | str | None = None) -> None:
        self._steps, self._log = steps, log
        self._writer = None if events is None else _event_writer(events)
        self._pending: list[dict[str, float]] = []
        self.start(0)

    def start(self, step: int) -> None:
        """Begin to measure speed at this step."""
        self._first_step, self._started = step, time.monotonic()
        self._logged = self._started

    def report(self, step: int, measured: Sequence[dict[str, float]]) -> None:
        """Note the metrics of the episode that ended at `step`, one dictionary per agent."""
        self._pending += measured
        if self._writer is not None:
            for agent, metrics in enumerate(measured):
                for name, value in metrics.items():
                    self._writer.add_scalar(f"{name}/{agent}" if len(measured) > 1 else name, value, step)
        now = time.monotonic()
        if now - self._logged >= _SECONDS_BETWEEN_LINES or step == self._steps:
            self._log(self._line(step, now))
            self._pending, self._logged = [], now

    def _line(self, step: int, now: float) -> str:
        rate = (step - self._first_step) / max(now - self._started, 1e-9)
        minutes, seconds = divmod(round((self._steps - step) / rate), 60)
        shown = _SHOWN | {"temperature": "temperature"}
        means = {
            label: np.mean([metrics[name] for metrics in self._pending if name in metrics])
            for name, label in shown.items()
            if any(name in metrics for metrics in self._pending)
        }
        values = "  ".join(f"{label} {mean:.3g}" for label, mean in means.items())
        return f"step {step}/{self._steps}  {rate:.0f} steps/s  {minutes}:{seconds:02d} left  {values}"

    def close(self) -> None:
        """Flush the event files."""
        if self._writer is not None:
            self._writer.close()


def _event_writer(folder: Path | str) -> Any:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise UserError("progress.tensorboard: needs TensorBoard; pip install 'mtcsirl[tensorboard]'") from error
    return SummaryWriter(str(folder))
