"""The verbs of the command line, one file each; the file's name is the verb, its first word in the help its place.

A file has a function ``verb`` and a number ``place`` that orders the help. Libraries are imported inside the function:
numba and arviz take seconds that ``--help`` should not.
"""
