"""stable-baselines3's SAC as the reference: conversion of its weights, and the peer in tests and benchmarks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from mtcsirl.agents.networks import NetworkStack

if TYPE_CHECKING:
    from mtcsirl.agents.sac import FusedSac


def copy_from_sb3(model: Any, learner: FusedSac) -> None:
    """Copy actor, critics, target critics and temperature of a stable_baselines3.SAC into a learner of one agent."""
    actor = model.actor
    layers = [module for module in actor.latent_pi if isinstance(module, torch.nn.Linear)]
    heads = torch.cat((actor.mu.weight, actor.log_std.weight)), torch.cat((actor.mu.bias, actor.log_std.bias))
    _fill(learner.actor, 0, [(layer.weight, layer.bias) for layer in layers] + [heads])
    for stack, critic in ((learner.critics, model.critic), (learner.target_critics, model.critic_target)):
        for network, q_network in enumerate(critic.q_networks):
            linear = [module for module in q_network if isinstance(module, torch.nn.Linear)]
            _fill(stack, network, [(layer.weight, layer.bias) for layer in linear])
    log_temperature = model.log_ent_coef if model.log_ent_coef is not None else model.ent_coef_tensor.log()
    learner.log_temperature.copy_(log_temperature.detach())


def _fill(stack: NetworkStack, network: int, layers: list[tuple[Tensor, Tensor]]) -> None:
    for index, (weight, bias) in enumerate(layers):
        stack.weights[index][network].copy_(weight.detach())
        stack.biases[index][network, 0].copy_(bias.detach())
