"""What fits call determined, against dense grids and many starts: synthetic problems."""
