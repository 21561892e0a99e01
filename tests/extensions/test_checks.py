"""An entry that is none is refused when its file is loaded, in one line that names it and says what it should be."""

import subprocess
import sys
import time

import pytest
import torch

from mtcsirl.errors import UserError
from mtcsirl.extensions import METHODS, load_extensions
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS
from tests.extensions.conftest import REWARD, Write

REWARDS = """from dataclasses import replace
from functools import partial
import torch
from mtcsirl.rewards.ground_truth import COMMON_SENSE_REWARDS, CommonSenseReward, velocity
def good(t): return t.action.square().sum(dim=-1)
def add(key="mine", name=None, measure=good, target=0.5, unit="u", weight=1.0):
    COMMON_SENSE_REWARDS[key] = CommonSenseReward(key if name is None else name, measure, target, unit, weight)
def raising(t): raise ValueError("one\\ntwo")
def leaving(t): raise SystemExit(0)
"""
WRONG_REWARDS = {
    "COMMON_SENSE_REWARDS['mine'] = 3": "is 3; must be a CommonSenseReward",
    "COMMON_SENSE_REWARDS['mine'] = good": "is <function good at ",
    "add(name='bar')": "name = 'bar'; must be the key under which it stands, 'mine'",
    "add(target=0)": "target = 0; must be a finite number above 0",
    "add(target=-0.5)": "target = -0.5; must be a finite number above 0",
    "add(target=float('nan'))": "target = nan; must be a finite number above 0",
    "add(target=float('inf'))": "target = inf; must be a finite number above 0",
    "add(target='0.5')": "target = '0.5'; must be a finite number above 0",
    "add(target=torch.tensor(0.5))": "target = tensor(0.5000); must be a finite number above 0",
    "add(weight=0)": "weight = 0; must be a finite number above 0",
    "add(weight=float('nan'))": "weight = nan; must be a finite number above 0",
    "add(unit=None)": "unit = None; must be a text",
    "add(measure='text')": "measure = 'text'; must be a function of transitions",
    "add(measure=raising)": "measure: ValueError: one two; must return a tensor of shape [2, 3]",
    "add(measure=leaving)": "measure: ends the program (sys.exit); an extension must not",
    "add(measure=lambda t: 1.0)": "measure returns a float; must be a tensor of shape [2, 3]",
    "add(measure=lambda t: t.action.numpy().sum(-1))": "measure returns a numpy.ndarray; must be a tensor",
    "add(measure=lambda t: t.action)": "measure returns a tensor of shape [2, 3, 4]; must be a tensor of shape [2, 3]",
    "add(measure=lambda t: t.action.sum())": "measure returns a tensor of shape []; must be a tensor of shape [2, 3]",
    "add(measure=lambda t: t.action.sum(dim=2))": "measure: IndexError: ",
    "add(measure=lambda t: t.action.sum(dim=1))": "measure returns a tensor of shape [2, 4]; must be",
    "add(measure=lambda t: good(t).long())": "measure returns torch.int64; must be floating-point numbers",
    "add(measure=lambda t: 0 * good(t) / 0)": "measure returns [nan, nan, nan] for ordinary transitions; must be",
    "add(measure=lambda t, more: good(t))": "measure: TypeError: ",
    "add(measure=partial(good, k=2))": "measure: TypeError: ",
}

METHOD = """from dataclasses import replace
from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.losses import Adversarial, entire_reward_logit
from mtcsirl.irl.methods import METHODS
LOGIT = entire_reward_logit
def pay(task_reward, learned, alpha): return task_reward + alpha * learned["f"]
def made(setup, **changes):
    loss = Adversarial(changes.pop("logit", LOGIT))
    parts = {"f": setup.shared(setup.perceptron(), loss)}
    return replace(Method(parts, pay, True, True), **changes)
def f(setup): return made(setup).discriminators["f"]
def per_task(setup): return setup.per_task(setup.perceptron(), Adversarial(LOGIT))
def add(build, key="mine"): METHODS[key] = build
def raising(setup): raise ValueError("one\\ntwo")
"""
WRONG_METHODS = {
    "add(3)": "is 3; must be a function from a Setup to a Method",
    "add(raising)": "cannot be built: ValueError: one two; must build a Method for any Setup",
    "add(lambda: None)": "cannot be built: TypeError: ",
    "add(lambda setup: None)": "builds None; must be a function from a Setup to a Method",
    "add(lambda setup: setup)": "builds Setup(irl=",
    "add(lambda setup: made(setup, discriminators={}))": "discriminators: none; must be at least one, called 'f'",
    "add(lambda setup: made(setup, discriminators=None))": "discriminators = None; must be a dict of discriminators",
    "add(lambda setup: made(setup, discriminators={'f': 3}))": "discriminators['f'] is 3; must be a Discriminator",
    "add(lambda s: made(s, discriminators={'g': made(s).discriminators['f']}))": "discriminators: g; must be at least",
    "add(lambda s: made(s, discriminators={'f': per_task(s)}))": "discriminators['f'] has 2 rewards; must be 1, as of "
    "Setup.shared",
    "add(lambda s: made(s, discriminators={'f': f(s), 'task': f(s)}))": "discriminators['task'] has 1 rewards; must be"
    " 2, as of Setup.per_task",
    "add(lambda s: made(s, policy_reward=3))": "policy_reward = 3; must be a function",
    "add(lambda s: made(s, policy_reward=lambda t, learned, a: learned['g']))": "policy_reward: KeyError: 'g'; "
    "must return a tensor of shape [2, 3] from the task reward, the learned f and alpha",
    "add(lambda s: made(s, policy_reward=lambda t, learned, a: a))": "policy_reward returns a tensor of shape [2, 1]",
    "add(lambda s: made(s, policy_reward=lambda t, learned: t))": "policy_reward: TypeError: ",
    "add(lambda s: made(s, policy_reward=lambda t, learned, a: 1.0))": "policy_reward returns a float; must be",
    "add(lambda s: made(s, logit=lambda f: f))": "discriminators['f']: its logit: TypeError: ",
    "add(lambda s: made(s, logit=lambda f, r, p, t: f.sum()))": "discriminators['f']: its logit returns a tensor",
}
NAMES = ["../../x", "", "a/b", "a+b", "{x}", "A", "Mine", "1st", "_x", "a b", "a\n", "ä", "a-b", "a.b"]
TAKEN_REWARDS = ["success", "task_reward", "diverged", "velocity_distance", "x_distance"]
TAKEN_METHODS = ["expert", "sac", "irl_agent", "all"]


def _refused(write: Write, text: str) -> str:
    before = dict(METHODS), dict(COMMON_SENSE_REWARDS)
    file = write(text)
    with pytest.raises(UserError) as caught:
        load_extensions([file])
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 400
    assert before == (METHODS, COMMON_SENSE_REWARDS)
    assert line.startswith(f"extensions: {file}: ")
    return line.removeprefix(f"extensions: {file}: ")


@pytest.mark.parametrize("code", WRONG_REWARDS)
def test_what_is_no_cs_reward_is_refused(code: str, write: Write) -> None:
    says = _refused(write, f"{REWARDS}{code}\n")
    assert says.startswith(f"COMMON_SENSE_REWARDS['mine']: {WRONG_REWARDS[code]}")


@pytest.mark.parametrize("code", WRONG_METHODS)
def test_what_is_no_method_is_refused(code: str, write: Write) -> None:
    says = _refused(write, f"{METHOD}{code}\n")
    assert says.startswith(f"METHODS['mine']: {WRONG_METHODS[code]}")


@pytest.mark.parametrize("name", [*NAMES, 3, *TAKEN_REWARDS])
def test_a_cs_rewards_name_is_one(name: object, write: Write) -> None:
    assert f"COMMON_SENSE_REWARDS[{name!r}]: " in _refused(write, f"{REWARDS}add({name!r})\n")


@pytest.mark.parametrize("name", [*NAMES, 3, *TAKEN_METHODS])
def test_a_methods_name_is_one(name: object, write: Write) -> None:
    says = _refused(write, f"{METHOD}add(made, {name!r})\n")
    assert f"METHODS[{name!r}]: " in says
    assert "; must be lower-case letters, digits and underscores" in says or "; must be another name" in says


GOOD = [
    *(f"{REWARDS}{code}\n" for code in ("add()", "add(target=3)", "add('a_1', weight=2)")),
    f"{REWARDS}def power(t, k): return t.action.abs().pow(k).sum(-1)\nadd(measure=partial(power, k=2))\n",
    f"{REWARDS}add(measure=lambda t: (t.next_observation - t.observation).norm(dim=-1))\n",
    f"{REWARDS}add(measure=lambda t: t.next_observation[..., :3].log1p().mean(dim=-1))\n",
    f"{REWARDS}add(measure=velocity)\n",
    f"{METHOD}add(made)\n",
    f"{METHOD}add(made, 'a_1')\n",
    f"{METHOD}add(METHODS['mt_csirl_lt'])\n",
    f"{METHOD}add(METHODS['mt_vairl_gp'])\n",
]


@pytest.mark.parametrize("text", GOOD, ids=lambda text: text.splitlines()[-1])
def test_what_is_right_passes_in_no_time_and_draws_nothing(text: str, write: Write) -> None:
    state, start = torch.random.get_rng_state(), time.process_time()
    load_extensions([write(text)])
    assert time.process_time() - start < 0.5
    assert torch.equal(state, torch.random.get_rng_state())


def test_a_cs_reward_of_the_packages_measure_needs_no_torch(write: Write) -> None:
    file = write(REWARD.format(name="slow", target=0.2))
    code = f"import sys, mtcsirl.cli, mtcsirl.extensions as e; e.load_extensions([{str(file)!r}]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "mtcsirl_extension_mine" in done.stdout.split()
    assert "torch" not in done.stdout.split()


def test_methods_that_are_loaded_first_are_held_against_the_probe_too(write: Write) -> None:
    file = write("from mtcsirl.extensions import METHODS\nMETHODS['mine'] = lambda setup: None\n")
    code = f"import mtcsirl.extensions as e; e.load_extensions([{str(file)!r}]); print(1); import mtcsirl.irl.methods"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "1\n"
    assert done.stderr.splitlines()[-1].endswith(
        "mine.py: METHODS['mine']: builds None; must be a function from a Setup to a Method"
    )
