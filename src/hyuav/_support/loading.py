"""Libraries that have something to say while they are loaded, loaded without it."""

import gc
import importlib
import logging
import warnings

SELDOM = 100_000, 50, 100
"""Thresholds of the garbage collector while libraries are loaded: what they bring stays, and to
search it again and again would take half as long as the rest."""

_AS_EVER = gc.get_threshold()


def collect_as_ever() -> None:
    """End what :data:`SELDOM` began in a program; what has been loaded is searched no more."""
    if gc.get_threshold() == SELDOM:
        gc.set_threshold(*_AS_EVER)
        gc.freeze()


def load_quietly(module: str) -> None:
    """Import a module so that neither a warning nor a line of its loggers is seen.

    TorchRL warns of a class of its own, and loads Ray where that is installed, which looks for
    parts of a notebook. Errors are raised, and afterwards filters, loggers and the collector of
    garbage are as they were.

    Args:
        module: of a library, with all that it imports.

    Raises:
        ImportError: as ``import`` would.
    """
    disabled, thresholds = logging.root.manager.disable, gc.get_threshold()
    logging.disable(max(disabled, logging.WARNING))
    gc.set_threshold(*SELDOM)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            importlib.import_module(module)
    finally:
        logging.disable(disabled)
        gc.set_threshold(*thresholds)
