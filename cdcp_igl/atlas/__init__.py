"""Any surface onto disks: sheets, cuts, and a map of each component."""
