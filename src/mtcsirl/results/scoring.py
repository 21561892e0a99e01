"""The stage ``score_reward``: a learned reward against the truth on named transition sets, with controls.

Every correlation says on which transitions it was taken: the same reward can correlate well where behaviour varies and
not at all on the expert's transitions, where there is nothing to explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import torch

from mtcsirl.episodes.demonstrations import VECTORS, as_transitions, collect_demonstrations, whole_episodes
from mtcsirl.episodes.evaluation import check_agent
from mtcsirl.episodes.policy import Policy, load_policy
from mtcsirl.errors import UserError
from mtcsirl.files.storage import read_parquet, write_csv, write_parquet
from mtcsirl.results.correlation import epic_distance, epic_values, nuisance, remove, views
from mtcsirl.results.statistics import Array, cluster_bootstrap
from mtcsirl.rewards.adapter import ground_truth
from mtcsirl.rewards.learned import LearnedReward, check_learned, load_learned_reward
from mtcsirl.rewards.networks import RewardNetwork
from mtcsirl.settings.runs import DemonstrationRunSettings, ScoreRunSettings
from mtcsirl.transitions import RewardFunction, Transitions
from mtcsirl.worlds.environments import ACTION_SIZE, EPISODE_STEPS

if TYPE_CHECKING:
    import pandas as pd

EPIC_TRANSITIONS = 256
KEY = ("experiment", "method", "cs_reward", "source", "task", "target", "seed")
SCORE_COLUMNS = (*KEY, "transitions", "reward", "statistic", "value", "low", "high", "n", "episodes")
POINT_VALUES = ("truth", "learned", "truth_rest", "learned_rest", "task_reward", "random")


class TransitionSet(NamedTuple):
    """Transitions [N] as the agent sees them, and the agent [N] and the episode [N] that each is of.

    Episodes are numbered through the set, whoever acted in them.
    """

    transitions: Transitions
    agent: np.ndarray
    episode: np.ndarray

    def part(self, rows: np.ndarray) -> TransitionSet:
        """The transitions that ``rows`` [N] of truth values or positions pick."""
        index = torch.from_numpy(np.flatnonzero(rows) if rows.dtype == bool else rows)
        fields = Transitions(*(field[index] for field in self.transitions))
        return TransitionSet(fields, self.agent[index.numpy()], self.episode[index.numpy()])


class _UniformActions:
    """Uniform random actions, as a policy."""

    observation = "raw"

    def act(self, observation: np.ndarray, generator: np.random.Generator | None = None) -> np.ndarray:
        """One action [4]."""
        assert generator is not None
        return generator.uniform(-1.0, 1.0, ACTION_SIZE).astype(np.float32)


def score(
    settings: ScoreRunSettings,
    reward: Path,
    experts: Sequence[Path],
    baselines: Sequence[Path],
    cs_reward: str,
    task: str,
    target: int,
    seed: int,
    output: Path,
) -> None:
    """Write ``scores.csv`` and ``points.parquet`` of the learned reward in the folder ``reward``.

    Sets: ``expert`` and ``sac``, as many stochastic whole episodes of each of the policies in the folders ``experts``
    and ``baselines`` on ``task`` and ``target``; ``uniform``, random actions there; ``generator``, the last rollouts of
    the IRL run on its own tasks; ``across``, equal parts of these four, so that what differs is the policy. Statistics:
    see :mod:`mtcsirl.results.correlation`; ``epic`` is a distance, and -r_task, which no function computes, counts
    there as its own canonical form. Intervals are cluster-bootstrap intervals over episodes; the controls have none.

    ``agent`` in the points: the policy's seed (expert, sac), the number of the (task, target) pair (generator), 0
    (uniform), a running number (across).

    Raises:
        UserError: a file is missing or damaged; the learned reward is of another cs-reward or observation; a policy is
            of another task, target or cs-reward, or was given twice.
    """
    import pandas as pd

    learned = load_learned_reward(reward)
    check_learned(learned, reward, cs_reward=cs_reward, observation=settings.environment.observation)
    truth = ground_truth(cs_reward, settings.environment.observation)
    functions: dict[str, RewardFunction] = {"learned": learned, **_controls(learned, truth, seed)}
    policies = {
        "expert": _policies(experts, task, target, cs_reward),
        "sac": _policies(baselines, task, target, ""),
        "uniform": {0: cast(Policy, _UniformActions())},
    }
    sets = dict(_acted(settings, policies, task, target, seed))
    sets["generator"] = _generators(reward, cs_reward, settings)
    rows: list[dict[str, Any]] = []
    points: list[pd.DataFrame] = []
    for name, chosen in (sets | {"across": together(list(sets.values()))}).items():
        for function in functions:
            rows += [
                {"transitions": name, "reward": function, **row}
                for row in score_rows(functions[function], truth, chosen, settings, seed, function == "learned")
            ]
        points.append(_points(name, chosen, functions, settings))
    origin = (learned.experiment, learned.method, cs_reward, learned.source)
    key: dict[str, Any] = dict(zip(KEY, (*origin, task, target, seed), strict=True))
    write_csv(output / "scores.csv", pd.DataFrame(rows).assign(**key)[list(SCORE_COLUMNS)])
    write_parquet(output / "points.parquet", pd.concat(points, ignore_index=True))


def score_rows(
    reward: RewardFunction,
    truth: RewardFunction,
    chosen: TransitionSet,
    settings: ScoreRunSettings,
    seed: int,
    intervals: bool = True,
) -> list[dict[str, Any]]:
    """One row per statistic of ``reward`` against ``truth`` on one transition set."""
    resamples = settings.score.bootstrap if intervals else 0
    generator = np.random.default_rng([seed, 1])
    transitions, episode = chosen.transitions, chosen.episode
    both = views(_numpy(reward, transitions), _numpy(truth, transitions), transitions, settings.discount)
    found = {name: both.estimate(name, episode, generator, resamples) for name in both.parts}
    pick = np.sort(generator.choice(len(episode), min(EPIC_TRANSITIONS, len(episode)), replace=False))
    part = chosen.part(pick).transitions
    shaped = [epic_values(r, part, settings.discount, np.random.default_rng([seed, 2])) for r in (reward, truth)]
    found["epic"] = cluster_bootstrap(
        lambda index: epic_distance(shaped[0][index], shaped[1][index]),
        [episode[pick]],
        generator,
        resamples=max(resamples, 1),
    )
    return [
        {
            "statistic": name,
            "value": estimate.value,
            "low": estimate.low if intervals else np.nan,
            "high": estimate.high if intervals else np.nan,
            "n": len(pick) if name == "epic" else len(episode),
            "episodes": estimate.n,
        }
        for name, estimate in found.items()
    ]


def _controls(learned: LearnedReward, truth: RewardFunction, seed: int) -> dict[str, RewardFunction]:
    """f = r_cs, 0, an untrained network and -r_task: what each statistic says when the answer is known."""
    untrained = RewardNetwork(learned.network.architecture, random=torch.Generator().manual_seed(seed))
    return {
        "truth": truth,
        "zero": lambda transitions: torch.zeros_like(transitions.task_reward),
        "random": untrained,
        "minus_task": lambda transitions: -transitions.task_reward,
    }


def _policies(folders: Sequence[Path], task: str, target: int, cs_reward: str) -> dict[int, Policy]:
    """The policy in each folder by its seed; those that do not say theirs are numbered in the order given."""
    policies: dict[int, Policy] = {}
    for number, folder in enumerate(folders):
        found = check_agent(folder, task, target, cs_reward)
        seed = number if found is None else found.seed
        if seed in policies:
            raise UserError(f"{folder}: a second policy of seed {seed}; give each once")
        policies[seed] = load_policy(folder)
    return policies


def _acted(
    settings: ScoreRunSettings, policies: dict[str, dict[int, Policy]], task: str, target: int, seed: int
) -> Iterator[tuple[str, TransitionSet]]:
    """Sets of at least ``score.transitions`` transitions in whole episodes, as many of each policy of a set."""
    steps = min(EPISODE_STEPS, settings.score.transitions)
    for stream, (name, members) in enumerate(policies.items()):
        episodes = -(-settings.score.transitions // (steps * len(members)))
        run = DemonstrationRunSettings(environment=settings.environment, episodes=episodes, episode_steps=steps)
        parts = []
        for agent, policy in members.items():
            # Policies act as for demonstrations, but each with random numbers of its own.
            own = whole_episodes(collect_demonstrations(policy, task, target, run, seed=[seed, 3, stream, agent]))
            transitions = as_transitions(own, settings.environment.observation)
            parts.append(TransitionSet(transitions, np.full(len(own), agent), own["episode"].to_numpy()))
        yield name, _joined(parts)


def _generators(reward: Path, cs_reward: str, settings: ScoreRunSettings) -> TransitionSet:
    file = reward / "samples.parquet"
    frame = read_parquet(file)
    needed = (*VECTORS, "task_reward", "task", "target", "episode", "step")
    missing = [name for name in needed if name not in frame]
    if missing or frame.empty:
        raise UserError(f"{file}: lacks {', '.join(missing) or 'rows'}; learn the reward again")
    if "cs_reward" in frame and set(frame["cs_reward"]) != {cs_reward}:
        raise UserError(f"{file}: of an IRL run of {frame['cs_reward'].iloc[0]}, not of {cs_reward}")
    try:
        return last_episodes(frame, settings.score.transitions, settings.environment.observation)
    except (ValueError, TypeError) as error:
        raise UserError(f"{file}: not readable as transitions ({error}); learn the reward again") from error


def last_episodes(frame: pd.DataFrame, count: int, observation: str) -> TransitionSet:
    """The last whole episodes of every task and target of ``samples.parquet``, about ``count`` transitions in all."""
    import pandas as pd

    sizes = frame.groupby(["task", "target", "episode"], sort=True).size()
    sizes = sizes[sizes == sizes.max()]
    per_member = max(1, count // int(sizes.iloc[0] * len(sizes.groupby(["task", "target"]))))
    kept = sizes.groupby(["task", "target"]).tail(per_member).index
    labels = kept.get_indexer(pd.MultiIndex.from_frame(frame[["task", "target", "episode"]]))
    member = frame.groupby(["task", "target"], sort=True).ngroup().to_numpy()
    own = labels >= 0
    return TransitionSet(as_transitions(frame[own], observation), member[own], labels[own])


def together(sets: Sequence[TransitionSet]) -> TransitionSet:
    """Equal parts of several sets in whole episodes, taken from their agents in turn."""
    count = min(len(one.episode) for one in sets)
    return _joined([_thinned(one, count) for one in sets], new_agents=True)


def _thinned(one: TransitionSet, count: int) -> TransitionSet:
    """About ``count`` transitions: the first episode of every agent, then the second of every one, and so on."""
    import pandas as pd

    episodes = pd.DataFrame({"agent": one.agent, "episode": one.episode})
    sizes = episodes.groupby(["agent", "episode"], sort=True).size().reset_index(name="steps")
    turn = sizes.groupby("agent").cumcount()
    in_turn = sizes.assign(turn=turn).sort_values(["turn", "agent"], kind="stable")["episode"]
    chosen = in_turn.to_numpy()[: max(1, count // int(sizes["steps"].max()))]
    return one.part(np.isin(one.episode, chosen))


def _joined(parts: Sequence[TransitionSet], *, new_agents: bool = False) -> TransitionSet:
    """One set of several; no episode, and with ``new_agents`` no agent, is in two of them."""
    transitions = Transitions(*(torch.cat(fields) for fields in zip(*(one.transitions for one in parts), strict=True)))
    agents = [one.agent for one in parts]
    return TransitionSet(
        transitions,
        _numbered(agents) if new_agents else np.concatenate(agents),
        _numbered([one.episode for one in parts]),
    )


def _numbered(labels: Sequence[np.ndarray]) -> np.ndarray:
    """Labels of several sets as running numbers that no two sets share."""
    numbers, first = [], 0
    for own in labels:
        numbers.append(np.unique(own, return_inverse=True)[1] + first)
        first = int(numbers[-1].max()) + 1
    return np.concatenate(numbers)


def _points(
    name: str, chosen: TransitionSet, functions: dict[str, RewardFunction], settings: ScoreRunSettings
) -> pd.DataFrame:
    """Evenly spaced transitions of a set; what is removed from the rests was fitted to the whole set."""
    import pandas as pd

    columns = nuisance(chosen.transitions, settings.discount)
    found = {which: _numpy(functions[which], chosen.transitions) for which in ("truth", "learned", "random")}
    found |= {f"{which}_rest": remove(found[which], columns) for which in ("truth", "learned")}
    found["task_reward"] = chosen.transitions.task_reward.double().numpy()
    values = {which: found[which].astype(np.float32) for which in POINT_VALUES}
    labels = {"agent": chosen.agent.astype(np.int32), "episode": chosen.episode.astype(np.int32)}
    spacing = -(-len(chosen.episode) // settings.score.points)
    return pd.DataFrame({"transitions": name, **labels, **values}).iloc[::spacing]


def _numpy(reward: RewardFunction, transitions: Transitions) -> Array:
    return reward(transitions).detach().double().numpy()
