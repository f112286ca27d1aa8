"""The options of `mrjax simulate` as one object."""

from dataclasses import dataclass

Processes = tuple[str | None, int | None, int | None]
"""Address, count and id of a process; three times None to ask the scheduler of a cluster."""


@dataclass(frozen=True)
class Request:
    """The options and arguments of the command."""

    recipe: str
    out: str
    duration: float | None
    """Physical time, s; None for a run to rest."""
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
        """True for a run to rest, that is without a duration."""
        return self.duration is None

    @property
    def records_trajectory(self) -> bool:
        """True if a trajectory file or an animation is requested."""
        return bool(self.trajectory or self.animate)

    @property
    def seeds(self) -> range:
        """Seeds of the random starts."""
        return range(self.seed, self.seed + self.ensemble)
