"""Any surface onto charts: sheets, cuts, and a map of each component."""
