"""Design: every number of a description is a variable.

from cinegen.design import Design, Parameters

parameters = Parameters("five_bar", names=["link*.d", "frame*.d"], ties=["link2.d = link4.d"])
design = Design(parameters)
p = parameters.with_changed({"link2.d": "255mm"})
here = design.evaluate(p)                      # loops closed with the actuated joints at home
here.placements("tool")                        # (1, 4, 4)
here.pose_derivative("tool")                   # (1, 6, parameters): m and rad by m and rad
design.evaluate(samples, derivatives=False)    # samples (n, parameters): thousands in a second
parameters.with_values(p)                      # the RAFF file with these numbers, comments kept
"""

from cinegen.design.calibration import Calibration, Measurements, calibrate
from cinegen.design.design import Design
from cinegen.design.errors import DesignError
from cinegen.design.evaluation import DesignEvaluation
from cinegen.design.parameters import Parameter, Parameters
from cinegen.design.synthesis import Synthesis, SynthesisTask, load_task, synthesize
from cinegen.design.tolerance import Tolerances, tolerance
from cinegen.design.tolerance_report import ToleranceReport
from cinegen.design.torques_at_rest import holding_torques
from cinegen.design.within import WithinTolerances

__all__ = [
    "Calibration",
    "Design",
    "DesignError",
    "DesignEvaluation",
    "Measurements",
    "Parameter",
    "Parameters",
    "Synthesis",
    "SynthesisTask",
    "ToleranceReport",
    "Tolerances",
    "WithinTolerances",
    "calibrate",
    "holding_torques",
    "load_task",
    "synthesize",
    "tolerance",
]
