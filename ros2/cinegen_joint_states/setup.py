"""Build of the package by colcon."""

from setuptools import setup

NAME = "cinegen_joint_states"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/display.launch.py"]),
    ],
    install_requires=["setuptools", "cinegen"],
    extras_require={"bags": ["rosbags"]},
    description="Completes the joint states and trajectories of robots with closed loops",
    maintainer="the cinegen authors",
    maintainer_email="cinegen@example.org",
    license="MIT",
    entry_points={"console_scripts": [f"complete = {NAME}.node:main", f"complete_bag = {NAME}.bag:main"]},
)
