"""A level platform is rotated: find where its legs lose control of it, between sampled poses that are all regular."""

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.mission import MissionRecorder, Recording, RobotSample, check, resampled

robot = cinegen.load("tssm")
pose = robot.placement(robot.q_home, "platform")
q = robot.q_home

path = Path(tempfile.mkdtemp(), "rotation.jsonl")
with MissionRecorder(path, {"tssm": robot}) as recorder:
    for second in range(7):
        pose.rotation = pin.utils.rotate("z", np.radians(20 * second))
        q = cinegen.inverse_kinematics(robot, {"platform": pose}, q).q
        result = cinegen.singularity(robot, q)
        print(f"rotated by {20 * second} degrees: {result.kind.value}, singular value of type 2 {result.sigma[1]:.3f}")
        recorder.write(float(second), {"tssm": RobotSample(q, "", ())})

# Between two samples that are regular, the singular value has changed its sign.
for finding in check(resampled(Recording.load(path))):
    if finding.sigma is not None:
        singularity = cinegen.singularity(robot, finding.q)
        angle = np.degrees(pin.rpy.matrixToRpy(robot.placement(finding.q, "platform").rotation)[2])
        print(f"at {angle:.2f} degrees, after {finding.recorded:.2f} s, {finding.message}")
        print("because", singularity.dependence.text(unit="m"))
