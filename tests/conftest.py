"""What all tests share: the checkout, and one thread for numerical libraries, as in every job."""

import gc
import os
import signal
from pathlib import Path

# before numpy, whose library reads them when it loads
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
import torch

import mtcsirl.agents.sac
from mtcsirl.settings import SacSettings
from mtcsirl.settings.runs import AgentRunSettings
from mtcsirl.worlds.drawable import lacking
from tests.claimed_device import ClaimedGenerator, ClaimedGpu

CHECKOUT = Path(__file__).resolve().parents[1]
HEEDING = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.default_int_handler)}
"""A process that heeds Ctrl-C: a shell's background jobs ignore it, and what they start inherits that."""
needs_rendering = pytest.mark.skipif(lacking() is not None, reason=str(lacking()))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow tests first: where several processes share the files, none waits for the last slow one."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish() -> None:
    """As in a job, the collector leaves alone what imports made: to look through it took a fifth of all time."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.fixture(scope="session")
def checkout() -> Path:
    return CHECKOUT


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture
def small_sac() -> SacSettings:
    """A learner that trains in seconds."""
    return SacSettings(hidden_sizes=(16, 16), minibatch=32, random_steps=100, updates_per_step=0.1)


@pytest.fixture
def small_run() -> AgentRunSettings:
    """A run that trains in seconds."""
    return AgentRunSettings(
        steps=300,
        cs_weight=2.0,
        curriculum=True,
        sac={"hidden_sizes": (16, 16), "minibatch": 32, "random_steps": 100, "updates_per_step": 0.2},
        evaluation={"episodes": 2, "episode_steps": 50},
        progress={"checkpoint_every": 100, "select_every": 100, "select_episodes": 1},
    )


@pytest.fixture
def claimed_gpu(monkeypatch: pytest.MonkeyPatch) -> ClaimedGpu:
    """To be entered; CUDA graphs, which only a GPU can capture, are run as they are."""
    monkeypatch.setattr(torch, "Generator", ClaimedGenerator)
    monkeypatch.setattr(mtcsirl.agents.sac, "CudaGraph", lambda program: program)
    return ClaimedGpu()
