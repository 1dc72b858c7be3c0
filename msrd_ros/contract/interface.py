"""Every topic of the nodes: those that a bag carries and those beside them; the reference is made from it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from msrd_ros.contract.topics import CONTRACT, TopicFacts

_BESIDE = (
    TopicFacts("target", "geometry_msgs/msg/PointStamped", 1, latched=True),
    TopicFacts("joint_command", "trajectory_msgs/msg/JointTrajectory", 1),
    TopicFacts("teach/hand", "trajectory_msgs/msg/MultiDOFJointTrajectory", 1),
    TopicFacts("recorder/verdict", "diagnostic_msgs/msg/DiagnosticArray", 100),
    TopicFacts("policy", "std_msgs/msg/UInt8MultiArray", 1, latched=True),
    TopicFacts("training/progress", "diagnostic_msgs/msg/DiagnosticArray", 100),
    TopicFacts("match/outcome", "diagnostic_msgs/msg/DiagnosticArray", 100),
    TopicFacts("scene", "visualization_msgs/msg/MarkerArray", 1),
    TopicFacts("/tf", "tf2_msgs/msg/TFMessage", 1000),
    TopicFacts("clock", "rosgraph_msgs/msg/Clock", 1),
    TopicFacts("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 10),
)

TOPICS: Mapping[str, TopicFacts] = MappingProxyType({**CONTRACT, **{facts.name: facts for facts in _BESIDE}})
"""Topics by relative name. All publishers are reliable; lockstep hears ticks and answers best-effort."""

MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "joint_states": "simulator or robot → all; label during a stroke",
        "ball/position": "simulator or vision → all",
        "ball/odometry": "simulator; ground truth with spin, for judging only",
        "feed": "evaluator, demonstrator, studio, trainer, person → simulator",
        "strategy": (
            "person, demonstrator, studio, evaluator, trainer, chooser → executor, recorder, simulator, match"
        ),
        "target": "person, evaluator → executor, studio; where balls are to land",
        "rally/outcome": "simulator → recorder, evaluator, demonstrator, trainer; one per ball",
        "robot_description": "simulator → recorder, RViz, Foxglove",
        "/tf_static": "simulator → RViz, Foxglove (where tf2_msgs is installed)",
        "joint_command": "executor, or who leads by hand → simulator, driver; its strategy in the header",
        "teach/hand": "demonstrator, studio or tracked hand → simulator",
        "recorder/verdict": "recorder → demonstrator, studio, serving trainer; kept, or why not",
        "policy": "trainer, studio → executor; safetensors bytes, swapped between strokes only",
        "training/progress": "trainer",
        "match/outcome": "match; one per rally: its hits, and what ended it at which end",
        "scene": "simulator; executor, the target → RViz, Foxglove",
        "/tf": "simulator → RViz, Foxglove (where tf2_msgs is installed)",
        "clock": "simulator or player → all; /clock outside a namespace",
        "/diagnostics": "every node, once a second",
    }
)
"""Who sends a topic, to whom, and what for."""
