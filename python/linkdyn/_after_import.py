"""What is to be done as soon as another package has been imported, without importing it."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__all__ = ["when_imported"]


def when_imported(package: str, act: Callable[[], object]) -> None:
    """Call a function behind the import of a package; at once if it has been imported."""
    if package in sys.modules:
        act()
    else:
        sys.meta_path.insert(0, _Watch(package, act))


class _Watch(MetaPathFinder):
    """Finds nothing itself: asks the other finders, and adds something to what the loader does."""

    def __init__(self, package: str, act: Callable[[], object]) -> None:
        self.package, self.act = package, act

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != self.package:
            return None
        sys.meta_path.remove(self)  # once; and the finders that are asked now must not ask it
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _Followed(spec.loader, self.act)
        return spec


class _Followed(Loader):
    """A loader, and what is done behind it; what else it can do it does."""

    def __init__(self, loader: Loader, act: Callable[[], object]) -> None:
        self.loader, self.act = loader, act

    def __getattr__(self, name: str) -> object:
        return getattr(self.loader, name)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self.loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self.loader.exec_module(module)
        if module.__spec__ is not None:
            module.__spec__.loader = module.__loader__ = self.loader
        self.act()
