"""Tensors that claim to be on a GPU and compute on the processor: what would meet on two devices is found without one.

Every torch function passes through a mode that notes of each tensor where it is said to be, and raises where a GPU
would: two devices in one operation, a generator of another device, `numpy` of what is on the GPU. Numbers are real.
"""

from collections.abc import Callable, Iterator
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode

_FILLED_LATER = {"zeros_like", "full_like", "empty_like", "new_zeros", "tensor", "as_tensor"}
"""Functions that read the shape of a tensor alone, or bring it where ``device`` says."""


class WrongDeviceError(RuntimeError):
    """What a GPU would refuse."""


class ClaimedGenerator(torch._C.Generator):
    """A generator that notes for which device it was made, and draws on the processor."""

    def __new__(cls, device: torch.device | str = "cpu") -> "ClaimedGenerator":
        return super().__new__(cls)

    def __init__(self, device: torch.device | str = "cpu") -> None:
        self.gpu = _is_gpu(device)


class ClaimedGpu(TorchFunctionMode):
    """Within it, ``device="cuda"`` is a claim."""

    def __torch_function__(self, func: Callable[..., Any], types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        name = getattr(func, "__name__", "")
        if func == Tensor.device.__get__:
            return torch.device("cuda" if on_gpu(args[0]) else "cpu")
        if func == Tensor.is_cpu.__get__:
            return not on_gpu(args[0])
        if name in ("to", "cpu"):
            return _move(func, args, kwargs)
        if name == "copy_":  # from any device to any other
            return func(*args, **kwargs)
        if name == "numpy" and on_gpu(args[0]):
            raise WrongDeviceError("numpy of a tensor on the GPU")
        return _compute(func, name, args, kwargs)


def on_gpu(tensor: Tensor) -> bool:
    """Whether a tensor claims to be there."""
    return getattr(tensor, "claims_gpu", False)


def _compute(func: Callable[..., Any], name: str, args: Any, kwargs: dict[str, Any]) -> Any:
    read = list(_tensors((args, kwargs)))
    gpu = any(on_gpu(tensor) for tensor in read)
    if kwargs.get("device") is not None:
        gpu = _is_gpu(kwargs["device"])
        kwargs["device"] = "cpu"
        read = [] if name in _FILLED_LATER else read
    # a number is taken along to any device, and so is an index; what is stored in a tensor is copied there
    sized = [on_gpu(tensor) for tensor in read if tensor.dim()]
    if name not in ("__getitem__", "__setitem__") and set(sized) not in (set(), {gpu}):
        raise WrongDeviceError(f"{name}: tensors on both devices")
    generator = kwargs.get("generator")
    if generator is not None and generator.gpu != gpu:
        raise WrongDeviceError(f"{name}: tensors on {_name(gpu)}, their random numbers from {_name(generator.gpu)}")
    return _claim(func(*args, **kwargs), gpu)


def _move(func: Callable[..., Any], args: Any, kwargs: dict[str, Any]) -> Any:
    """`Tensor.to` and `Tensor.cpu`; what changes its device is another tensor."""
    here = on_gpu(args[0])
    asked = [one for one in (*args[1:], kwargs.get("device")) if isinstance(one, str | torch.device | Tensor)]
    there = here if not asked and func is not Tensor.cpu else bool(asked) and _is_gpu(asked[0])
    given = ["cpu" if isinstance(one, str | torch.device) else one for one in args]
    moved = func(*given, **(kwargs | {"device": "cpu"} if "device" in kwargs else kwargs))
    return _claim(moved.view_as(moved) if moved is args[0] and here != there else moved, there)


def _claim(out: Any, gpu: bool) -> Any:
    for tensor in _tensors(out):
        tensor.claims_gpu = gpu
    return out


def _tensors(value: Any) -> Iterator[Tensor]:
    if isinstance(value, Tensor):
        yield value
    elif isinstance(value, list | tuple | dict):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _tensors(one)


def _is_gpu(place: torch.device | str | Tensor) -> bool:
    return on_gpu(place) if isinstance(place, Tensor) else torch.device(place).type == "cuda"


def _name(gpu: bool) -> str:
    return "the GPU" if gpu else "the processor"
