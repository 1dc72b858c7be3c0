"""Multi-Strategy Reward Distillation: as its recipe has it, and with nothing that the paper does not have."""

from __future__ import annotations

from msrd_ros.learning.config import MSRDConfig
from msrd_ros.learning.method import Method
from msrd_ros.learning.presets import as_printed


class Msrd(Method):
    """R_i = R0 + alpha_i S_i with every term of the recipe."""

    name = "msrd"
    title = "MSRD with cross-negatives"


class MsrdAsPrinted(Method):
    """The paper's loss and nothing added to it."""

    name = "msrd_as_printed"
    title = "MSRD as printed"

    def configure(self, config: MSRDConfig, strategies: int) -> MSRDConfig:
        """Take away all terms of ours."""
        return as_printed(config)
