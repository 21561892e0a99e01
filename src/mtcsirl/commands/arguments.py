"""Arguments that several verbs share, and how settings come from them."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from mtcsirl.commands.given import Once, settings_given
from mtcsirl.errors import UserError
from mtcsirl.files.given import as_given, check_given
from mtcsirl.files.storage import check_writable
from mtcsirl.names import HIGHEST_SEED, HIGHEST_TARGET_SEED, TARGETS_PER_TASK, TASKS
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import configured, load, overridden, validate
from mtcsirl.settings.machine import check_run
from mtcsirl.settings.unread import refuse, unread
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS
from mtcsirl.study.folders import check_folder, check_outside_runs

Model = TypeVar("Model", bound=BaseModel)
Verbs = Any
"""What ``add_subparsers`` returns; argparse has no public name for it."""


def add_verb(
    verbs: Verbs, name: str, run: Callable[[argparse.Namespace], None], *, does: str, needs: str, writes: str
) -> argparse.ArgumentParser:
    """Add a verb whose ``--help`` says what it does, needs and writes."""
    verb: argparse.ArgumentParser = verbs.add_parser(
        name,
        help=does,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description=f"{does[0].upper()}{does[1:]}.\n\nneeds:  {needs}\nwrites: {writes}",
    )
    verb.register("action", None, Once)  # what options do that name no action
    verb.set_defaults(run=run, verb=name, only_prints=writes == "nothing")
    return verb


def add_run_settings(verb: argparse.ArgumentParser) -> None:
    """``--settings``, ``--config``, ``--set`` of a verb that does one job."""
    verb.add_argument(
        "--settings", type=text, metavar="JSON|FILE", help="settings of this one run; default: from the configuration"
    )
    add_config(verb)
    verb.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="one settings key of this run, for example steps=1000 or sac.minibatch=64; may be repeated",
    )


def add_study_settings(verb: argparse.ArgumentParser) -> None:
    """``--settings``, ``--config``, ``--set`` of a verb that reads the whole study."""
    verb.add_argument(
        "--settings", type=text, metavar="JSON|FILE", help="the whole configuration; default: config/config.yaml"
    )
    add_config(verb)
    verb.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="one key; may be repeated")


def add_artefact(verb: argparse.ArgumentParser) -> None:
    """``--target`` of a verb that may look at one artefact alone."""
    verb.add_argument("--target", type=artefact, metavar="NAME", help="one artefact, for example figure_3")


def add_config(verb: argparse.ArgumentParser) -> None:
    """``--config`` and ``--scale``."""
    verb.add_argument("--scale", choices=("smoke", "desk", "paper"), help="overlay config/SCALE.yaml; default: desk")
    verb.add_argument(
        "--config",
        action="append",
        type=text,
        default=[],
        metavar="FILE",
        help="overlay on config/config.yaml; may be repeated",
    )


def add_agent(verb: argparse.ArgumentParser, *, cs_reward: bool = True) -> None:
    """``--task``, ``--target``, ``--cs-reward``, ``--seed``."""
    add_task(verb)
    if cs_reward:
        add_cs_reward(verb)
    verb.add_argument("--seed", required=True, type=seed, help="seed of every random number of the run")


def add_task(verb: argparse.ArgumentParser) -> None:
    """``--task`` and ``--target``."""
    verb.add_argument(
        "--task", required=True, type=task, metavar="TASK", help="Meta-World task without -v3: drawer-close"
    )
    verb.add_argument(
        "--target", type=target, default=0, metavar="INDEX", help=f"variation of the task, 0 ... {TARGETS_PER_TASK - 1}"
    )


def add_cs_reward(verb: argparse.ArgumentParser) -> None:
    """``--cs-reward``."""
    verb.add_argument("--cs-reward", required=True, type=cs_reward, metavar="NAME", help="velocity, action_norm, ...")


def add_device(verb: argparse.ArgumentParser) -> None:
    """``--device``: the settings key ``sac.device``, which is part of a run's identity."""
    verb.add_argument(
        "--device",
        dest="set",
        action="append",
        type=lambda name: f"sac.device={name}",
        default=[],
        metavar="NAME",
        help="cpu, cuda or cuda:INDEX: the same as --set sac.device=NAME",
    )


def add_workers(verb: argparse.ArgumentParser) -> None:
    """``--workers``."""
    verb.add_argument(
        "--workers", type=natural, default=0, metavar="N", help="processes that step the environments; default none"
    )


def add_output(verb: argparse.ArgumentParser, default: str | None = None) -> None:
    """``--output``."""
    verb.add_argument(
        "--output", required=default is None, default=default, type=new_folder, metavar="DIR", help="folder to write to"
    )


def add_identity(verb: argparse.ArgumentParser) -> None:
    """``--identity`` of a verb that a workflow calls."""
    verb.add_argument(
        "--identity",
        metavar="HASH",
        help="what a workflow planned for; a run that would be another is refused",
    )


def artefact(name: str) -> str:
    """An artefact or ablation of the design."""
    if name not in (*ARTEFACTS, *ABLATIONS):
        raise argparse.ArgumentTypeError(f"unknown artefact {name!r}; allowed: {', '.join((*ARTEFACTS, *ABLATIONS))}")
    return name


def task(name: str) -> str:
    """A known Meta-World task."""
    if name not in TASKS:
        raise argparse.ArgumentTypeError(f"unknown task {name!r}; allowed: {', '.join(TASKS)}")
    return name


def target(text: str) -> int:
    """The index of a target."""
    if not text.isdecimal() or int(text) >= TARGETS_PER_TASK:
        raise argparse.ArgumentTypeError(f"target {text!r}: must be 0 ... {TARGETS_PER_TASK - 1}")
    return int(text)


def new_folder(text: str) -> Path:
    """A folder that can be written, or made."""
    return _writable(text, folder=True)


def new_file(text: str) -> Path:
    """A file that can be written, in no run's folder."""
    file = _writable(text, folder=False)
    check_outside_runs(file)
    return file


def _writable(text: str, *, folder: bool) -> Path:
    place = path(text)
    check_writable(place, folder=folder)
    return place


def natural(text: str) -> int:
    """A whole number from 0."""
    return _whole(text, 0, None)


def positive(text: str) -> int:
    """A whole number from 1."""
    return _whole(text, 1, None)


def seed(text: str) -> int:
    """The seed of a run."""
    return _whole(text, 0, HIGHEST_SEED)


def target_seed(text: str) -> int:
    """The seed of Meta-World's targets."""
    return _whole(text, 0, HIGHEST_TARGET_SEED)


def _whole(text: str, least: int, most: int | None) -> int:
    if not text.isdecimal() or len(text) > 19 or int(text) < least or (most is not None and int(text) > most):
        upper = "" if most is None else f" to {most}"
        raise argparse.ArgumentTypeError(f"{text[:40]!r}: must be a whole number from {least}{upper}")
    return int(text)


def text(given: str) -> str:
    """Something: an empty text, as an unset variable of a shell leaves it, stands for no default."""
    if not given.strip():
        raise argparse.ArgumentTypeError("must not be empty; leave the option out for its default")
    return given


@contextmanager
def refusing() -> Iterator[None]:
    """Print, where the block fails, a target that snakemake refuses: of none at all it would make the whole study."""
    try:
        yield
    except UserError:
        print("no-such-run")
        raise


def path(given: str) -> Path:
    """A path that is not empty: that would be the working folder."""
    return Path(text(given))


def cs_reward(name: str) -> str:
    """A registered common-sense reward."""
    from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS

    return _registered(name, COMMON_SENSE_REWARDS, "common-sense reward")


def method(name: str) -> str:
    """A registered IRL method."""
    from mtcsirl.extensions import METHODS

    return _registered(name, METHODS, "method")


def _registered(name: str, registry: Any, what: str) -> str:
    if name not in registry:
        raise argparse.ArgumentTypeError(f"unknown {what} {name!r}; allowed: {', '.join(registry)}")
    return name


def run_settings(
    parsed: argparse.Namespace, model: type[Model], from_study: Callable[[Settings], Model], stage: str = ""
) -> Model:
    """The settings of one run: ``--settings``, else what the configuration says; then ``--set``.

    With ``stage`` the run itself is looked at before it starts: that it reads every key that was set, that this machine
    can do it, that ``--output`` holds nothing else.
    """
    if parsed.settings:
        given = settings_given(parsed)
    else:
        given = "configuration", from_study(load(parsed.config, scale=parsed.scale)).model_dump(mode="json")
    data, sources = overridden([given], parsed.set)
    settings = validate(model, data, sources)
    if stage:
        key = {name: getattr(parsed, name, "") for name in ("cs_reward", "method")}
        refuse(settings, unread(stage, **key), key["method"] or stage.replace("_", "-"), sources)
        check_folder(parsed.output, stage)
        check_run(settings, len(getattr(parsed, "demonstrations", ())))
    return settings


@contextmanager
def demonstrations_given(file: Path) -> Iterator[None]:
    """A block that reads ``file``, which a user named and a stage should have written."""
    if file.exists():  # else the reader knows whether an archive has left it out
        check_given(file)
    with as_given("name the file demonstrations.parquet that collect-demonstrations wrote"):
        yield


def check_experiment(asked: str | None, found: str, members: Sequence[tuple[str, int]]) -> None:
    """Raise UserError where the experiment ``asked`` for is not what the tasks and targets of the run make it."""
    if asked not in (None, found):
        names = ", ".join(f"{task}-t{target}" for task, target in members)
        raise UserError(f"--experiment {asked}: the demonstrations are of {names}, which is {found}")


def study_settings(parsed: argparse.Namespace) -> Settings:
    """The whole configuration: ``--settings``, else ``config/config.yaml`` with its overlays; then ``--set``."""
    if parsed.settings:
        return configured(*overridden([settings_given(parsed)], parsed.set))
    return load(parsed.config, parsed.set, parsed.scale)
