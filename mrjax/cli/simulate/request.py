"""The options of `mrjax simulate` as one object."""

from dataclasses import dataclass

Processes = tuple[str | None, int | None, int | None]
"""Address, count and number, or three times None for those of a cluster's scheduler."""


@dataclass(frozen=True)
class Request:
    """A run as the command line asks for it."""

    recipe: str
    out: str
    duration: float | None
    """Physical time, s; None: to rest."""
    time_step: float | None
    frames: int
    overlap: float
    ensemble: int
    trajectory: tuple[str, ...]
    animate: tuple[str, ...]
    pdf: bool
    distributed: Processes | None
    resume: bool
    seed: int
    dtype: str
    quiet: bool
    as_json: bool

    @property
    def to_rest(self) -> bool:
        """True without a duration."""
        return self.duration is None

    @property
    def records_trajectory(self) -> bool:
        """True if a file of positions or a film is asked for."""
        return bool(self.trajectory or self.animate)

    @property
    def seeds(self) -> range:
        """Seeds of the random starts."""
        return range(self.seed, self.seed + self.ensemble)
