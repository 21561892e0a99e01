"""The verbs that hand results to other tools: SB3 zip, Minari dataset."""

import argparse

from mtcsirl.commands.arguments import Verbs, add_verb, demonstrations_given, new_file, new_folder, path


def register(verbs: Verbs) -> None:
    """Add the verbs."""
    policy = add_verb(
        verbs,
        "export-policy",
        _export_policy,
        does="write a stored policy as a zip that stable_baselines3.SAC.load reads; it acts on raw observations",
        needs="the folder of a trained agent",
        writes="--output; it holds pickled objects, which this package itself never reads",
    )
    policy.add_argument("--policy", required=True, type=path, metavar="DIR", help="folder of the agent")
    policy.add_argument("--output", required=True, type=new_file, metavar="FILE.zip", help="file to write")

    demonstrations = add_verb(
        verbs,
        "export-demonstrations",
        _export_demonstrations,
        does="write demonstrations as a Minari dataset",
        needs="demonstrations.parquet; Minari: pip install 'mtcsirl[export]'",
        writes="a dataset below --output, which MINARI_DATASETS_PATH must name to load it",
    )
    demonstrations.add_argument("--demonstrations", required=True, type=path, metavar="FILE", help="Parquet file")
    demonstrations.add_argument("--name", metavar="ID", help="Minari's id; default: mtcsirl/TASK-tTARGET-v0")
    demonstrations.add_argument(
        "--output", required=True, type=new_folder, metavar="DIR", help="folder of Minari datasets"
    )


def _export_policy(parsed: argparse.Namespace) -> None:
    from mtcsirl.exports.sb3 import export_sb3

    export_sb3(parsed.policy, parsed.output)
    print(parsed.output)


def _export_demonstrations(parsed: argparse.Namespace) -> None:
    from mtcsirl.exports.minari import export_minari

    with demonstrations_given(parsed.demonstrations):
        print(export_minari(parsed.demonstrations, parsed.output, parsed.name))
