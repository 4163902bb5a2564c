"""Run the command line as ``python -m cdcp_igl``."""

from .command_line.entry import main

main()
