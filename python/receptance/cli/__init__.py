"""The command line `receptance`; modules that not every command needs are imported at first use."""

import sys

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

_INTERRUPTED = 130


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        # Takes most of the time of a short command, which Ctrl-C ends in the same way as its work.
        from receptance.cli.app import run

        code = run()
    except KeyboardInterrupt:
        print("receptance: interrupted, no file was left incomplete", file=sys.stderr)
        code = _INTERRUPTED
    raise SystemExit(code)
