"""Several environments stepped together, in this process or spread over worker processes."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from typing import Any, NamedTuple, Protocol

import numpy as np

from mtcsirl.errors import UserError
from mtcsirl.settings import EnvironmentSettings
from mtcsirl.worlds.environments import ACTION_SIZE, OBSERVATION_SIZE, make_environment

TaskTarget = tuple[str, int]


class Outcome(NamedTuple):
    """One step of A environments: next observation [A, 39], task reward [A], success [A], diverged [A].

    A simulation that diverged in this step has started over: its next observation is the first of a new episode, its
    reward is 0 and it has no success, for what the step led to means nothing.
    """

    next_observation: np.ndarray
    task_reward: np.ndarray
    success: np.ndarray
    diverged: np.ndarray


class Environments(Protocol):
    """A environments that reset and step together."""

    def reset(self) -> np.ndarray:
        """First observations [A, 39]."""

    def step(self, action: np.ndarray) -> Outcome:
        """Apply actions [A, 4]."""

    def close(self) -> None:
        """Free them."""


class TaskEnvironments(Environments, Protocol):
    """Environments of Meta-World tasks, in which whole episodes can be run too."""

    def each(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...] | None]) -> list[Any]:
        """Call `function(*own, reuse=environment)` for each environment, None for those without arguments.

        `function` runs in the process of the environment: a function of a module, such as `evaluate`.
        """


def make_environments(tasks: Sequence[TaskTarget], settings: EnvironmentSettings, workers: int = 0) -> TaskEnvironments:
    """Environments of these (task, target) pairs, in this process or in `workers` others (spawned)."""
    if workers > 0:
        return WorkerEnvironments(tasks, settings, min(workers, len(tasks)))
    return LocalEnvironments(tasks, settings)


class LocalEnvironments:
    """Environments in this process."""

    def __init__(self, tasks: Sequence[TaskTarget], settings: EnvironmentSettings) -> None:
        self.environments = [
            make_environment(task, target, observation=settings.observation, target_seed=settings.target_seed)
            for task, target in tasks
        ]

    def reset(self) -> np.ndarray:
        """First observations [A, 39]."""
        return np.stack([environment.reset()[0] for environment in self.environments])

    def step(self, action: np.ndarray) -> Outcome:
        """Apply actions [A, 4]."""
        pairs = zip(self.environments, action, strict=True)
        observation, reward, _, _, info = zip(*(environment.step(row) for environment, row in pairs), strict=True)
        outcome = Outcome(
            np.stack(observation),
            np.array(reward, dtype=np.float32),
            np.array([one["success"] for one in info]),
            np.array([one["diverged"] for one in info]),
        )
        for index in np.flatnonzero(outcome.diverged):
            outcome.next_observation[index] = self.environments[index].reset()[0]
            outcome.task_reward[index], outcome.success[index] = 0.0, False
        return outcome

    def each(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...] | None]) -> list[Any]:
        """What `function` returns for each environment."""
        pairs = zip(self.environments, arguments, strict=True)
        return [None if own is None else function(*own, reuse=environment) for environment, own in pairs]

    def close(self) -> None:
        """Free them."""
        for environment in self.environments:
            environment.close()


_FIELDS = (OBSERVATION_SIZE, 1, 1, 1, ACTION_SIZE)
"""Columns of the shared table: observation, task reward, success, diverged, action; one row per agent."""


class WorkerEnvironments:
    """Environments in spawned processes that read actions from, and write outcomes to, one shared table."""

    def __init__(self, tasks: Sequence[TaskTarget], settings: EnvironmentSettings, workers: int) -> None:
        self._memory = SharedMemory(create=True, size=4 * len(tasks) * sum(_FIELDS))
        self._columns = _columns(self._memory, len(tasks))
        context = multiprocessing.get_context("spawn")
        self._pipes: list[Connection] = []
        self._rows: list[list[int]] = []
        for worker in range(workers):
            ours, theirs = context.Pipe()
            rows = list(range(worker, len(tasks), workers))
            arguments = (theirs, self._memory.name, list(tasks), rows, settings)
            context.Process(target=_serve, args=arguments, daemon=True).start()
            theirs.close()
            self._pipes.append(ours)
            self._rows.append(rows)
        self._wait()

    def reset(self) -> np.ndarray:
        """First observations [A, 39]."""
        self._command(b"reset")
        return self._columns[0].copy()

    def step(self, action: np.ndarray) -> Outcome:
        """Apply actions [A, 4]."""
        self._columns[4][:] = action
        self._command(b"step")
        observation, reward, success, diverged, _ = self._columns
        return Outcome(observation.copy(), reward[:, 0].copy(), success[:, 0] > 0, diverged[:, 0] > 0)

    def each(self, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...] | None]) -> list[Any]:
        """What `function` returns for each environment."""
        for pipe, rows in zip(self._pipes, self._rows, strict=True):
            pipe.send_bytes(b"each")
            pipe.send((function, [arguments[row] for row in rows]))
        self._wait()
        found: dict[int, Any] = {}
        for pipe, rows in zip(self._pipes, self._rows, strict=True):
            found |= dict(zip(rows, pipe.recv(), strict=True))
        return [found[row] for row in range(len(arguments))]

    def close(self) -> None:
        """End the workers and free the table."""
        for pipe in self._pipes:
            with suppress(OSError):
                pipe.send_bytes(b"close")
            pipe.close()
        self._columns = []
        self._memory.close()
        self._memory.unlink()

    def _command(self, word: bytes) -> None:
        for pipe in self._pipes:
            pipe.send_bytes(word)
        self._wait()

    def _wait(self) -> None:
        for pipe in self._pipes:
            answer = pipe.recv_bytes().decode()
            kind, _, text = answer.partition(": ")
            if kind == UserError.__name__:
                raise UserError(text)
            if answer != "done":
                raise RuntimeError(f"an environment worker failed: {answer}")


def _columns(memory: SharedMemory, agents: int) -> list[np.ndarray]:
    table = np.ndarray((agents, sum(_FIELDS)), dtype=np.float32, buffer=memory.buf)
    return np.split(table, np.cumsum(_FIELDS)[:-1], axis=1)


def _serve(
    pipe: Connection, name: str, tasks: list[TaskTarget], rows: list[int], settings: EnvironmentSettings
) -> None:
    """Run the environments of some rows of the shared table until told to close."""
    import torch

    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; when to end is the trainer's to say
    memory = SharedMemory(name=name)
    columns = _columns(memory, len(tasks))
    try:
        environments = LocalEnvironments([tasks[row] for row in rows], settings)
        pipe.send_bytes(b"done")
        while (word := pipe.recv_bytes()) != b"close":
            answer = None
            if word == b"reset":
                columns[0][rows] = environments.reset()
            elif word == b"each":
                answer = environments.each(*pipe.recv())
            else:
                outcome = environments.step(columns[4][rows])
                columns[0][rows] = outcome.next_observation
                for column, values in zip(columns[1:4], outcome[1:], strict=True):
                    column[rows, 0] = values
            pipe.send_bytes(b"done")
            if answer is not None:
                pipe.send(answer)
    except EOFError:
        pass
    except Exception as error:
        pipe.send_bytes(f"{type(error).__name__}: {error}".encode())
    finally:
        del columns
        memory.close()
