"""Parameter files of 0.1.0 still start every node with the values that they say."""

from __future__ import annotations

from pathlib import Path

import pytest
import rclpy
import yaml
from rclpy.context import Context

from msrd_ros.nodes.common import StackNode
from msrd_ros.nodes.parameter_files import NODES, config_type

EARLIER = Path(__file__).parents[1] / "data" / "0.1.0" / "config"
RENAMED = {"sweeps": "iterations", "rehearse_every": "evaluate_every", "rehearse_balls": "evaluation_balls"}


@pytest.mark.parametrize("name", sorted(path.stem for path in EARLIER.glob("*.yaml") if path.stem in NODES))
def test_a_parameter_file_of_0_1_0_is_understood(name: str, domain_id: int) -> None:
    path = EARLIER / f"{name}.yaml"
    said = yaml.safe_load(path.read_text(encoding="utf-8"))[name]["ros__parameters"]
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context, domain_id=domain_id)
    try:
        node = StackNode(name, config_type(name), context=context)
        for key, value in said.items():
            assert getattr(node.config, RENAMED.get(key, key)) == value, key
        node.destroy_node()
    finally:
        context.try_shutdown()
