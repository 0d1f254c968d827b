"""``python -m crowdsim`` is the ``crowdsim`` command."""

from crowdsim.cli.app import main

main()
