"""One screen for a long run: what is done of all by stage, what runs, the time left, and why something failed.

Plain data in, lines out; who hands over the events of a workflow and where the lines go is another matter.
"""

import textwrap
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

WIDEST = 200
"""Characters of a line."""
REASON = 90
"""Characters of one reason among several."""
LOG_LINES = 5
"""Of the log of a job that failed."""
IN_FULL = 8
"""Failures with lines of their logs; later ones take one line each, which names the log."""
EXPECTED: dict[str, float] = {}
"""Mean seconds of a job by its rule, as planned; the workflow fills it in. Measured ones count before these."""
UNKNOWN = 5.0
"""Seconds of a job that nobody planned: a table or a figure."""


@dataclass(frozen=True)
class Job:
    """A job that runs: its rule, what it makes, its log, when it started."""

    rule: str
    makes: str
    log: Path | None
    since: float


class Screen:
    """How far a workflow is."""

    def __init__(self, cores: int = 1, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._cores = clock, cores
        self.total: dict[str, int] = {}
        self.done: Counter[str] = Counter()
        self.failed: dict[int, str] = {}
        self.running: dict[int, Job] = {}
        self._took: dict[str, list[float]] = {}
        self._failures = 0

    def planned(self, jobs: Mapping[str, int]) -> list[str]:
        """Say how many jobs of each rule there will be."""
        self.total = dict(jobs)
        several = [f"{count} {rule}" for rule, count in jobs.items() if count > 1]
        single = [rule for rule, count in jobs.items() if count == 1]
        return wrapped(f"{sum(jobs.values())} jobs: {', '.join([*several, *single])}", 120)

    def started(self, number: int, rule: str, makes: str, log: Path | None) -> None:
        """A job starts; again, if it failed before."""
        self.running[number] = Job(rule, makes, log, self._clock())
        self.failed.pop(number, None)
        self._cores = max(self._cores, len(self.running))

    def finished(self, number: int) -> str:
        """One line for a job that ended well."""
        job = self.running.pop(number, None)
        if job is None:
            return ""
        took = self._clock() - job.since
        self.done[job.rule] += 1
        self._took.setdefault(job.rule, []).append(took)
        said = job.makes if job.makes.endswith(job.rule) else f"{job.rule} {job.makes}"
        return short(f"{self._count()} {said}, {duration(took)}{self._left()}")

    def fails(self, number: int, rule: str, makes: str, logs: Iterable[Path]) -> list[str]:
        """Lines for a job that failed: what, where its log is, the log's last lines."""
        self.running.pop(number, None)
        self.failed[number] = rule
        self._failures += 1
        logs = list(logs)
        lines = [short(f"failed: {rule} {makes}; log {', '.join(map(str, logs)) or 'none'}")]
        if self._failures <= IN_FULL:
            lines += [short(f"    {line}") for log in logs for line in last_lines(log, LOG_LINES)]
        return lines

    def block(self, width: int) -> list[str]:
        """The whole screen, for a terminal of ``width`` columns."""
        stages = "  ".join(f"{rule} {self.done[rule]}/{count}" for rule, count in self.total.items() if count > 1)
        failed = f", {len(self.failed)} failed" if self.failed else ""
        lines = [f"{self._count()} done{failed}{self._left()}", *textwrap.wrap(stages, max(width - 1, 20))]
        for job in self.running.values():
            at = last_said(job.log) if job.log else ""
            lines.append(f"  {duration(self._clock() - job.since):>8} {job.rule} {job.makes}: {at}")
        return [short(line, max(width - 1, 20)) for line in lines]

    def seconds_left(self) -> float:
        """For what is not done, spread over the cores: as the jobs of each rule took, or as planned."""
        left = 0.0
        for rule, count in self.total.items():
            took = self._took.get(rule)
            mean = sum(took) / len(took) if took else EXPECTED.get(rule, UNKNOWN)
            gone = [self._clock() - job.since for job in self.running.values() if job.rule == rule]
            left += max(count - self.done[rule], 0) * mean - sum(min(mean, seconds) for seconds in gone)
        return left / self._cores

    def _count(self) -> str:
        return f"{sum(self.done.values())} of {sum(self.total.values())}"

    def _left(self) -> str:
        waiting = sum(self.total.values()) - sum(self.done.values()) - len(self.failed)
        return f", about {duration(self.seconds_left())} left" if waiting > 0 else ""


def duration(seconds: float) -> str:
    """As in 8 s, 4 min, 2.5 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 100 * 60 else f"{seconds / 3600:.1f} h"


def short(line: str, most: int = WIDEST) -> str:
    """``line`` in at most ``most`` characters, its middle left out."""
    if len(line) <= most:
        return line
    head = (most - 5) * 2 // 3
    return f"{line[:head]} ... {line[len(line) - (most - 5 - head) :]}"


def first_of(reasons: Sequence[str], shown: int = 3) -> str:
    """The first reasons in few words each, and how many more there are."""
    more = [f"and {len(reasons) - shown} more"] if len(reasons) > shown else []
    return "; ".join([*(short(reason, REASON) for reason in reasons[:shown]), *more])


def wrapped(text: str, most: int = WIDEST) -> list[str]:
    """``text`` in lines of at most ``most`` characters, nothing left out."""
    lines = []
    for line in text.splitlines():
        indent = line[: len(line) - len(line.lstrip())]
        lines += textwrap.wrap(line, most, subsequent_indent=f"{indent}  ") if len(line) > most else [line]
    return lines


def last_lines(log: Path, count: int) -> list[str]:
    """The last lines of a log that say something, read from its last 64 kB."""
    try:
        with log.open("rb") as file:
            file.seek(max(log.stat().st_size - 65536, 0))
            text = file.read().decode("utf-8", "replace")
    except OSError:
        return []
    return [line.strip() for line in text.replace("\r", "\n").split("\n") if line.strip()][-count:]


def last_said(log: Path) -> str:
    """The last line of a log; nothing while it holds only the line that says when the job began."""
    line = next(iter(last_lines(log, 1)), "")
    return "" if line.startswith("--- ") else line
