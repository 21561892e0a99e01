"""The configuration: one source, all mistakes in one line, the paper's scale is the paper's."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import BaseModel, ValidationError

from mtcsirl.errors import UserError
from mtcsirl.extensions import METHODS
from mtcsirl.names import EXPERIMENTS
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from mtcsirl.settings import Settings, granted
from mtcsirl.settings.loading import load, merge, override, read_yaml, validate
from mtcsirl.settings.runs import (
    IrlRunSettings,
    baseline_run,
    demonstration_run,
    expert_run,
    irl_run,
    score_run,
    transfer_run,
)
from mtcsirl.settings.template import as_json, deviations, keys, schema, template


def test_config_yaml_is_written_from_the_classes(checkout: Path) -> None:
    assert (checkout / "config/config.yaml").read_text() == template()


def test_template_loads_to_the_settings_it_was_made_of() -> None:
    for scale in ("smoke", "desk", "paper"):
        settings = load(scale=scale)
        assert validate(Settings, yaml.safe_load(template(settings))) == settings


def test_every_key_has_a_comment_with_unit_and_paper_value() -> None:
    lines = template().splitlines()
    for name, field, _ in keys(Settings()):
        assert field.description, name
        last = name.rpartition(".")[2]
        assert any(line.strip().startswith(f"{last}:") for line in lines)
    text = template()
    assert "# transitions per gradient step [transitions]; paper: 500\n  minibatch: 64" in text


def test_paper_scale_is_the_paper() -> None:
    assert deviations(load(scale="paper")) == []


def test_paper_scale_has_the_published_numbers(checkout: Path) -> None:
    published = read_yaml(checkout / "src/mtcsirl/results/published.yaml")
    paper, table, irl = load(scale="paper"), published["table_5"], published["irl_settings"]
    assert paper.sac.minibatch == table["batch_size"]
    assert paper.baseline.steps["default"] == table["epochs"] * table["gradient_steps_per_epoch"]
    assert paper.sac.updates_per_step == 1.0
    assert paper.evaluation.episode_steps == table["path_length"]
    assert paper.sac.discount == table["discount"]
    assert list(paper.sac.hidden_sizes) == table["hidden_sizes"]
    assert paper.sac.policy_learning_rate == table["policy_lr"]
    assert paper.sac.critic_learning_rate == table["q_lr"]
    assert (paper.sac.min_log_std, paper.sac.max_log_std) == (table["min_log_std"], table["max_log_std"])
    assert paper.sac.polyak == table["tau"]
    assert paper.expert.temperature == paper.baseline.temperature == "automatic"
    assert paper.irl.curriculum_window == irl["curriculum"]["window"]
    assert len(paper.seeds) == irl["single_target"]["seeds"]
    assert list(paper.multi_task.train_tasks) == irl["multi_task"]["train_tasks"]
    assert len(paper.multi_task.train_tasks) * len(paper.multi_task.train_targets) == irl["multi_task"]["T"]
    for experiment, episodes in paper.demonstrations.episodes.items():
        assert episodes * 500 == irl[experiment]["demos_per_task"]


def test_deviations_name_key_both_values_and_reason() -> None:
    found = {deviation.key: deviation for deviation in deviations(Settings())}
    assert found["sac.minibatch"].ours == 64
    assert found["sac.minibatch"].paper == 500
    assert str(found["sac.minibatch"]) == ("sac.minibatch = 64 transitions (paper: 500): transitions per gradient step")
    assert "sac.min_log_std" not in found, "equal to the paper's"
    assert "progress.select_every" not in found, "the paper is silent"


def test_smoke_is_small_in_every_budget() -> None:
    settings = load(scale="smoke")
    for budget in (settings.expert.steps, settings.baseline.steps, settings.transfer.steps):
        assert max(budget.values()) <= 1000
    assert settings.methods == Settings().methods, "smoke runs every method"
    assert settings.cs_rewards == Settings().cs_rewards
    assert settings.single_target.tasks == Settings().single_target.tasks, "smoke draws every figure"


def test_scales_do_not_share_folders() -> None:
    scales = [load(scale=scale) for scale in ("smoke", "desk", "paper")]
    assert len({scale.results for scale in scales}) == len({scale.figures for scale in scales}) == 3


BAD: list[tuple[dict[str, Any], str]] = [
    ({"sac": {"minibach": 3}}, "sac.minibach = 3: unknown key, did you mean minibatch?; allowed: hidden_sizes, "),
    ({"zzz": 1}, "zzz = 1: unknown key; allowed: scale, results, "),
    ({"sac": {"minibatch": "many"}}, "sac.minibatch = 'many': must be a valid integer"),
    ({"sac": {"minibatch": 2.5}}, "sac.minibatch = 2.5: must be a valid integer"),
    ({"sac": {"minibatch": True}}, "sac.minibatch = True: must be a int"),
    ({"sac": {"minibatch": -3}}, "sac.minibatch = -3: must be greater than 0"),
    ({"sac": {"policy_learning_rate": float("nan")}}, "sac.policy_learning_rate = nan: must be a finite number"),
    ({"sac": 3}, "sac = 3: must be a mapping of keys to values"),
    ({"expert": {"steps": {"default": -5}}}, "expert.steps.default = -5: must be greater than 0"),
    ({"expert": {"steps": {"reach": 5}}}, "expert.steps: needs the key 'default'"),
    ({"expert": {"steps": {"default": 5, "fly": 5}}}, "expert.steps: unknown task 'fly'; allowed: Meta-World's names"),
    ({"expert": {"temperature": "auto"}}, "expert.temperature = 'auto': must be 'automatic' or must be a valid number"),
    ({"expert": {"cs_weight": {"speed": 1.0}}}, "expert.cs_weight"),
    ({"single_target": {"tasks": ["fly"]}}, "single_target.tasks.0 = 'fly': unknown task 'fly'; allowed: Meta-World"),
    ({"single_target": {"tasks": []}}, "single_target.tasks = []: must not be empty"),
    ({"multi_target": {"train_targets": [50]}}, "multi_target.train_targets.0 = 50: must be less than 50"),
    ({"multi_task": {"unseen_tasks": ["reach"]}}, "multi_task: unseen_tasks also in train_tasks: reach"),
    (
        {"multi_task": {"train_tasks": ["reach"]}},
        "multi_task: train_tasks holds reach alone, as single_target can; name two or more",
    ),
    ({"sac": {"updates_per_step": 1e300}}, "sac.updates_per_step = 1e+300: must be less than or equal to 1000"),
    ({"sac": {"updates_per_step": float("inf")}}, "sac.updates_per_step = inf: must be a finite number"),
    ({"seeds": [0, 0]}, "seeds = [0, 0]: lists an entry twice"),
    ({"seeds": []}, "seeds = []: must not be empty"),
    ({"methods": ["gail"]}, "unknown method 'gail'; allowed: mt_airl, "),
    ({"methods": "mt_airl"}, "methods = 'mt_airl': must be a list"),
    ({"cs_rewards": ["speed"]}, "unknown common-sense reward 'speed'; allowed: velocity, action_norm"),
    ({"scale": "big"}, "scale = 'big': must be 'smoke', 'desk' or 'paper'"),
    ({"sac": {"device": "gpu"}}, "sac.device = 'gpu': must be cpu, cuda or cuda:INDEX"),
    ({"sac": {"device": "cuda:-1"}}, "sac.device = 'cuda:-1': must be cpu, cuda or cuda:INDEX"),
    ({"sac": {"hidden_sizes": [0]}}, "sac.hidden_sizes.0 = 0: must be greater than 0"),
    ({"sac": {"hidden_sizes": []}}, "sac.hidden_sizes = []: must not be empty"),
    (
        {"irl": {"discriminator": {"hidden_sizes": [8, 0]}}},
        "irl.discriminator.hidden_sizes.1 = 0: must be greater than 0",
    ),
    ({"irl": {"discriminator": {"bottleneck_hidden_sizes": [0]}}}, "bottleneck_hidden_sizes.0 = 0: must be greater"),
    ({"sac": {"min_log_std": 3}}, "sac: min_log_std = 3 must be below max_log_std = 2"),
    ({"sac": {"min_log_std": 2, "max_log_std": 2}}, "sac: min_log_std = 2 must be below max_log_std = 2"),
    (
        {"environment": {"target_seed": 4294967296}},
        "environment.target_seed = 4294967296: must be less than or equal to 4294967295",
    ),
    ({"seeds": [12345678901234567890123]}, "seeds.0 = 12345678901234567890123: must be less than or equal to"),
    ({"irl_seeds": [2**53]}, "irl_seeds.0 = 9007199254740992: must be less than or equal to 9007199254740991"),
    ({"multi_target": {"train_targets": [0, 1]}}, "multi_target: train_targets holds 0, the new target"),
    ({"multi_target": {"train_targets": [0]}}, "multi_target: train_targets holds 0, the new target"),
    ({"results": ""}, "results = '': must not be empty"),
    ({"results": " "}, "results = ' ': must not be empty"),
    ({"results": "~/study"}, "results = '~/study': ~ and variables are not expanded here; write "),
    ({"results": "$HOME/s"}, "results = '$HOME/s': ~ and variables are not expanded here; write "),
    ({"figures": "${HOME}/s"}, "figures = '${HOME}/s': ~ and variables are not expanded here"),
    ({"results": "a{x}"}, "results = 'a{x}': must not hold the character '{'"),
    ({"figures": "a<results>"}, "figures = 'a<results>': must not hold the character '<'"),
    ({"results": "-x"}, "results = '-x': would be taken for an option"),
    ({"results": "./-x"}, "results = './-x': would be taken for an option"),
    ({"results": "a\nb"}, "must not hold the character '\\n'"),
]


@pytest.mark.parametrize("path", ["~/mine.py", "$HOME/mine.py", "a{x}.py", "a:b.py"])
def test_a_path_of_an_extension_is_taken_as_it_is_written(path: str) -> None:
    with pytest.raises(UserError, match=r"^(configuration|extensions): .*"):
        validate(Settings, {"extensions": [path]})


@pytest.mark.parametrize("path", ["my study", "Übung/1", "it's", 'say "x"', "2026_11_26", "a$", "x~", "/tmp/a,b;c&d"])
def test_an_unusual_path_is_no_mistake(path: str) -> None:
    assert validate(Settings, {"results": path}).results == path
    assert validate(Settings, {"results": f"{path}/"}).results == path


@pytest.mark.parametrize(("data", "says"), BAD, ids=[says.split(":")[0] for _, says in BAD])
def test_a_mistake_is_one_line_with_key_value_and_what_is_allowed(data: dict[str, Any], says: str) -> None:
    with pytest.raises(UserError) as caught:
        validate(Settings, data)
    assert "\n" not in str(caught.value)
    assert says in str(caught.value)
    assert str(caught.value).startswith("configuration: ")


def test_yaml_numbers_without_a_point_are_read_as_numbers(tmp_path: Path) -> None:
    overlay = tmp_path / "overlay.yaml"
    overlay.write_text("sac: {policy_learning_rate: 3e-4}\n")
    assert read_yaml(overlay) == {"sac": {"policy_learning_rate": "3e-4"}}, "YAML 1.1 takes it for text"
    assert load([overlay]).sac.policy_learning_rate == 3.0e-4


@pytest.mark.parametrize(("text", "says"), [("a: [1", "not valid YAML"), ("- 1\n- 2\n", "must be a mapping")])
def test_a_broken_file_is_named(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=says) as caught:
        load([path])
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(UserError, match=r"nowhere\.yaml: no such file"):
        load(["nowhere.yaml"])


def test_overlays_merge_mappings_and_replace_lists() -> None:
    base = {"a": {"b": 1, "c": [1, 2]}, "d": 3}
    assert merge(base, {"a": {"c": [3]}, "e": 4}) == {"a": {"b": 1, "c": [3]}, "d": 3, "e": 4}
    assert base == {"a": {"b": 1, "c": [1, 2]}, "d": 3}, "the base stays as it was"


def test_overrides() -> None:
    assert override({"sac": {"discount": 0.9}}, ["sac.minibatch=64", "seeds=[1, 2]"]) == {
        "sac": {"discount": 0.9, "minibatch": 64},
        "seeds": [1, 2],
    }
    assert load(overrides=["sac.minibatch=64"]).sac.minibatch == 64
    for wrong in ("sac.minibatch", "=3", "sac.minibatch=[1"):
        with pytest.raises(UserError, match="--set"):
            override({}, [wrong])


@pytest.mark.parametrize(
    ("assignments", "key"),
    [
        (["seeds=[0]", "seeds=[1]"], "seeds"),
        (["sac.minibatch=3", "seeds=[0]", "sac.minibatch=3"], "sac.minibatch"),
        (["sac={minibatch: 3}", "sac.minibatch=4"], "sac.minibatch"),
        (["sac=3", "sac.minibatch=4"], "sac.minibatch"),
    ],
    ids=str,
)
def test_no_key_is_set_twice(assignments: list[str], key: str) -> None:
    with pytest.raises(UserError, match=f"^--set {key}: given twice; keep one$"):
        override({}, assignments)


def test_keys_of_one_mapping_are_set_one_by_one() -> None:
    steps = ["expert.steps={default: 5}", "expert.steps.reach=6", "expert.steps.reach-wall=7"]
    assert override({}, steps) == {"expert": {"steps": {"default": 5, "reach": 6, "reach-wall": 7}}}


def test_settings_are_frozen() -> None:
    with pytest.raises(ValidationError):
        Settings().sac.minibatch = 3  # type: ignore[misc]


def test_json_is_sorted_and_complete() -> None:
    settings = load(scale="smoke")
    data = json.loads(as_json(settings))
    assert list(data) == sorted(data)
    assert validate(Settings, data) == settings
    assert "\n" not in as_json(settings)


def test_schema_holds_every_key_with_its_paper_value() -> None:
    described = schema()
    assert set(described["properties"]) == set(Settings.model_fields)
    assert described["$defs"]["LearnerSettings"]["properties"]["minibatch"]["paper"] == 500
    assert described["additionalProperties"] is False


def test_registries_and_defaults_agree() -> None:
    assert set(Settings().methods) <= set(METHODS)
    assert set(Settings().cs_rewards) <= set(COMMON_SENSE_REWARDS)
    assert set(Settings().expert.cs_weight) == set(Settings().cs_rewards)


def test_granted() -> None:
    assert granted({"default": 5, "reach": 7}, "reach") == 7
    assert granted({"default": 5, "reach": 7}, "push") == 5


def test_a_run_warms_up_as_long_as_its_slowest_task_asks() -> None:
    settings = override(Settings().model_dump(mode="json"), ["irl.warm_up_iterations={default: 2, plate-slide: 5}"])
    study = validate(Settings, settings)
    rounds = [
        irl_run(study, "multi_task", tasks).irl.warm_up_iterations for tasks in (["reach"], ["reach", "plate-slide"])
    ]
    assert rounds == [2, 5]
    assert irl_run(study, "multi_task", ["reach"]) != irl_run(study, "multi_task", ["plate-slide"])


@pytest.mark.parametrize(
    "module", ["settings.loading", "study.design", "study.plan", "study.status", "study.artefacts", "cli"]
)
def test_settings_and_study_import_neither_torch_nor_snakemake(module: str) -> None:
    """Snakemake reads them once per job, a shell at every --help."""
    code = (
        f"import sys, mtcsirl.{module}; from mtcsirl.settings.loading import load; load();"
        "sys.exit(bool({'torch', 'snakemake', 'pandas', 'mujoco'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("section", ["expert", "baseline", "transfer"])
def test_no_task_slips_through_the_smoke_scales_budget(section: str) -> None:
    """An overlay merges mappings: a task that gets a budget of its own at desk scale has to be named there too."""
    assert set(getattr(load(scale="smoke"), section).steps.values()) == {400}


def test_a_key_of_the_generators_stands_once_per_run() -> None:
    """Temperature and scale of a run's generators are those of its ``sac``; the study has them under ``irl``."""
    study = validate(Settings, {"irl": {"temperature": "automatic", "initial_temperature": 0.5, "reward_scale": 0.2}})
    run = irl_run(study, "single_target", ["reach"])
    assert (run.sac.temperature, run.sac.initial_temperature, run.sac.reward_scale) == ("automatic", 0.1, 0.2)
    for name in ("temperature", "initial_temperature", "reward_scale"):
        with pytest.raises(UserError, match=rf"irl\.{name} = .*unknown key"):
            validate(IrlRunSettings, {"irl": {name: 1.0}})


DESIGN = (
    "scale",
    "results",
    "figures",
    "extensions",
    "seeds",
    "irl_seeds",
    "cs_rewards",
    "methods",
    "single_target.",
    "multi_target.",
    "multi_task.",
    "ablations.",
)
"""Keys that say what there is and where, not how it is made."""


@pytest.mark.parametrize("name", [name for name, _, _ in keys(Settings()) if not name.startswith(DESIGN)])
def test_every_key_of_the_study_reaches_a_run(name: str) -> None:
    (value,) = (one for key, _, one in keys(Settings()) if key == name)
    changed = validate(Settings, override({}, [f"{name}={json.dumps(_another(name, value))}"]))
    assert any(_slices(changed, experiment) != _slices(Settings(), experiment) for experiment in EXPERIMENTS)


def _slices(settings: Settings, experiment: str) -> list[BaseModel]:
    """The settings of one run of every kind."""
    tasks = ("push-back", "coffee-button")  # those that most keys make an exception for
    agents: list[BaseModel] = [expert_run(settings, task, cs) for task in tasks for cs in settings.cs_rewards]
    agents += [run(settings, task) for run in (baseline_run, transfer_run) for task in tasks]
    learning = [irl_run(settings, experiment, [task], method) for task in tasks for method in settings.methods]
    shown = [demonstration_run(settings, cs) for cs in settings.cs_rewards]
    return [*agents, *learning, *shown, score_run(settings)]


def _another(name: str, value: Any) -> Any:
    """A value that is allowed and is another."""
    known = {
        "environment.observation": "raw",
        "sac.learner": "stable_baselines3",
        "sac.device": "cuda",
        "irl.schedule": "as_printed",
        "irl.curriculum_maximum": "task",
        "irl.logit_temperature": "as_printed",
        "irl.logit_density": "as_printed",
        "irl.warm_up_temperature": "as_in_irl",
        "irl.discriminator_update": "epoch",
        "irl.generator_update": "epoch",
        "sac.discount": 0.5,
        "sac.min_log_std": -3.0,
        "evaluation.episode_steps": 100,
        "expert.held_until": 0.5,
    }
    if name in known:
        return known[name]
    if isinstance(value, Mapping):
        return {key: _another("", one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [3]
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return 0.3
    return value * 2 if isinstance(value, int) and value else value / 2 if value else 1
