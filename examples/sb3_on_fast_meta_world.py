"""stable-baselines3's SAC on the fast Meta-World, with a ground-truth common-sense reward or none.

python examples/sb3_on_fast_meta_world.py --steps 100000
"""

import argparse

import gymnasium
from stable_baselines3 import SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import mtcsirl.exports.environments

gymnasium.register_envs(mtcsirl.exports.environments)


def main() -> None:
    """Train, then print the mean return of deterministic episodes."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--task", default="reach-wall")
    arguments.add_argument("--target", type=int, default=3)
    arguments.add_argument("--cs-reward", choices=("velocity", "action_norm"))
    arguments.add_argument("--steps", type=int, default=100_000)
    arguments.add_argument("--episodes", type=int, default=1)
    parsed = arguments.parse_args()
    env = gymnasium.make(f"mtcsirl/{parsed.task}-v0", target=parsed.target, cs_reward=parsed.cs_reward)
    agent = SAC("MlpPolicy", env, learning_starts=min(1000, parsed.steps // 2), seed=0, device="cpu")
    agent.learn(parsed.steps)
    mean, _ = evaluate_policy(agent, Monitor(env), n_eval_episodes=parsed.episodes)
    print(f"return over 500 steps: {mean:.1f}")


if __name__ == "__main__":
    main()
