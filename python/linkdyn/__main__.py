"""``python -m linkdyn``: the command ``linkdyn``."""

from .cli import main

main()
