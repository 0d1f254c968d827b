"""Entry point of ``python -m crowdsim``, the same as the ``crowdsim`` command."""

from crowdsim.cli.app import main

main()
