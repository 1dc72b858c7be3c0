"""Batched networks against single ones, and their Jacobian products against autograd."""

from __future__ import annotations

import torch

from msrd_ros.learning.networks import BatchedMLP, Features, Linearisation

SIZES = (3, 8, 8, 2)


def make(copies: int = 4, seed: int = 0) -> BatchedMLP:
    network = BatchedMLP(copies, SIZES, torch.Generator().manual_seed(seed)).double()
    for bias in network.biases:
        torch.nn.init.normal_(bias, generator=torch.Generator().manual_seed(seed + 1))
    return network


def test_each_copy_is_the_network_it_would_be_alone() -> None:
    network = make()
    inputs = torch.randn(4, 7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    outputs = network(inputs)
    for copy in range(4):
        hidden = inputs[copy]
        for layer in range(3):
            hidden = hidden @ network.weights[layer][copy] + network.biases[layer][copy]
            hidden = torch.tanh(hidden) if layer < 2 else hidden
        torch.testing.assert_close(outputs[copy], hidden)


def test_jacobian_products_agree_with_autograd() -> None:
    network = make()
    generator = torch.Generator().manual_seed(3)
    inputs = torch.randn(4, 5, 3, dtype=torch.float64, generator=generator)
    tangent = torch.randn(4, network.parameter_count, dtype=torch.float64, generator=generator)
    cotangent = torch.randn(4, 5, 2, dtype=torch.float64, generator=generator)
    start = network.flat()

    def output(flat: torch.Tensor) -> torch.Tensor:
        hidden = inputs
        for layer, (weight, bias) in enumerate(network.split(flat)):
            hidden = torch.baddbmm(bias, hidden, weight)
            hidden = torch.tanh(hidden) if layer < 2 else hidden
        return hidden

    linear = Linearisation(network, inputs)
    assert torch.equal(linear.outputs, network(inputs))
    _, forward = torch.autograd.functional.jvp(output, start, tangent)
    _, backward = torch.autograd.functional.vjp(output, start, cotangent)
    torch.testing.assert_close(linear.push_forward(tangent), forward)
    torch.testing.assert_close(linear.pull_back(cotangent), backward)


def test_flat_parameters_round_trip() -> None:
    network, other = make(seed=0), make(seed=5)
    other.set_flat(network.flat())
    inputs = torch.randn(4, 7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    assert torch.equal(network(inputs), other(inputs))


def test_features_select_shift_and_scale() -> None:
    features = Features((2, 0), (1.0, -1.0), (2.0, 0.5))
    torch.testing.assert_close(features(torch.tensor([3.0, 9.0, 5.0])), torch.tensor([2.0, 8.0]))
    assert features.width == 2
