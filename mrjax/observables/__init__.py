"""What is read off a run: velocities, heights by several definitions, volume fractions, fronts."""
