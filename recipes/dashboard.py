"""Look at runs in a browser: learning curves, flights, scenarios.

pip install 'hyuav[dashboard]'
hyuav dashboard
hyuav dashboard runs=runs port=8600
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

from hyuav.experiments.configuration import Config, recipe, section
from hyuav.viz.dashboard.serve import Dashboard, serve


@recipe("dashboard", Dashboard, groups={}, sections={}, run_directory=".")
def main(config: Config, _: Path) -> None:
    """Serve the dashboard until Ctrl-C."""
    serve(section(config, Dashboard))


if __name__ == "__main__":
    main()
