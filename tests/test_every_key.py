"""No key does nothing: every key of every kind of run changes what the run leaves, or is refused."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from mtcsirl import cli
from mtcsirl.commands import arguments
from mtcsirl.names import METHODS
from mtcsirl.settings.runs import AgentRunSettings, DemonstrationRunSettings, IrlRunSettings, ScoreRunSettings
from mtcsirl.settings.template import keys
from mtcsirl.settings.unread import sliced, unread
from tests.words import learn_reward

# whatever is run here hundreds of times has tests of its own: without coverage, a third of the time
pytestmark = [pytest.mark.slow, pytest.mark.no_cover]

NEUTRAL = {
    "progress.checkpoint_every": "how often a run can resume, not what it computes",
    "progress.tensorboard": "writes files beside the results",
    "sac.device": "where it is computed; there may be no other device",
}
"""Keys that may leave a run as it is, and why."""
REFUSED = {"environment.observation", "sac.learner"}
"""Keys of which another value contradicts something else: what the inputs were made with, three learning rates."""
RESULTS = ("*.safetensors", "policies/*.safetensors", "evaluation.csv", "gate.json", "*.parquet", "scores.csv")
CURVE = "curve.csv"
"""Of an agent, whose kept policy may be an early one; that of an IRL run prints settings."""

SAC = {"hidden_sizes": [8, 8], "minibatch": 8, "updates_per_step": 0.1, "random_steps": 10}
EVALUATION = {"episodes": 1, "episode_steps": 60}
AGENT: dict[str, Any] = {
    "sac": SAC,
    "steps": 180,
    "scripted_steps": 50,
    "scripted_noise": 0.1,
    "held_share": 0.5,
    "held_steps": 4,
    "held_until": 0.8,
    "evaluation": EVALUATION,
    "progress": {"select_every": 60, "select_episodes": 1, "select_training_episodes": 1},
}
EXPERT = AGENT | {
    "cs_weight": 2.0,
    "curriculum": True,
    "warm_up_success": 0.5,
    "warm_up_episodes": 1,
    "warm_up_steps": 180,
}
TRANSFER = {name: value for name, value in EXPERT.items() if name != "progress"}
IRL = {
    "sac": SAC | {"temperature": 0.1, "reward_scale": 0.05, "updates_per_step": 0.5},
    "irl": {
        "iterations": 3,
        "warm_up_iterations": 1,
        "steps_per_iteration": 24,
        "curriculum_window": 20,
        "generator_replay": 2,
        "generator_updates": 4,
        "discriminator_updates": 3,
        "discriminator": {
            "hidden_sizes": [8, 8],
            "bottleneck_hidden_sizes": [8],
            "bottleneck_size": 4,
            "minibatch": 16,
        },
    },
    "scripted_steps": {"reach": 24},
    "scripted_noise": 0.3,
    "demonstration_episodes": 2,
    "evaluation": EVALUATION | {"episode_steps": 12},
}
COLLECT = {"episodes": 2, "episode_steps": 24}
SCORE = {"score": {"transitions": 40, "bootstrap": 5, "points": 10}}

OTHERS: dict[str, Any] = {
    "environment.observation": "raw",
    "environment.target_seed": 1,
    "sac.hidden_sizes": [8, 4],
    "sac.min_log_std": 0.5,
    "sac.max_log_std": -3.0,
    "sac.learner": "stable_baselines3",
    "sac.temperature": 0.7,
    "sac.target_entropy": -1.0,
    "sac.minibatch": 4,
    "sac.discount": 0.5,
    "sac.polyak": 0.5,
    "discount": 0.5,
    "irl.schedule": "as_printed",
    "irl.curriculum_maximum": "task",
    "irl.logit_temperature": "as_printed",
    "irl.logit_density": "as_printed",
    "irl.warm_up_temperature": "as_in_irl",
    "irl.generator_memory": 30,
    "irl.generator_replay": 1,
    "irl.discriminator.hidden_sizes": [4],
    "irl.discriminator.bottleneck_hidden_sizes": [4],
    "irl.discriminator.log_pi_clamp": 0.5,
    "irl.discriminator.beta_step": 1.0,
    "scripted_steps": {"reach": 12},
    "gates.success": 0.0,
    "evaluation.episode_steps": 11,
    "episode_steps": 23,
    "demonstration_episodes": 1,
    "warm_up_episodes": 2,
    "warm_up_success": 0.0,
    "held_until": 0.4,
    "curriculum_maximum": 5.0,
    "warm_up_steps": 60,
}
"""Another value of a key; the rest is halved or turned round."""
SEVERAL = {"progress.select_training_episodes": (0, 3, 5, 9)}
"""Values of which one at least has to tell: which policy is the best of a few may be the same for some of them."""
_TRIALS = {"scripted_steps": 0, "evaluation.episode_steps": 15, "progress.select_every": 30}
WITH: dict[str, dict[str, Any]] = {
    "warm_up_steps": {"warm_up_success": 1.0, "warm_up_episodes": 99},
    "progress.select_every": _TRIALS,
    "progress.select_episodes": _TRIALS,
    "progress.select_training_episodes": _TRIALS
    | {"progress.select_every": 15, "steps": 300, "held_share": 1.0, "held_until": 1.0},
    "irl.curriculum_window": {"irl.unknown_task_curriculum": True},
    "irl.curriculum_maximum": {"irl.unknown_task_curriculum": True},
    "irl.curriculum": {"irl.unknown_task_curriculum": True},
}
"""What else has to be set, on both sides and where it is not ignored, for a key to count."""


def other(key: str, value: Any) -> Any:
    """A value of ``key`` that is not ``value``."""
    if key in OTHERS and OTHERS[key] != value and isinstance(OTHERS[key], dict) == isinstance(value, dict):
        return OTHERS[key]
    if isinstance(value, bool):
        return not value
    return max(1, value // 2) if isinstance(value, int) and value != 1 else value * 2 if value else 0.5


MODELS: dict[str, type[Any]] = {
    **dict.fromkeys(("train_sac", "train_expert", "transfer"), AgentRunSettings),
    "collect_demonstrations": DemonstrationRunSettings,
    "learn_reward": IrlRunSettings,
    "score_reward": ScoreRunSettings,
}


class Kind:
    """One kind of run: its verb, its settings and the folder in which its runs lie."""

    def __init__(self, stage: str, base: Mapping[str, Any], folder: Path, *words: str, method: str = "") -> None:
        self.ignored = unread(stage, cs_reward="velocity", method=method)
        self.base = sliced(MODELS[stage].model_validate(base), self.ignored)
        self.folder, self.words = folder, (stage.replace("_", "-"), *words)
        self.runs: dict[str, dict[str, bytes] | None] = {}

    def run(self, **changes: Any) -> dict[str, bytes] | None:
        """The bytes that a run with ``changes`` (dotted keys) leaves; None where they are refused."""
        sets = [word for key, value in changes.items() for word in ("--set", f"{key}={json.dumps(value)}")]
        name = json.dumps(changes)
        if name not in self.runs:
            output = self.folder / str(len(self.runs))
            words = [*self.words, "--settings", self.base.model_dump_json(), *sets, "--output", str(output)]
            code = cli.main(words)
            assert code in (0, 2)
            names = (*RESULTS, *[CURVE][: "irl" not in type(self.base).model_fields])
            found = sorted(file for pattern in names for file in output.glob(pattern))
            self.runs[name] = None if code else {str(f.relative_to(output)): f.read_bytes() for f in found}
        return self.runs[name]

    def changed(self, key: str, value: Any) -> bool:
        """Whether a run with another value of ``key`` leaves something else."""
        needed = {} if key in self.ignored else WITH.get(key, {})
        extra = {name: one for name, one in needed.items() if name not in self.ignored}
        base = self.run(**extra)
        assert base, f"{self.words}: the base run is refused"
        values = SEVERAL.get(key, (other(key, extra.get(key, value)),))
        return any(self.run(**{**extra, key: one}) not in (base, None) for one in values)


def check(kind: Kind, only: str = "") -> None:
    """Every key of ``kind`` that begins with ``only``: ignored keys are refused, the others change the run."""
    dead = []
    for key, _, value in keys(kind.base):
        if key not in NEUTRAL and key not in kind.ignored and key.startswith(only) and not kind.changed(key, value):
            dead.append(key)
    assert set(dead) <= REFUSED, f"{kind.words[0]}: these keys do nothing: {', '.join(dead)}"
    assert all(kind.run(**{key: OTHERS[key]}) is None for key in dead)
    known = {key: value for key, _, value in keys(kind.base)}
    for key in kind.ignored:
        assert kind.run(**{key: other(key, known[key])}) is None, f"{key} is not read and not refused"


def check_ignored(kind: Kind, monkeypatch: pytest.MonkeyPatch, only: str = "") -> None:
    """The list of keys that are not read holds none that is."""
    monkeypatch.setattr(arguments, "refuse", lambda *_: None)
    kind.runs.clear()
    kind.folder = kind.folder / "unrefused"
    known = {key: value for key, _, value in keys(kind.base)}
    read = [key for key in kind.ignored if key.startswith(only) and kind.changed(key, known[key])]
    assert not read, f"{kind.words[0]}: these keys are read after all"


KEY = ("--task", "reach", "--target", "1", "--seed", "0")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An expert, a baseline, demonstrations of two tasks and a learned reward, all of them tiny."""
    folder = tmp_path_factory.mktemp("made")

    def make(base: Mapping[str, Any], output: str, *words: str) -> None:
        assert cli.main([*words, "--settings", json.dumps(base), "--output", str(folder / output)]) == 0

    for task in ("reach", "drawer-close"):
        key = ("--task", task, *KEY[2:])
        cs = ("--cs-reward", "velocity")
        make(EXPERT | {"steps": 60, "scripted_steps": 0}, f"{task}/expert", "train-expert", *key, *cs)
        expert = ("--expert", str(folder / task / "expert"))
        make(COLLECT | {"episode_steps": 24}, f"{task}/shown", "collect-demonstrations", *expert, *key, *cs)
    make(AGENT | {"steps": 60}, "sac", "train-sac", *KEY)
    irl = sliced(IrlRunSettings.model_validate(IRL), unread("learn_reward", method="mt_csirl"))
    make(irl.model_dump(mode="json"), "irl", *learn_reward(folder / "reach/shown/demonstrations.parquet"))
    return folder


def _kind(name: str, made: Path, folder: Path) -> Kind:
    cs = ("--cs-reward", "velocity")
    if name == "train_sac":
        return Kind(name, AGENT, folder, *KEY)
    if name == "train_expert":
        return Kind(name, EXPERT, folder, *KEY, *cs)
    if name == "transfer":
        return Kind(name, TRANSFER, folder, *KEY, *cs, "--reward", str(made / "irl"))
    if name == "collect_demonstrations":
        expert = str(made / "reach/expert")
        return Kind(name, COLLECT, folder, *KEY, *cs, "--expert", expert)
    places = ("--reward", str(made / "irl"), "--expert", str(made / "reach/expert"), "--baseline", str(made / "sac"))
    return Kind(name, SCORE, folder, *KEY, *cs, *places)


@pytest.mark.parametrize("stage", ["train_sac", "train_expert", "transfer", "collect_demonstrations", "score_reward"])
def test_every_key_of_a_run_counts_or_is_refused(
    stage: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = _kind(stage, made, tmp_path)
    check(kind)
    check_ignored(kind, monkeypatch)


@pytest.mark.parametrize("method", METHODS)
def test_every_key_of_an_irl_run_counts_or_is_refused(
    method: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What methods share is tried with MT-CSIRL; with the others, what an IRL has of its own."""
    files = [made / task / "shown/demonstrations.parquet" for task in ("reach", "drawer-close")]
    _, *words = learn_reward(*files, method=method)
    only = "" if method == "mt_csirl" else "irl."
    kind = Kind("learn_reward", IRL, tmp_path, *words, method=method)
    check(kind, only)
    check_ignored(kind, monkeypatch, only)
