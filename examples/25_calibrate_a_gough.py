"""Calibrate a Gough platform from 40 poses: is it accurate enough once its true dimensions are known?"""

# %% The task: the platform's position must be known to 0.15 mm (1 sigma) everywhere. A laser tracker has measured 40
# poses with 0.05 mm and 0.01 degrees of noise; some readings went wrong.
import tempfile
from pathlib import Path

import numpy as np

from cinegen.design import Design, calibrate
from cinegen.design.calibration.proposal import propose
from cinegen.design.poses import random_poses
from cinegen.plotting.accuracy import draw_residuals
from raff2urdf.quantities import shown

folder = Path(tempfile.mkdtemp())
calibration = calibrate("gough", Path(__file__).parent / "calibrate_a_gough.csv")

# %% What these measurements determine, and which readings contradict the others.
print(calibration)
print("left out:", *(f"{outlier.where} ({outlier.sigmas:.0f} sigma)" for outlier in calibration.outliers))
for rms in calibration.held_out:
    print("poses not used:", shown(rms.before, rms.dimension), "before,", shown(rms.after, rms.dimension), "after")
draw_residuals(calibration).savefig(folder / "residuals.png")

# %% How well the platform's position is known then, at poses that nobody measured: by the estimate's covariance.
design = Design(calibration.parameters)
moved = design.evaluate(q=random_poses(design, 200, seed=1)).pose_derivative("platform")[:, :3]
error = np.sqrt(np.einsum("nip,pq,niq->n", moved, calibration.covariance, moved))
print(f"position known to {1e3 * np.median(error):.2f} mm in most poses, {1e3 * error.max():.2f} mm at worst")

# %% The decision: if that is not enough, these poses are measured next.
if error.max() > 0.15e-3:
    following = propose(calibration, 20)
    (folder / "next.csv").write_text(following.text())
    print(f"20 more poses: sigma is {following.gain:.2f} times smaller ({following.random_gain:.2f} at random poses)")
(folder / "calibrated.raff").write_text(calibration.raff())
