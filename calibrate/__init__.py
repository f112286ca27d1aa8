"""Fits the simulator to measurements, and says what the data determine."""
