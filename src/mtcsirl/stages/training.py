"""One function per stage of the DAG: what the command line and a notebook call.

Each takes the settings of its run, the run's key and the folder it fills; it holds the folder's lock, resumes a run
that was killed and leaves ``settings.json`` and ``provenance.json`` beside its results.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from pydantic import BaseModel

from mtcsirl.agents.training import AgentJob, train_agents
from mtcsirl.episodes.policy import load_policy
from mtcsirl.files import storage
from mtcsirl.files.provenance import Stopwatch, write_provenance
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.learned import DESCRIPTION, WEIGHTS, load_learned_reward
from mtcsirl.settings.runs import (
    AgentRunSettings,
    DemonstrationRunSettings,
    IrlRunSettings,
    ScoreRunSettings,
)

CHECKPOINT = "checkpoint.safetensors"


def train(job: AgentJob, output: Path) -> None:
    """Train one agent: stages ``train_expert``, ``train_sac`` and ``transfer``, by their jobs below."""
    with _run(job.settings, output, job.inputs):
        events = output / "events" if job.settings.progress.tensorboard else None
        (agent,) = train_agents([job], checkpoints=[output / CHECKPOINT], events=events)
        agent.save(output)


def expert_job(settings: AgentRunSettings, task: str, target: int, cs_reward: str, seed: int) -> AgentJob:
    """SAC on r_task + C alpha r_cs; keeps the best policy by the expert's gate (appendix B)."""
    f = ground_truth(cs_reward, settings.environment.observation)
    return AgentJob(task, target, seed, settings, cs_reward, f=f, gate="expert")


def sac_job(settings: AgentRunSettings, task: str, target: int, seed: int) -> AgentJob:
    """SAC on r_task alone: the baseline."""
    return AgentJob(task, target, seed, settings)


def transfer_job(
    settings: AgentRunSettings,
    reward: Path,
    task: str,
    target: int,
    cs_reward: str,
    seed: int,
    *,
    learned_task_reward: bool = False,
) -> AgentJob:
    """SAC from scratch on r_task + f with the frozen f in the folder ``reward``.

    ``learned_task_reward``: MT-CSIRL+LT's learned task reward stands in for r_task (Table 4). The policy after the last
    step is kept: choosing one by the true metric would use what the learned reward has to convey.
    """
    learned = load_learned_reward(reward)
    return AgentJob(
        task,
        target,
        seed,
        settings,
        cs_reward,
        f=learned,
        task_reward=learned.task_reward(task, target) if learned_task_reward else None,
        gate="sac",
        keep="last",
        reward_id=storage.checksum(reward / WEIGHTS),
        inputs={name: reward / name for name in (WEIGHTS, DESCRIPTION)},
    )


def collect_demonstrations(
    settings: DemonstrationRunSettings, expert: Path, task: str, target: int, cs_reward: str, output: Path
) -> None:
    """Record episodes of the stochastic expert in the folder ``expert`` as ``demonstrations.parquet``.

    They pass the expert's gate themselves or are marked: ten other episodes of the same expert may have been lucky.
    """
    from mtcsirl.episodes.demonstrations import collect_demonstrations as collect
    from mtcsirl.episodes.demonstrations import demonstrated
    from mtcsirl.episodes.evaluation import gate_verdict

    with _run(settings, output, {"policy": expert / "policy.safetensors"}):
        frame = collect(load_policy(expert), task, target, settings, seed=0)
        storage.write_parquet(output / "demonstrations.parquet", frame)
        storage.write_json(output / "gate.json", gate_verdict("expert", demonstrated(frame), cs_reward, settings.gates))


def learn_reward(
    settings: IrlRunSettings,
    method: str,
    cs_reward: str,
    demonstrations: Sequence[Path],
    seed: int,
    output: Path,
) -> None:
    """Algorithm 1 or 2 over one file of demonstrations per task and target."""
    from mtcsirl.irl.run import learn_reward as run_irl

    inputs = {f"demonstrations_{index}": Path(file) for index, file in enumerate(demonstrations)}
    with _run(settings, output, inputs):
        run_irl(output, method, cs_reward, demonstrations, seed, settings)


def score_reward(
    settings: ScoreRunSettings,
    reward: Path,
    expert: Path,
    baseline: Path,
    task: str,
    target: int,
    cs_reward: str,
    seed: int,
    output: Path,
) -> None:
    """Hold the learned reward in the folder ``reward`` against the truth on named transition sets."""
    from mtcsirl.stages.scoring import score  # scipy.stats, which the other stages start without

    with _run(settings, output, {"reward": reward / WEIGHTS}):
        score(settings, reward, expert, baseline, task, target, cs_reward, seed, output)


@contextmanager
def _run(settings: BaseModel, output: Path, inputs: Mapping[str, Path]) -> Iterator[None]:
    """Hold the folder while the block fills it; then write its settings and provenance."""
    stopwatch = Stopwatch()
    with storage.locked(output):
        yield
        sign(output, settings, stopwatch, inputs)
        storage.remove(output / CHECKPOINT)


def sign(
    output: Path, settings: BaseModel, stopwatch: Stopwatch, inputs: Mapping[str, Path], *, agents: int = 1
) -> None:
    """Leave settings and provenance in the folder of a finished run, one of ``agents`` that a process made at once."""
    storage.write_json(output / "settings.json", settings.model_dump(mode="json"))
    write_provenance(output, stopwatch, inputs, agents=agents)
