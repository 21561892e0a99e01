"""Snakemake's messages as one screen: on a terminal redrawn in place, in a file one line per finished job.

Snakemake finds it by the package's name; profiles/default asks for it (``logger: mtcsirl``). Its full log stays in
.snakemake/log. A dry run, ``--printshellcmds`` and ``--verbose`` keep Snakemake's own form.
"""

import logging
import re
import shutil
import sys
import threading
import time
from pathlib import Path
from typing import Any

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from mtcsirl.study.screen import Screen, short, wrapped

SECONDS_BETWEEN = 2.0
"""On a terminal."""
UNSAID = re.compile(
    r"Assuming unrestricted|Using shell|Provided |Rules claiming|Select jobs|Execute \d+ jobs|Building DAG|None$"
    r"|Exiting because a job|Removing output files|Job stats|Trying to restart|Shutting down, this might"
)
"""What Snakemake says of itself in every run."""
COMMAND = re.compile(r"CalledProcessError in file .*\n?Command ")
"""A job's exit code with its whole command, beside what is said of the failed job."""
NO_LINES = (
    LogEvent.WORKFLOW_STARTED, LogEvent.PROGRESS, LogEvent.JOB_STARTED, LogEvent.SHELLCMD, LogEvent.RESOURCES_INFO,
    LogEvent.GROUP_INFO, LogEvent.GROUP_ERROR, LogEvent.DEBUG_DAG, LogEvent.RULEGRAPH,
)  # fmt: skip


class LogHandler(LogHandlerBase):
    """What Snakemake hands its records to."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        """Choose the stream and the form."""
        common = self.common_settings
        self._stream = sys.stdout if common.stdout else sys.stderr
        self._plain = common.dryrun or common.verbose or common.printshellcmds or common.debug_dag
        self._live = not self._plain and self._stream.isatty()
        self._screen, self._shown, self._lock = Screen(), 0, threading.RLock()
        self._over = threading.Event()
        if self._live:
            threading.Thread(target=self._refresh, daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Write what is to be said of a record."""
        with self._lock:
            try:
                self._write(self.format(record).split("\n") if self._plain else self._lines(record))
            except BrokenPipeError:
                raise
            except Exception:
                self.handleError(record)

    def close(self) -> None:
        """Leave the last screen standing."""
        self._over.set()
        super().close()

    def _lines(self, record: logging.LogRecord) -> list[str]:
        event, said = getattr(record, "event", None), record.__dict__
        if event == LogEvent.RUN_INFO:
            return self._screen.planned({rule: n for rule, n in said["stats"].items() if rule != "total"})
        if event == LogEvent.JOB_INFO:
            logs = paths(said["log"])
            self._screen.started(said["jobid"], said["rule_name"], made(said), logs[0] if logs else None)
        elif event == LogEvent.JOB_FINISHED:
            line = self._screen.finished(said["job_id"])
            return [] if self._live or not line else [short(f"{time.strftime('%H:%M:%S')} {line}")]
        elif event == LogEvent.JOB_ERROR:
            return self._failed(said)
        elif event not in NO_LINES:
            text = self.format(record)
            if record.levelno >= logging.WARNING or event is not None:
                return [] if UNSAID.match(text) or COMMAND.search(text) else wrapped(text)
            return [short(line) for line in text.splitlines() if line.strip() and not UNSAID.match(line)]
        return []

    def _failed(self, said: dict[str, Any]) -> list[str]:
        """What failed, why in the words of the cluster, and the last lines of its log."""
        first, *log = self._screen.fails(said["jobid"], said["rule_name"], made(said), paths(said["log"]))
        return [first, *(short(f"    {line}") for line in reason(said)), *log]

    def _write(self, lines: list[str]) -> None:
        if not lines and not self._live:
            return
        block = self._screen.block(shutil.get_terminal_size().columns) if self._live and self._screen.total else []
        above = f"\x1b[{self._shown}A\x1b[J" if self._shown else ""
        self._stream.write(above + "".join(f"{line}\n" for line in (*lines, *block)))
        self._stream.flush()
        self._shown = len(block)

    def _refresh(self) -> None:
        while not self._over.wait(SECONDS_BETWEEN):
            with self._lock:
                self._write([])


def made(said: dict[str, Any]) -> str:
    """What a job makes: the folder of a run, or its first file without the ending."""
    output = [str(file) for file in said["output"]]
    if not output:
        return ""
    first = Path(output[0].split(" (")[0])
    return str(first.parent if first.name.startswith(".") else first.with_suffix(""))


def reason(said: dict[str, Any]) -> list[str]:
    """The first sentence that an executor has for a failure, if it has one."""
    message = str(said.get("rule_msg") or "").partition("For further error details")[0]
    return [f"{message.split('. ')[0].rstrip('. ')}"] if message else []


def paths(logs: Any) -> list[Path]:
    """The logs of a job."""
    return [Path(str(log).split(" (")[0]) for log in logs or ()]
