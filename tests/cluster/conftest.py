"""A real Slurm, once per session, and controllers that send a study to it."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cluster.slurm import Cluster, NotStartedError, lacking, started
from tests.dag.conftest import workspace as workspace

OVERLAY = "results: results/cluster\nfigures: figures/cluster\n"


@pytest.fixture(scope="session")
def cluster() -> Iterator[Cluster]:
    pytest.importorskip("snakemake_executor_plugin_slurm", reason="pip install 'mtcsirl[slurm]'")
    if lack := lacking():
        pytest.skip(lack)
    try:
        with started() as running:
            yield running
    except NotStartedError as reason:
        pytest.skip(str(reason))


class Controller:
    """A Snakemake that sends its jobs to the cluster, in a folder of its own; what it says is in ``log``."""

    def __init__(self, workspace: Path, cluster: Cluster, folder: Path, overlay: str, *words: str) -> None:
        folder.mkdir()
        self.folder, self.log = folder, folder / "said"
        (folder / "overlay.yaml").write_text(OVERLAY + overlay, encoding="utf-8")
        self._own = ["--snakefile", str(workspace / "Snakefile"), "--configfile", str(workspace / "config/smoke.yaml")]
        self._own += [str(folder / "overlay.yaml"), "--workflow-profile", str(workspace / "profiles/default")]
        self._own += ["--profile", str(workspace / "profiles/slurm"), *words]
        self._environment = cluster.environment | {"PYTHONPATH": str(workspace / "src")}
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, *targets: str) -> "Controller":
        """Send the jobs of ``targets``."""
        command = [sys.executable, "-m", "snakemake", *targets, *self._own]
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                command, cwd=self.folder, env=self._environment, stdout=log, stderr=log, stdin=subprocess.DEVNULL
            )
        return self

    def ended(self, seconds: float = 900) -> int:
        """Its exit code."""
        assert self._process is not None
        return self._process.wait(seconds)

    def said(self) -> str:
        """Everything so far."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def target(self, run: str) -> str:
        """The file that one run leaves, to ask for it."""
        command = [sys.executable, "-m", "mtcsirl.cli", "target", run, "--scale", "smoke"]
        command += ["--config", str(self.folder / "overlay.yaml")]
        done = subprocess.run(
            command, cwd=self.folder, env=self._environment, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    def kill(self) -> None:
        """End it, whatever it waits for."""
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()


Controllers = Callable[..., Controller]


@pytest.fixture(scope="module")
def controllers(workspace: Path, cluster: Cluster, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Controllers]:
    made: list[Controller] = []

    def make(overlay: str, *words: str) -> Controller:
        made.append(Controller(workspace, cluster, tmp_path_factory.mktemp("cluster") / "study", overlay, *words))
        return made[-1]

    yield make
    for controller in made:
        controller.kill()
