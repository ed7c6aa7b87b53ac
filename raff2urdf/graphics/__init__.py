"""What is seen of a robot: graphic files, and a drawing where there are none."""
