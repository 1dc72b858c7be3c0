"""The methods by name: one file each, and one entry here."""

from __future__ import annotations

from msrd_ros.core.errors import UserError
from msrd_ros.learning.method import Method
from msrd_ros.learning.methods.airl import Airl, AirlEach, AirlEachCross
from msrd_ros.learning.methods.cloning import Cloning
from msrd_ros.learning.methods.msrd import Msrd, MsrdAsPrinted
from msrd_ros.learning.methods.vanilla_distillation import VanillaDistillation

METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Msrd(),
        MsrdAsPrinted(),
        VanillaDistillation(),
        Airl(),
        AirlEach(),
        AirlEachCross(),
        Cloning(),
    )
}


def find_method(name: str | Method) -> Method:
    """The method of that name; a method itself passes through, so that a stranger's needs no entry.

    Raises
    ------
    UserError
        If there is none.
    """
    if isinstance(name, Method):
        return name
    if name not in METHODS:
        raise UserError(f"method {name!r} is unknown; use one of {', '.join(METHODS)}")
    return METHODS[name]
