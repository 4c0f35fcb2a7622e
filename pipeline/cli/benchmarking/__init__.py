"""`tactile-marks benchmark` and what stands under it."""
