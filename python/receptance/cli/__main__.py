"""`receptance`, and `python -m receptance.cli`."""

import sys

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


if __name__ == "__main__":
    main()
