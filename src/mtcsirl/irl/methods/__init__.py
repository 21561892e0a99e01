"""The registry of IRL methods: name -> what builds it. A new method is one file here and one line below."""

from collections.abc import Callable

from mtcsirl.irl.discriminator import Method
from mtcsirl.irl.methods.base import Setup
from mtcsirl.irl.methods.mt_airl import mt_airl
from mtcsirl.irl.methods.mt_csirl import mt_csirl
from mtcsirl.irl.methods.mt_csirl_lt import mt_csirl_lt
from mtcsirl.irl.methods.mt_vairl import mt_vairl
from mtcsirl.irl.methods.mt_vairl_gp import mt_vairl_gp

METHODS: dict[str, Callable[[Setup], Method]] = {
    "mt_airl": mt_airl,
    "mt_vairl": mt_vairl,
    "mt_vairl_gp": mt_vairl_gp,
    "mt_csirl": mt_csirl,
    "mt_csirl_lt": mt_csirl_lt,
}
