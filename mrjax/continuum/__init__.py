"""Sedimentation in a tall tube, in one dimension: Kynch's theory, rigid or compressible beds."""
