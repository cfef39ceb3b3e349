"""Follow trainings, compare runs, play flights and try scenarios, in a browser.

pip install 'hyuav[dashboard]'
python recipes/dashboard.py
python recipes/dashboard.py runs=runs port=8600
"""

import hyuav_start  # noqa: F401 - first: the rest takes seconds to load

from pathlib import Path

from hyuav.experiments.configuration import Config, recipe, section
from hyuav.viz.dashboard.serve import Dashboard, serve


@recipe("dashboard", Dashboard, groups={}, sections={}, run_directory=".")
def main(config: Config, _: Path) -> None:
    """Serve the dashboard until Ctrl-C."""
    serve(section(config, Dashboard))


if __name__ == "__main__":
    main()
