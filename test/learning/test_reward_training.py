"""Log-densities as the discriminator uses them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from msrd_ros.learning.config import DiscriminatorConfig
from msrd_ros.learning.reward_training import used_log_prob


def test_log_densities_are_used_as_the_recipe_says() -> None:
    deviation = np.array([0.1, 0.2])
    entropy = float((np.log(deviation) + 0.5 * np.log(2 * np.pi * np.e)).sum())
    given, log_std = torch.tensor([-3.0, 50.0]), torch.as_tensor(np.log(deviation))
    centred = replace(DiscriminatorConfig(), centre_log_prob=True, log_prob_bounds=(-10.0, 10.0))
    assert used_log_prob(given, log_std, centred).tolist() == pytest.approx([entropy - 3.0, 10.0])
    assert used_log_prob(given, log_std, replace(centred, uses_log_prob=False)).tolist() == [0.0, 0.0]


def test_centring_needs_deviations() -> None:
    with pytest.raises(TypeError, match="Gaussian"):
        used_log_prob(torch.zeros(2), None, DiscriminatorConfig(centre_log_prob=True))
