"""Forward models, one in each file: functions from a suspension to predicted measurements."""
