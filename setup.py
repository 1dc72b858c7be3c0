"""Build msrd_ros, as an ament_python package with colcon or as a plain Python package with pip.

`ros2 run` looks for executables in ``<prefix>/lib/msrd_ros``. Only data files get there with both builders,
so the files of ``scripts/`` are data files, and none of them is a console script as well: colcon writes
console scripts into that same directory, and with ``--symlink-install`` it would write them through its links
into ``scripts/``.
"""

from __future__ import annotations

import os
from pathlib import Path

from setuptools import find_packages, setup

NAME = "msrd_ros"


def read_version() -> str:
    """Version of the package, without importing it."""
    for line in Path(NAME, "__init__.py").read_text(encoding="utf-8").splitlines():
        if line.startswith("__version__"):
            return line.split('"')[1]
    raise RuntimeError(f"{NAME}/__init__.py has no __version__")


def tree(top: str) -> list[tuple[str, list[str]]]:
    """Data files of a directory and all below it, laid out alike under the share directory."""
    found = []
    for directory, subdirectories, names in os.walk(top):
        subdirectories.sort()
        if names:
            target = Path("share", NAME, directory).as_posix()
            found.append((target, [Path(directory, name).as_posix() for name in sorted(names)]))
    return found


# Lower bounds are what `make test-lowest` installs (constraints-lowest.txt), a year older than the lock
# or more. Torch's is not tried: of other versions than the lock's we have no build without gigabytes of CUDA.

# A sourced ROS installation has rclpy and the messages, built against NumPy 1; elsewhere wheels bring them.
if os.environ.get("ROS_DISTRO"):
    NUMPY, ROS = ["numpy>=1.26,<2"], []
else:
    NUMPY = ["numpy>=1.26"]
    ROS = ["ros-jazzy-rclpy[fastrtps]>=7.1.6,<8", "ros-jazzy-common-interfaces>=5.3.6,<6"]

# What the rooms from robots/ up to the nodes need beside it: simulators, teachers, stroke training, reports.
SIMULATION = [
    "matplotlib>=3.8",
    "numba>=0.60",
    "pillow>=10.1",
    "pybullet>=3.2.6",
    "tensorboard>=2.15",
]
# Minari needs NumPy 2; beside a ROS installation its data sets cannot be read.
# Its storage needs Pillow, and does not say so.
DATA_SETS = [] if os.environ.get("ROS_DISTRO") else ["minari[hdf5]>=0.5.1", "pillow>=10.1"]
# LeRobot itself is not needed: its data sets are parquet files and videos. Pyarrow 19.0.0 fails at new ones.
LEROBOT = ["av>=15.0.0", "pyarrow>=19.0.1"]
# Not gymnasium's own extra: before 1.2.3 it compiles Box2D. Without pygame none of its worlds loads.
EXAMPLES = ["box2d>=2.3.10", "gymnasium>=1.0", "pygame-ce>=2.4.0"]
STUDIES = [*SIMULATION, *EXAMPLES, "gymnasium[mujoco]>=1.0", "mujoco>=3.2.7"]
# viser wants websockets below 17, and is younger than all others: earlier versions cannot be kept private.
STUDIO = [*SIMULATION, "aiohttp>=3.11.0", "trimesh>=4.4.0", "viser>=1.1.0", "websockets>=14.0,<17"]
# The client is for ray:// addresses.
RAY = ["ray[client]>=2.50.0"]
DOCUMENTS = ["furo>=2024.8.6", "myst-parser>=4", "sphinx>=8"]

setup(
    name=NAME,
    version=read_version(),
    description="Multi-Strategy Reward Distillation for ROS 2: teach by hand, record, learn, play",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    maintainer="msrd_ros maintainers",
    maintainer_email="maintainers@msrd-ros.example",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: [
            "py.typed",
            "**/*.json",
            "**/*.npz",
            "**/*.safetensors",
            "**/*.urdf",
            "**/*.html",
            "**/*.css",
            "**/*.js",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"lib/{NAME}", sorted(path.as_posix() for path in Path("scripts").iterdir() if not path.suffix)),
        *tree("launch"),
        *tree("config"),
        *tree("bags"),
    ],
    install_requires=[
        *NUMPY,
        "gymnasium>=1.0",
        "lz4>=4.3.2",
        "mcap>=1.2.1",
        "pyyaml>=6.0.1",
        "rosbags>=0.11.0",
        "safetensors>=0.5.3",
        "scipy>=1.11.4",
        "threadpoolctl>=3.2.0",
        "torch>=2.3",
        "tqdm>=4.66",
        "zstandard>=0.22",
    ],
    extras_require={
        "ros": ROS,
        "sim": SIMULATION,
        "studies": STUDIES,
        "minari": DATA_SETS,
        "lerobot": LEROBOT,
        "examples": EXAMPLES,
        "ray": RAY,
        "studio": STUDIO,
        "docs": DOCUMENTS,
        "all": [*ROS, *STUDIES, *DATA_SETS, *LEROBOT, *EXAMPLES, *RAY, *STUDIO],
        "test": [
            "build>=1.2.1",
            "colcon-common-extensions>=0.3",
            "hypothesis>=6.100",
            "mcap-ros2-support>=0.5.2",
            *DATA_SETS,
            *LEROBOT,
            *EXAMPLES,
            *RAY,
            "mypy>=1.11",
            "packaging>=23",
            "playwright>=1.49.0",
            "pytest>=8,<9.2",  # pytest-xdist 3.8 does not find the groups of tests in newer ones
            "pytest-cov>=5",
            "pytest-timeout>=2.3.1",
            "pytest-xdist>=3.6.1",
            "ruff>=0.6",
            "setuptools<80",  # colcon-core needs the install command that later ones dropped
            "types-pyyaml",
            "types-tqdm",
        ],
    },
    entry_points={"console_scripts": [f"{NAME} = {NAME}.__main__:main"]},
    zip_safe=False,
)
