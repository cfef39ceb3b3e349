"""Lets the wheel hold the recipes, as ``hyuav/recipes/``; all else is in pyproject.toml."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

RECIPES = sorted(Path("recipes").glob("*.py"))


class BuildWithRecipes(build_py):
    """Copy the package, and the recipes into it; an editable installation finds them in place."""

    def run(self) -> None:
        """Copy."""
        super().run()
        if not self.editable_mode:
            for recipe, copy in zip(RECIPES, self._copies(), strict=True):
                self.mkpath(str(copy.parent))
                self.copy_file(str(recipe), str(copy))

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """What is installed."""
        outputs: list[str] = super().get_outputs(include_bytecode)
        return outputs if self.editable_mode else [*outputs, *map(str, self._copies())]

    def _copies(self) -> list[Path]:
        return [Path(self.build_lib) / "hyuav" / recipe for recipe in RECIPES]


setup(cmdclass={"build_py": BuildWithRecipes})
