"""Entry point of the ``crowdsim`` command, and of ``python -m crowdsim``."""

import sys


def main() -> None:
    """Run the command line; report an interrupt (exit code 130) even while the command line is being imported."""
    try:
        from crowdsim.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
