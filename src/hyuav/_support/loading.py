"""Libraries that have something to say while they are loaded, loaded without it."""

import importlib
import logging
import warnings


def load_quietly(module: str) -> None:
    """Import a module so that neither a warning nor a line of its loggers is seen.

    TorchRL warns of a class of its own, and loads Ray where that is installed, which looks for
    parts of a notebook. Errors are raised, and afterwards filters and loggers are as they were.

    Args:
        module: of a library, with all that it imports.

    Raises:
        ImportError: as ``import`` would.
    """
    disabled = logging.root.manager.disable
    logging.disable(max(disabled, logging.WARNING))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            importlib.import_module(module)
    finally:
        logging.disable(disabled)
