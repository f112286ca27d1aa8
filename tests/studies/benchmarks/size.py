"""Sizes of an environment by what needs them: `python -m tests.studies.benchmarks.size [PATH]`.

PATH is a folder `site-packages`; left out, that of this interpreter. Sizes are of the files that
packages list as theirs, compiled ones included, in MB of 1,000,000 bytes.
"""

import sys
import sysconfig
from importlib.metadata import Distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LARGEST = 12
"""Packages that are named."""


class Environment:
    """The packages in a folder."""

    def __init__(self, path: str):
        self.packages: dict[str, Distribution] = {
            canonicalize_name(one.name): one for one in distributions(path=[path])
        }

    def needed(self, name: str, extra: str = "", without: str = "") -> set[str]:
        """Names of a package and all that it needs.

        Args:
          name: of the package.
          extra: one of its sets of optional packages, beside the others.
          without: a package that nobody shall need.
        """
        found: set[str] = set()
        ahead = [(name, extra)]
        while ahead:
            package, extra = ahead.pop()
            found.add(package)
            for text in self.packages[package].requires or []:
                needs = Requirement(text)
                of = canonicalize_name(needs.name)
                if needs.marker and not needs.marker.evaluate({"extra": extra}):
                    continue
                if of == without or of not in self.packages:
                    continue
                ahead += [(of, one) for one in needs.extras]
                if of not in found:
                    ahead.append((of, ""))
        return found

    def size(self, names: set[str]) -> float:
        """Size of some packages, MB."""
        return sum(map(self._size, names))

    def _size(self, name: str) -> float:
        files = {Path(str(file.locate())) for file in self.packages[name].files or []}
        return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def text(path: str) -> str:
    """What takes how much, a line each."""
    environment = Environment(path)
    mrjax = environment.needed("mrjax")
    without_jax_md = environment.needed("mrjax", without="jax-md")
    tests = environment.needed("mrjax", extra="test")
    docs = environment.needed("mrjax", extra="docs")
    rows = {
        "all packages": set(environment.packages),
        "mrjax and what it needs": mrjax,
        "of these only for jax-md": mrjax - without_jax_md,
        "more for the tests": tests - mrjax,
        "of these vtk": {"vtk"} & tests,
        "more for the documentation": docs - mrjax,
    }
    lines = [f"{name:32} {environment.size(of):7.0f} MB" for name, of in rows.items()]
    largest = sorted(environment.packages, key=lambda one: -environment.size({one}))
    for one in largest[:LARGEST]:
        of = "jax-md" if one in mrjax - without_jax_md else "mrjax" if one in mrjax else ""
        of = of or ("tests" if one in tests else "docs" if one in docs else "none of these")
        lines.append(f"  {one:30} {environment.size({one}):7.0f} MB, for {of}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(text(sys.argv[1] if len(sys.argv) > 1 else sysconfig.get_path("purelib")))
