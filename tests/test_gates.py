"""The command that says whether baselines and experts learn, on the smoke scale."""

from benchmarks import gates

from mtcsirl.settings.loading import load
from mtcsirl.stages.together import train_together


def test_agents_train_once_and_are_listed_with_their_gates(tmp_path, capsys):
    settings = load(scale="smoke")
    wanted = list(gates.runs(["sac", "velocity"], ["reach"], [0], [100, 101]))
    assert gates.table(wanted, tmp_path).empty
    train_together(wanted, settings, tmp_path)
    found = gates.table(wanted, tmp_path)
    assert found[["agent", "seed"]].values.tolist() == [[a, s] for a in ("sac", "velocity") for s in (100, 101)]
    assert found["success"].between(0, 1).all()
    assert found["velocity"].gt(0).all()
    assert not list(tmp_path.glob("*.safetensors")), "no checkpoint is left behind"
    capsys.readouterr()
    train_together(wanted, settings, tmp_path)
    assert capsys.readouterr().out == "", "what is there is not trained again"
