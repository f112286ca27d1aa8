"""Old module names, so that old imports keep working: one table for each package.

`mrjax.contact`, `import mrjax.contact` and `from mrjax.contact import normal_force` give the module
that replaced the old one. New code uses the new names.
"""

import importlib
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

OLD_NAMES = {
    "box": "core.box",
    "by_numpy": "core.numpy_evaluation",
    "cache": "cli.program_cache",
    "checkpoint": "io.checkpoint",
    "checks": "core.checks",
    "column": "continuum.column",
    "commands": "cli.exit_status",
    "compression": "continuum.compression",
    "concentration": "observables.concentration",
    "concrete": "core.tracing",
    "contact": "laws.normal",
    "derived": "simulation.derived",
    "disperse": "simulation.disperse",
    "drag": "laws.drag",
    "dropped": "paper.dry_beds",
    "engine": "dem.engine",
    "ensemble": "simulation.ensemble",
    "environment": "cli.environment",
    "errors": "core.errors",
    "exit_at_once": "cli.exit_at_once",
    "expected": "simulation.estimates",
    "failure": "simulation.failure",
    "files": "io.files",
    "forces": "dem.forces",
    "frame": "kernel.llvm.xla_ffi",
    "friction": "laws.tangential",
    "hindrance": "laws.hindrance",
    "history": "dem.contact_history",
    "identity": "io.identity",
    "instructions": "kernel.llvm.jaxpr",
    "interruption": "core.interruption",
    "kynch": "continuum.kynch",
    "leapfrog": "dem.integrator",
    "loads": "dem.contact_list",
    "loop": "kernel.loop",
    "machine_code": "kernel.llvm.codegen",
    "markers": "io.markers",
    "messages": "simulation.messages",
    "neighbours": "dem.neighbours",
    "npz": "io.npz",
    "observe": "observables.interface",
    "order": "dem.sorting",
    "overlap": "simulation.overlap",
    "pairs": "dem.pairs",
    "pairwise": "kernel.summation",
    "paper_figures": "paper.figures",
    "parameters": "core.parameters",
    "particle": "laws.particle",
    "partners": "simulation.partners",
    "parts": "kernel.llvm.chunks",
    "permissive": "core.promotion",
    "pieces": "simulation.pieces",
    "processes": "simulation.processes",
    "randomness": "core.randomness",
    "reading": "io.reading",
    "recipes": "recipe.bundled",
    "refusals": "core.refusals",
    "reproduce": "paper",
    "results": "io.results",
    "resume": "cli.resume",
    "rolling": "laws.rolling",
    "run": "core.run",
    "run_file": "io.run_file",
    "scan": "dem.scan",
    "schedule": "dem.schedule",
    "sedimentation": "simulation.sedimentation",
    "settle": "simulation.settle",
    "sheets": "recipe.sheets",
    "simulate": "simulation.simulate",
    "sizes": "recipe.sizes",
    "soften": "simulation.softening",
    "stability": "dem.stability",
    "stages": "simulation.follow",
    "state": "core.state",
    "state_file": "io.state_file",
    "streams": "cli.streams",
    "surfaces": "laws.effective",
    "text": "core.text",
    "theory": "laws.closed_forms",
    "threads": "kernel.llvm.threads",
    "timestep": "laws.time_scales",
    "toml_limits": "recipe.toml_limits",
    "trajectory": "core.trajectory",
    "units": "core.units",
    "validity": "laws.dimensionless",
    "vectors": "laws.vectors",
    "viewers": "io.viewers",
    "watching": "simulation.progress",
}
"""Current name within the package, by the old name."""
FUNCTIONS = (
    "column",
    "concentration",
    "disperse",
    "ensemble",
    "sedimentation",
    "settle",
    "simulate",
)
"""Old module names that are also functions of the package; the function takes precedence."""


class Aliases:
    """Finder and loader of a package's modules by their old names.

    It is no subclass of `importlib.abc`, which takes longer to import than all of mrjax.
    """

    def __init__(self, package: str, old_names: Mapping[str, str]) -> None:
        self.package, self.old_names = package, old_names

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns the specification of an old name; None for any other name."""
        package, _, name = fullname.partition(".")
        if package == self.package and name in self.old_names:
            return ModuleSpec(fullname, self)  # type: ignore[arg-type] # has a loader's methods
        return None

    def create_module(self, spec: ModuleSpec) -> None:
        """Returns None: Python makes an empty module, which `exec_module` replaces."""

    def exec_module(self, module: ModuleType) -> None:
        """Registers the current module under the old name."""
        old = module.__name__
        new = self.old_names[old.partition(".")[2]]
        sys.modules[old] = importlib.import_module(f"{self.package}.{new}")


def install(package: str, old_names: Mapping[str, str], functions: Sequence[str]) -> None:
    """Makes the modules of a package importable by their old names.

    Args:
      package: name of the package.
      old_names: current name within the package, by the old name.
      functions: old module names that are also functions of the package; the function takes
        precedence.
    """

    class Package(ModuleType):
        """The package, whose functions are not hidden by old modules of the same name."""

        def __setattr__(self, name: str, value: object) -> None:
            """Sets an attribute, unless a module would hide a function."""
            if not (name in functions and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

    sys.meta_path.append(Aliases(package, old_names))
    sys.modules[package].__class__ = Package
