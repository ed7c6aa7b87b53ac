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
found = calibrate("gough", Path(__file__).parent / "calibrate_a_gough.csv")

# %% What these measurements determine, and which readings contradict the others.
print(found)
print("left out:", *(f"{one.where} ({one.sigmas:.0f} sigma)" for one in found.outliers))
for one in found.held_out:
    print("poses not used:", shown(one.before, one.dimension), "before,", shown(one.after, one.dimension), "after")
draw_residuals(found).savefig(folder / "residuals.png")

# %% How well the platform's position is known then, at poses that nobody measured: by the estimate's covariance.
design = Design(found.parameters)
moved = design.evaluate(q=random_poses(design, 200, seed=1)).pose_derivative("platform")[:, :3]
error = np.sqrt(np.einsum("nip,pq,niq->n", moved, found.covariance, moved))
print(f"position known to {1e3 * np.median(error):.2f} mm in most poses, {1e3 * error.max():.2f} mm at worst")

# %% The decision: if that is not enough, these poses are measured next.
if error.max() > 0.15e-3:
    following = propose(found, 20)
    (folder / "next.csv").write_text(following.text())
    print(f"20 more poses: sigma is {following.gain:.2f} times smaller ({following.random_gain:.2f} at random poses)")
(folder / "calibrated.raff").write_text(found.raff())
