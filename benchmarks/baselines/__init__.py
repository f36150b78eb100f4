"""Programs written without linkjax, as an engineer would: the hay press in NumPy, SciPy and numba."""
