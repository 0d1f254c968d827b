"""Entry point of the ``crowdsim`` command, and of ``python -m crowdsim``."""

import sys


def main() -> None:
    """Run the command line; say so if it is interrupted before it can do so itself."""
    try:
        from crowdsim.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
