"""Puts the `.msg` texts, whose home is `logs/msg` of the repository, into the package when it is built."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

TEXTS = Path(__file__).resolve().parent / "../../logs/msg"


class BuildWithTexts(build_py):
    """The package with its texts."""

    def run(self) -> None:
        super().run()
        # A package that was built before has them already.
        if TEXTS.is_dir() and not self.editable_mode:
            shutil.copytree(TEXTS, Path(self.build_lib) / "gridweave/msg/texts", dirs_exist_ok=True,
                            ignore=lambda folder, names: [n for n in names if not (Path(folder) / n).is_dir() and not n.endswith(".msg")])


setup(cmdclass={"build_py": BuildWithTexts})
