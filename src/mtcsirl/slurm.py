"""Slurm as the controller of a study sees it: whether it answers, and whether it still knows the jobs.

The Slurm plugin asks for the state of its jobs; where that question fails it waits for ever without a word. Here the
same question is asked before the first job, where an answer that cannot come ends the study, and all the while, where
it is said within a minute.
"""

import re
import subprocess
import threading
import time
from collections.abc import Callable, Collection
from shutil import which
from typing import Protocol

from mtcsirl.errors import UserError

EVERY = 20.0
"""Seconds between two questions; what is asked twice in vain is said."""
PATIENCE = 15
"""Seconds for an answer."""
LONGEST_PAUSE = 180
"""Seconds that the plugin may let pass between its questions: a job that squeue forgets sooner is never seen to end."""
PAUSES = 3
"""First pauses for which squeue must keep a job, else the plugin asks sacct without a word."""
QUESTIONS = {
    "squeue": ("squeue", "--me", "--states=all", "--noheader", "--format=%i"),
    "sacct": ("sacct", "-X", "--noheader", "--parsable2", "--format=JobID", "--starttime=now-2days"),
}
AS_PROFILE = "use --slurm-status-command squeue, as profiles/slurm does"


class SilentError(Exception):
    """Slurm gave no answer: why."""


def answering(wanted: str | None, first_pause: int = 0) -> str:
    """The command that the plugin will ask by; ``first_pause``: seconds before it asks for the first time.

    Raises:
        UserError: one line with the way out, where the plugin would wait for ever.
    """
    if wanted == "sacct" and which("sacct"):
        if why := _silence("sacct"):
            raise UserError(f"slurm: sacct cannot see the jobs ({why}); {AS_PROFILE}")
        return "sacct"
    if why := _silence("squeue"):
        raise UserError(f"slurm: squeue cannot see the jobs ({why}); start again once sinfo answers")
    kept, needed = _kept_seconds(), max(LONGEST_PAUSE, PAUSES * first_pause)
    if kept >= needed:
        return "squeue"
    forgets = f"squeue forgets a job {kept} s after its end (MinJobAge)"
    if why := _silence("sacct"):
        raise UserError(f"slurm: {forgets}, sacct cannot see it ({why}); ask for accounting or MinJobAge={needed}")
    raise UserError(f"slurm: {forgets}; use --slurm-status-command sacct")


def known(status_command: str) -> set[str]:
    """The jobs that Slurm knows, an array as one; SilentError says why there is no answer."""
    return {line.partition("_")[0].strip() for line in _ask(*QUESTIONS[status_command]).splitlines()}


class Jobs(Protocol):
    """The jobs that a controller waits for."""

    def numbers(self) -> Collection[str]:
        """As Slurm calls them."""

    def take_back(self) -> None:
        """See to those that the controller has lost sight of; asked whenever Slurm answers."""


class Watch:
    """Asks for the jobs that the controller waits for, and says once what is wrong and once that it is over."""

    def __init__(self, status_command: str, jobs: Jobs, say: Callable[[str], object]) -> None:
        self._command, self._jobs, self._say = status_command, jobs, say
        self._since: float | None = None
        self._missed: set[str] = set()
        self._said: set[str] = set()

    def start(self) -> None:
        """Watch until the process ends."""
        threading.Thread(target=self._watch, daemon=True, name="slurm watch").start()

    def look(self) -> None:
        """Ask once."""
        waited_for = {job.partition("_")[0] for job in self._jobs.numbers()}
        try:
            answer = known(self._command)
        except SilentError as why:
            self._silent(str(why))
            return
        if self._since is not None:
            self._say(f"slurm: {self._command} answers again, after {time.monotonic() - self._since:.0f} s")
            self._since = None
        self._compare(waited_for - answer)
        self._jobs.take_back()

    def _silent(self, why: str) -> None:
        if self._since is None:
            self._since = time.monotonic()
            self._say(f"slurm: {self._command} cannot see the jobs ({why}); they go on, the study waits for an answer")

    def _compare(self, missing: set[str]) -> None:
        """Twice missing is lost: the answer to a question may be older than a job."""
        lost = (missing & self._missed) - self._said
        self._missed, self._said = missing, self._said | lost
        if lost:
            jobs = ", ".join(sorted(lost))
            self._say(
                f"slurm: {self._command} no longer knows {jobs}, for which the study would wait for ever;"
                " end Snakemake and start it again: what is finished stays, the rest goes on from its checkpoints"
            )

    def _watch(self) -> None:
        while True:
            time.sleep(EVERY)
            self.look()


def _kept_seconds() -> int:
    """How long squeue shows a job after its end."""
    found = re.search(r"^MinJobAge\s*=\s*(\d+)", _ask("scontrol", "show", "config"), re.MULTILINE)
    return int(found[1]) if found else 0


def _silence(status_command: str) -> str | None:
    """Why the question has no answer, or nothing."""
    try:
        _ask(*QUESTIONS[status_command])
    except SilentError as why:
        return str(why)
    return None


def _ask(*command: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise SilentError(f"no answer in {PATIENCE} s") from None
    except OSError as error:
        raise SilentError(f"{command[0]}: {error.strerror}") from None
    if done.returncode:
        said = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        raise SilentError(said[-1] if said else f"{command[0]} ends with {done.returncode}")
    return done.stdout
