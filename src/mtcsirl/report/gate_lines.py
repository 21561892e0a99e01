"""The gates of all agents, counted by kind of agent, task and cs-reward."""

from collections.abc import Iterable, Mapping

from mtcsirl.report.content import GateLine
from mtcsirl.report.runs_there import Gate, Told
from mtcsirl.study.runs import AnyRun

AGENT_NAMES = {
    "train_expert": "expert",
    "train_sac": "SAC",
    "collect_demonstrations": "demonstrations",
    "learn_reward": "generator",
    "transfer": "transfer agent",
}


def gate_lines(told: Mapping[AnyRun, Told]) -> tuple[GateLine, ...]:
    """One line per kind of agent, task and cs-reward; an IRL run has one gate per generator."""
    groups: dict[tuple[str, str, str], list[tuple[str, Gate]]] = {}
    for run, said in told.items():
        for gate in said.gates:
            key = (_agent_name(run), gate.task, _cs_reward(run))
            groups.setdefault(key, []).append((run.folder, gate))
    return tuple(_gate_line(key, found) for key, found in groups.items())


def _agent_name(run: AnyRun) -> str:
    """As in ``transfer agent, multi_task, mt_csirl``."""
    irl = getattr(run, "irl", run)
    parts = [AGENT_NAMES[run.stage], *(getattr(irl, name, "") for name in ("experiment", "method"))]
    return ", ".join(part.replace("_", " ") for part in parts if part)


def _cs_reward(run: AnyRun) -> str:
    return str(getattr(getattr(run, "irl", run), "cs_reward", ""))


def _gate_line(key: tuple[str, str, str], found: list[tuple[str, Gate]]) -> GateLine:
    gates = [gate for _, gate in found]
    return GateLine(
        *key,
        passed=sum(gate.passed for gate in gates),
        agents=len(gates),
        success=_mean(gate.success for gate in gates),
        metric=_mean(gate.metric for gate in gates),
        folders=tuple(dict.fromkeys(folder for folder, _ in found)),
    )


def _mean(values: Iterable[float | None]) -> float | None:
    """Of those that are numbers."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
