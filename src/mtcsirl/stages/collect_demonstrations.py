"""Stage ``collect_demonstrations``: episodes of the stochastic expert as ``demonstrations.parquet``.

They pass the expert's gate themselves or are marked: ten other episodes of the same expert may have been lucky.
"""

from pathlib import Path

from mtcsirl.episodes.demonstrations import collect_demonstrations as collect
from mtcsirl.episodes.demonstrations import demonstrated
from mtcsirl.episodes.evaluation import check_agent
from mtcsirl.episodes.gates import gate_verdict
from mtcsirl.episodes.policy import load_policy
from mtcsirl.files import storage
from mtcsirl.settings.runs import DemonstrationRunSettings
from mtcsirl.stages.running import Task, look_at, running
from mtcsirl.study.keys import identity
from mtcsirl.study.runs import Demonstrations

FILE = "demonstrations.parquet"
POLICY = ("policy.json", "policy.safetensors")


def collect_demonstrations(
    settings: DemonstrationRunSettings, run: Demonstrations, expert: Path, output: Path, *, wanted: str | None = None
) -> None:
    """Record episodes of the expert in the folder ``expert`` into the folder ``output``."""
    shown = run.expert
    check_agent(expert, shown.task, shown.target, shown.cs_reward)
    source = look_at(expert, POLICY)
    made_from = identity(run.stage, run.about, settings, {"expert": source.hash})
    files = {name: expert / name for name in POLICY}
    with running(Task(made_from, settings, output, {"expert": source.bytes}, files, wanted)) as stopwatch:
        if stopwatch is not None:
            policy, cs = load_policy(expert), shown.cs_reward
            frame = collect(policy, shown.task, shown.target, settings, seed=shown.seed, cs_reward=cs)
            storage.write_parquet(output / FILE, frame)
            verdict = gate_verdict("expert", demonstrated(frame), cs, settings.gates)
            storage.write_json(output / "gate.json", verdict)
