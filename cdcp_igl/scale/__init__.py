"""What runs many maps: a file and its map, batches, processes, one surface in parts.

No map is made here. The page on batches, docs/reference/batches.md, says what there is.
"""
