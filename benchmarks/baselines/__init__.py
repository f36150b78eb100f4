"""What an engineer would write without linkjax: the hay press by hand, in NumPy, SciPy and numba."""
