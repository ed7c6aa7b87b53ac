"""Commands that design robots: synthesis, tolerances, calibration."""
