"""Run the command line as ``python -m cdcp_igl``."""

from .cli import main

main()
