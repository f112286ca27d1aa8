"""Tests of `calibrate.experiment.readings`."""
