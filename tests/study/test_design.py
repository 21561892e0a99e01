"""The design as data: what each artefact needs, each agent once, and the counts that the DAG must have."""

import dataclasses

import pytest

from mtcsirl.errors import UserError
from mtcsirl.settings import Settings
from mtcsirl.settings.loading import load
from mtcsirl.study.ablations import ABLATIONS
from mtcsirl.study.design import ARTEFACTS, CLAIMS, FIGURE_TASKS, design, variants
from mtcsirl.study.keys import read_folder
from mtcsirl.study.runs import KINDS, Baseline, Expert, Runs

SCALES = ("smoke", "desk", "paper")


def everything(study: Runs) -> set:
    return set(study)


@pytest.fixture(scope="module", params=SCALES)
def settings(request: pytest.FixtureRequest) -> Settings:
    return load(scale=request.param)


def test_every_run_has_a_folder_of_its_own(settings: Settings) -> None:
    folders = [run.folder for run in design(settings)]
    assert len(folders) == len(set(folders))


def test_a_folder_gives_its_key_back(settings: Settings) -> None:
    for run in design(settings):
        kinds = {kind: key for kind in KINDS if (key := read_folder(kind.PATTERN, run.folder)) is not None}
        assert kinds == {type(run): {name: str(value) for name, value in run.key.items() if name in kinds[type(run)]}}
        assert read_folder(type(run).PATTERN, f"{run.folder}/more") is None


def test_the_study_is_the_union_of_its_artefacts(settings: Settings) -> None:
    union = set().union(*(everything(design(settings, name)) for name in (*ARTEFACTS, CLAIMS)))
    assert everything(design(settings)) == union == everything(design(settings, CLAIMS))


def test_claims_have_every_task_scored_and_the_generators_of_c12(settings: Settings) -> None:
    whole = design(settings)
    scored = {(run.irl.experiment, run.irl.cs_reward, run.task) for run in whole.scores}
    for cs in settings.cs_rewards:
        assert {task for kind, name, task in scored if (kind, name) == ("single_target", cs)} == set(
            settings.single_target.tasks
        )
        assert {task for kind, name, task in scored if (kind, name) == ("multi_task", cs)} == set(
            settings.multi_task.unseen_tasks
        )
    assert {run.variant for run in whole.irl_runs} == {"", "ablation_curriculum/constant"}


def test_what_a_run_reads_is_in_the_study(settings: Settings) -> None:
    for name in ARTEFACTS:
        study = everything(design(settings, name))
        for run in study:
            assert set(run.needs.values()) <= study


def test_a_seed_imitates_the_expert_of_its_seed(settings: Settings) -> None:
    """Several targets keep one expert per target, that of the first seed."""
    for run in design(settings).irl_runs:
        wanted = settings.seeds[0] if run.experiment == "multi_target" else run.seed
        assert {one.expert.seed for one in run.demonstrations} == {wanted}


def test_demonstrations_do_not_depend_on_the_artefact_asked_for(settings: Settings) -> None:
    """They are shared: asking for one table must not shrink a set that another one reads too."""
    whole = {run.folder: run.settings(settings) for run in design(settings).demonstrations}
    for name in ARTEFACTS:
        for run in design(settings, name).demonstrations:
            assert run.settings(settings) == whole[run.folder]


def test_table_2_counts() -> None:
    """Worked out by hand: 4 unseen tasks, 5 seeds, 2 cs-rewards, 5 methods, 6 train tasks with one target."""
    study = design(Settings(multi_task={"train_targets": [1]}), "table_2")
    assert study.jobs() == {
        "train_expert": 4 * 2 * 5 + 6 * 2 * 5,
        "train_sac": 4 * 5,
        "collect_demonstrations": 6 * 2 * 5,
        "learn_reward": 5 * 2 * 5,
        "transfer": 4 * 5 * 2 * 5,
    }


def test_table_1_counts() -> None:
    """5 sources x 5 tasks x 5 seeds, one cs-reward; 5 sources with 5 targets each."""
    study = design(load(scale="paper"), "table_1")
    assert study.jobs() == {
        "train_expert": 5 * 5,
        "train_sac": 5 * 5,
        "collect_demonstrations": 5 * 5,
        "learn_reward": 5 * 5,
        "transfer": 5 * 5 * 5,
    }
    assert {run.cs_reward for run in study.transfers for run in [run.irl]} == {"action_norm"}


def test_single_target_figure_counts() -> None:
    study = design(Settings(), "figure_4")
    assert study.jobs() == {
        "train_expert": 2 * 5,
        "train_sac": 5,
        "collect_demonstrations": 2 * 5,
        "learn_reward": 2 * 5,
        "transfer": 2 * 5,
    }
    assert {run.task for run in study.transfers} == {FIGURE_TASKS["figure_4"]}


def test_figures_drawn_by_code_need_no_run() -> None:
    for name in ("table_5", "figure_1", "figure_8", "figure_9"):
        assert not list(design(Settings(), name))


def test_results_are_read_on_a_target_that_training_did_not_see() -> None:
    for run in design(load(scale="paper")).transfers:
        trained_on = {target for task, target in run.irl.members if task == run.task}
        if run.irl.experiment == "multi_target":
            assert run.target not in trained_on
        if run.irl.experiment == "multi_task" and run.task_reward == "known":
            assert not trained_on, "an unseen task"
        if run.irl.experiment == "single_target":
            assert run.target in trained_on


def test_only_table_4_uses_the_learned_task_reward() -> None:
    study = design(Settings())
    learned = {run for run in study.transfers if run.task_reward == "learned"}
    assert learned == set(design(Settings(), "table_4").transfers)


def test_fewer_irl_seeds_are_cycled_through() -> None:
    study = design(Settings(seeds=(0, 1, 2, 3, 4), irl_seeds=(0, 1)), "figure_4")
    pairs = {(run.seed, run.irl.seed) for run in study.transfers}
    assert pairs == {(0, 0), (1, 1), (2, 0), (3, 1), (4, 0)}
    assert len(study.irl_runs) == 2 * 2


def test_methods_left_out_leave_no_runs() -> None:
    study = design(Settings(methods=("mt_csirl",)), "table_2")
    assert {run.irl.method for run in study.transfers} == {"mt_csirl"}
    assert not list(design(Settings(methods=("mt_csirl",)), "table_4"))


def test_one_cs_reward_alone() -> None:
    study = design(Settings(cs_rewards=("velocity",)))
    assert {run.cs_reward for run in study.experts} == {"velocity"}
    assert not design(Settings(cs_rewards=("velocity",)), "table_1").transfers


def test_a_changed_key_changes_only_the_runs_that_read_it() -> None:
    before = Settings()
    after = Settings(irl={"iterations": before.irl.iterations + 1})
    changed = {run.stage for run in design(before) if run.settings(before) != run.settings(after)}
    assert changed == {"learn_reward"}
    after = Settings(transfer={"steps": {**before.transfer.steps, "reach-wall": 1}})
    changed_runs = [run for run in design(before) if run.settings(before) != run.settings(after)]
    assert {(run.stage, run.task) for run in changed_runs} == {("transfer", "reach-wall")}  # type: ignore[union-attr]


def test_budgets_reach_the_runs() -> None:
    settings = Settings(
        expert={"steps": {"default": 7, "push-back": 9}}, demonstrations={"episodes": {"multi_task": 3}}
    )
    assert Expert("velocity", "reach", 0, 0).settings(settings).steps == 7
    assert Expert("velocity", "push-back", 0, 0).settings(settings).steps == 9
    assert Baseline("push-back", 0, 0).settings(settings).cs_weight == 0


def test_shared_demonstrations_are_as_long_as_the_hungriest_reader_asks() -> None:
    settings = Settings(
        demonstrations={"episodes": {"single_target": 1, "multi_target": 2, "multi_task": 5}},
        multi_target={"tasks": ["coffee-button"], "train_targets": [1]},
        multi_task={"train_tasks": ["coffee-button", "reach"], "train_targets": [1]},
    )
    assert {run.settings(settings).episodes for run in design(settings).demonstrations} == {5}
    read = {run.experiment: run.settings(settings).demonstration_episodes for run in design(settings).irl_runs}
    assert read == {"single_target": 1, "multi_target": 2, "multi_task": 5}


def test_unknown_artefact() -> None:
    with pytest.raises(UserError, match="unknown artefact 'figure_99'; allowed: table_1"):
        design(Settings(), "figure_99")


def test_runs_are_plain_values() -> None:
    run = Expert("velocity", "reach", 1, 3)
    assert run.folder == "expert/velocity/reach-t1/s3"
    assert run == Expert("velocity", "reach", 1, 3)
    with pytest.raises(dataclasses.FrozenInstanceError):
        run.seed = 4  # type: ignore[misc]


@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_trains_its_variants_and_shares_the_rest(settings: Settings, name: str) -> None:
    main, own = {run.folder for run in design(settings)}, set(design(settings, name))
    shown = variants(settings, name)
    assert set(shown) == set(ABLATIONS[name].variants)
    assert {run for study in shown.values() for run in study} <= own
    new = {run.folder for run in own} - main
    assert {run.folder for run in shown["default"]} & new == set() or not set(settings.ablations.seeds) <= set(
        settings.seeds
    )
    for variant in list(shown)[1:]:
        folders = {run.folder for run in shown[variant]} & new
        assert folders, f"{variant} trains nothing"
        assert all(folder.startswith(f"ablations/{name}/{variant}/") for folder in folders)


def test_a_variant_changes_the_settings_that_it_names_and_no_others() -> None:
    settings = Settings()
    runs = {name: study.irl_runs[0] for name, study in variants(settings, "ablation_replay").items()}
    default, latest = (runs[name].settings(settings).model_dump() for name in ("default", "latest"))
    assert (default["irl"]["generator_replay"], latest["irl"]["generator_replay"]) == (20, 1)
    latest["irl"]["generator_replay"] = 20
    assert latest == default


def test_ablations_are_no_part_of_the_study_but_for_what_a_claim_compares(settings: Settings) -> None:
    own = {run.folder for run in design(settings) if run.folder.startswith("ablations/")}
    assert all(folder.startswith("ablations/ablation_curriculum/constant/irl/") for folder in own)
