"""A calibration beside GrainLearning."""
