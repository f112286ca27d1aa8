"""Speed, and calibration beside another code."""
