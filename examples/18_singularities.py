"""A level platform is turned: where its legs hold it no more, although no pose that is looked at is singular itself."""

import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.mission import MissionRecorder, Recording, RobotSample, check, resampled

robot = cinegen.load("robots/tssm.raff")
pose = robot.placement(robot.q_home, "platform")
q = robot.q_home

path = Path(tempfile.mkdtemp(), "turn.jsonl")
with MissionRecorder(path, {"tssm": robot}) as recorder:
    for second in range(7):
        pose.rotation = pin.utils.rotate("z", np.radians(20 * second))
        q = cinegen.inverse_kinematics(robot, {"platform": pose}, q).q
        here = cinegen.singularity(robot, q)
        print(f"turned by {20 * second} degrees: {here.kind.value}, singular value of type 2 {here.sigma[1]:.3f}")
        recorder.write(float(second), {"tssm": RobotSample(q, "", ())})

# Between two samples that are regular, the singular value has changed its sign.
for finding in check(resampled(Recording.load(path))):
    if finding.sigma is not None:
        there = cinegen.singularity(robot, finding.q)
        turned = np.degrees(pin.rpy.matrixToRpy(robot.placement(finding.q, "platform").rotation)[2])
        print(f"at {turned:.2f} degrees, after {finding.recorded:.2f} s, {finding.message}")
        print("as", there.dependence.text(unit="m"))
