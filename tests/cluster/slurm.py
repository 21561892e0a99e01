"""A Slurm of one node in a folder of its own: the real daemons of Debian's packages, no accounting, nothing in /etc.

It serves the tests, and whoever wants to try the profile: a command runs in it, then the daemons end.

    python -m tests.cluster.slurm snakemake --profile profiles/slurm --configfile config/smoke.yaml table_2
"""

import getpass
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

PROGRAMS = {"munged": "munge", "slurmctld": "slurm-wlm", "slurmd": "slurm-wlm", "sbatch": "slurm-wlm"}
"""What must be installed, and Debian's package that has it."""
SLOTS = 4
"""Jobs at once, though the machine may have fewer cores: one that waits for its time limit holds no core."""
PATIENCE = 30
"""Seconds until the daemons answer."""
CONFIGURATION = """
ClusterName=here
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
SlurmctldPort={controller}
SlurmdPort={node}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
ReturnToService=2
KillWait=15
MinJobAge=1800
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={slots} RealMemory={megabytes} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


class NotStartedError(Exception):
    """Why there is no cluster."""


def lacking(path: str | None = None) -> str | None:
    """Why no cluster can start here, or nothing; ``path``: where to look for the programs."""
    packages = {package for program, package in PROGRAMS.items() if not _found(program, path)}
    return f"no Slurm here: apt-get install {' '.join(sorted(packages))}" if packages else None


class Cluster:
    """The daemons and how to ask them; ``environment`` is what a command needs to find them."""

    def __init__(self, folder: Path, more: str = "") -> None:
        """``more``: further lines of slurm.conf."""
        self.folder, self._more = folder, more
        path = f"{folder / 'bin'}{os.pathsep}{os.environ.get('PATH', os.defpath)}"
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf"), "PATH": path}
        self._daemons: dict[str, subprocess.Popen[bytes]] = {}

    def start(self) -> None:
        """Start the three daemons; NotStartedError names the one that does not answer."""
        if lack := lacking():
            raise NotStartedError(lack)
        for name in ("state", "spool", "bin"):
            (self.folder / name).mkdir(parents=True)
        values = {
            "folder": self.folder, "host": socket.gethostname().partition(".")[0], "user": getpass.getuser(),
            "controller": _free_port(), "node": _free_port(), "slots": SLOTS,
            "megabytes": psutil.virtual_memory().total // 2**20,
        }  # fmt: skip
        (self.folder / "slurm.conf").write_text(CONFIGURATION.format(**values) + self._more, encoding="utf-8")
        # the plugin takes SLURM_CONF from the environment of the job's srun
        srun = self.folder / "bin" / "srun"
        srun.write_text(f'#!/bin/sh\nSLURM_CONF={self.folder}/slurm.conf exec {_found("srun")} "$@"\n')
        srun.chmod(0o755)
        self._start_munge()
        self.start_controller()
        self._start("slurmd", "-D")
        self._wait("slurmd", lambda: self.ask("sinfo", "--noheader", "--format=%t").stdout.strip() == "idle")

    def start_controller(self) -> None:
        """Start slurmctld, for the first time or again."""
        self._start("slurmctld", "-D")
        self._wait("slurmctld", lambda: self.ask("scontrol", "ping").returncode == 0)

    def stop_controller(self) -> None:
        """End slurmctld; jobs go on."""
        self._end("slurmctld")

    def stop(self) -> None:
        """Cancel what runs, then end the daemons."""
        if "slurmd" in self._daemons:
            self.ask("scancel", "--user", getpass.getuser())
            until(lambda: not self.ask("squeue", "--noheader").stdout.strip(), PATIENCE)
        for name in reversed(list(self._daemons)):
            self._end(name)

    def ask(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command of Slurm."""
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False, timeout=60)

    def _start_munge(self) -> None:
        """Its own key and socket: that of the machine, if it runs, is left alone."""
        key, tempered = self.folder / "munge.key", self.folder / "munge.socket"
        key.write_bytes(os.urandom(128))
        key.chmod(0o600)
        places = {"pid-file": "munge.pid", "log-file": "munge.log", "seed-file": "munge.seed"}
        own = [f"--{option}={self.folder / name}" for option, name in places.items()]
        self._start("munged", "--foreground", "--force", f"--socket={tempered}", f"--key-file={key}", *own)
        self._wait("munged", tempered.exists)

    def _start(self, name: str, *words: str) -> None:
        with (self.folder / f"{name}.out").open("ab") as said:
            command = [str(_found(name)), *words]
            self._daemons[name] = subprocess.Popen(command, env=self.environment, stdout=said, stderr=said)

    def _wait(self, name: str, ready: Callable[[], object]) -> None:
        daemon = self._daemons[name]
        if not until(lambda: daemon.poll() is not None or ready(), PATIENCE) or daemon.poll() is not None:
            said = (self.folder / f"{name}.out").read_text(errors="replace").strip().splitlines()
            raise NotStartedError(f"{name} does not start: {said[-1] if said else 'it says nothing'}")

    def _end(self, name: str) -> None:
        daemon = self._daemons.pop(name)
        daemon.send_signal(signal.SIGTERM)
        try:
            daemon.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            daemon.kill()
            daemon.wait()


@contextmanager
def started(more: str = "") -> Iterator[Cluster]:
    """A cluster in a new folder of its own (directly in /tmp: the path of a socket must be short), gone afterwards."""
    folder = Path(tempfile.mkdtemp(prefix=f"slurm-{os.getpid()}-", dir="/tmp"))
    cluster = Cluster(folder, more)
    try:
        cluster.start()
        yield cluster
    finally:
        cluster.stop()
        shutil.rmtree(folder, ignore_errors=True)


def _found(program: str, path: str | None = None) -> str | None:
    """Daemons stand in folders that a user's PATH may lack."""
    return shutil.which(program, path=path or f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def until(true: Callable[[], object], seconds: float) -> bool:
    """Whether ``true()`` holds within so many seconds."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if true():
            return True
        time.sleep(0.1)
    return False


def main(command: list[str]) -> int:
    """Run a command in a cluster; its exit code."""
    try:
        with started() as cluster:
            return subprocess.run(command, env=cluster.environment, check=False).returncode
    except NotStartedError as reason:
        print(reason, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
