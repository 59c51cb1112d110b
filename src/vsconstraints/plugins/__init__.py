"""What is not the package's own: parts of users, packages that are not there, where results come
from.
"""
