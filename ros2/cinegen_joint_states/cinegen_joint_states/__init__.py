"""Joint states and trajectories of robots with closed loops in ROS 2: values of the actuated joints in, all joints out.

`joint_states` and `trajectories` need no ROS; `node` connects them to its topics, `bag` to recordings.
"""
