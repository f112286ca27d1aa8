"""A settling column of several classes of particles: sizes and densities that differ.

`masliyah` has the velocities, `scheme` the finite volumes, `interfaces` the heights of fronts and
`column` the public call. It exports `polydisperse_column` and its result.
"""
