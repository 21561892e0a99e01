"""A new agent, stable-baselines3's SAC, on the task reward and a learned common-sense reward from its folder.

python examples/new_agent_on_learned_reward.py results/.../learn_reward/.../s0 --task drawer-close
"""

import argparse

import gymnasium
from stable_baselines3 import SAC

from mtcsirl.exports.environments import make, with_learned_reward


def main() -> None:
    """Train, then print what one deterministic episode earns by the task and by the learned reward."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("reward", help="folder with reward.json and reward.safetensors")
    arguments.add_argument("--task", default="reach-wall")
    arguments.add_argument("--weight", type=float, default=1.0, help="factor on the learned reward")
    arguments.add_argument("--steps", type=int, default=100_000)
    parsed = arguments.parse_args()
    env: gymnasium.Env = with_learned_reward(make(parsed.task), parsed.reward, weight=parsed.weight)
    agent = SAC("MlpPolicy", env, learning_starts=min(1000, parsed.steps // 2), seed=0, device="cpu")
    agent.learn(parsed.steps)
    (observation, _), truncated, earned = env.reset(), False, {"task_reward": 0.0, "f": 0.0}
    while not truncated:
        action, _ = agent.predict(observation, deterministic=True)
        observation, _, _, truncated, info = env.step(action)
        earned = {name: total + info[name] for name, total in earned.items()}
    print(", ".join(f"{name} {total:.1f}" for name, total in earned.items()))


if __name__ == "__main__":
    main()
