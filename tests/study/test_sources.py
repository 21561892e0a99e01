"""The modules that a rule lists as its input are those that its job runs."""

import subprocess
import sys
from pathlib import Path

import pytest

from mtcsirl.irl.methods import METHODS
from mtcsirl.study.design import ARTEFACTS
from mtcsirl.study.outputs import OUTPUTS
from mtcsirl.study.sources import GLUE, PACKAGE, ROOTS, sources


def imported(*files: str) -> set[str]:
    """The package's modules that Python has loaded after importing ``files``, as paths below the package."""
    names = [f"mtcsirl.{file.removesuffix('.py').replace('/', '.')}" for file in files]
    listing = "print(*(module.__file__ for name, module in sys.modules.items() if name.startswith('mtcsirl.')))"
    code = f"import sys, {', '.join(names)}; {listing}"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    return {str(Path(path).relative_to(PACKAGE)) for path in printed.split()}


@pytest.mark.parametrize("stage", ROOTS)
def test_what_a_stage_imports_is_among_its_sources(stage: str) -> None:
    glue = imported("design.py")  # settings look into the registries
    loaded = {path for path in imported(*ROOTS[stage]) - glue if not path.startswith(GLUE)}
    registries = sources(*(path for path in loaded if path.endswith("__init__.py")))  # loaded on the way, not called
    assert loaded <= {*sources(stage), *registries}


def test_every_stage_has_roots() -> None:
    assert set(OUTPUTS) <= set(ROOTS)


@pytest.mark.parametrize("method", METHODS)
def test_a_method_is_in_nobody_elses_sources(method: str) -> None:
    file = f"irl/methods/{method}.py"
    assert file in sources(file)
    for other in (*ROOTS, *(f"irl/methods/{name}.py" for name in METHODS if name != method)):
        assert file not in sources(other)


@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_an_artefact_is_in_nobody_elses_sources(artefact: str) -> None:
    def file(name: str) -> str:
        return f"{name.partition('_')[0]}s/{name}.py"

    for other in ARTEFACTS:
        assert (file(artefact) in sources(file(other))) == (other == artefact)


def test_training_knows_nothing_of_tables_and_figures() -> None:
    for stage in ("train_expert", "train_sac", "learn_reward", "transfer"):
        assert not [path for path in sources(stage) if path.startswith(("tables", "figures", "claims", "report"))]


def test_the_learner_decides_every_agent_and_no_table() -> None:
    for stage in ("train_expert", "train_sac", "learn_reward", "transfer"):
        assert "agents/sac.py" in sources(stage)
    assert "agents/sac.py" not in sources("tables/table_2.py")


def test_a_root_that_does_not_exist() -> None:
    with pytest.raises(ValueError, match=r"no such module: irl/methods/gail\.py"):
        sources("irl/methods/gail.py")
