"""Changes of a solver at run time: of joints, period and gain, objectives and barriers, tasks."""
