"""The program ``cdcp-igl``."""
